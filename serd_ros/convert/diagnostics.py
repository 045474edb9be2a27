"""diagnostic_msgs/DiagnosticArray: the health and numbers of nodes, and the marks of episodes."""

from collections.abc import Mapping
from dataclasses import dataclass

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from serd_ros.convert.stamp import stamp_s, to_stamp

OK, WARN, ERROR = DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR


def to_diagnostics(
    name: str, time_s: float, values: Mapping[str, object], *, level: bytes = OK, message: str = ""
) -> DiagnosticArray:
    """One status of one node; numbers are written so that they read back exactly."""
    status = DiagnosticStatus(
        level=level,
        name=name,
        message=message,
        hardware_id="serd",
        values=[KeyValue(key=key, value=repr_of(value)) for key, value in values.items()],
    )
    array = DiagnosticArray(status=[status])
    array.header.stamp = to_stamp(time_s)
    return array


def values_of(message: DiagnosticArray, name: str) -> dict[str, str] | None:
    """The values of the status of that name, None when the array has none."""
    for status in message.status:
        if status.name == name:
            return {item.key: item.value for item in status.values}
    return None


def repr_of(value: object) -> str:
    """Floats by repr (exact), anything else by str."""
    return repr(float(value)) if isinstance(value, float) else str(value)


START, END = "start", "end"


@dataclass(frozen=True)
class EpisodeMark:
    """event: "start" or "end"; outcome: arrived, timeout or aborted, empty at the start.

    reason: why the driver gave up, empty where it did not.
    """

    event: str
    time_s: float
    episode: int
    driver: str
    seed: int
    start_area: str
    outcome: str = ""
    reason: str = ""


def to_episode_message(mark: EpisodeMark) -> DiagnosticArray:
    """The mark as one status named `episode`."""
    values = {
        "episode": str(mark.episode),
        "driver": mark.driver,
        "seed": str(mark.seed),
        "start_area": mark.start_area,
        "outcome": mark.outcome,
        "reason": mark.reason,
    }
    status = DiagnosticStatus(
        level=DiagnosticStatus.OK,
        name="episode",
        message=mark.event,
        hardware_id=mark.driver,
        values=[KeyValue(key=key, value=value) for key, value in values.items()],
    )
    message = DiagnosticArray(status=[status])
    message.header.stamp = to_stamp(mark.time_s)
    return message


def from_episode_message(message: DiagnosticArray) -> EpisodeMark:
    """The mark a message carries."""
    status = message.status[0]
    values = {item.key: item.value for item in status.values}
    return EpisodeMark(
        event=status.message,
        time_s=stamp_s(message.header.stamp),
        episode=int(values["episode"]),
        driver=values["driver"],
        seed=int(values["seed"]),
        start_area=values["start_area"],
        outcome=values["outcome"],
        reason=values.get("reason", ""),
    )
