"""diagnostic_msgs/DiagnosticArray: the health and numbers of nodes, and the marks of episodes."""

from collections.abc import Mapping
from typing import TypeVar

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from serd_app.drives.drive import END, EPISODE, OUTCOMES, START, EpisodeMark
from serd_ros.convert.stamp import require_one_of, stamp_ns, stamp_s, to_header
from serd_ros.errors import MessageError

#: The world's report where no simulated world counts contacts.
UNCOUNTED = dict.fromkeys(("robot_on_person", "person_on_robot", "robot_on_wall"), "0")
UNCOUNTED["minimum_person_distance_m"] = "nan"
Number = TypeVar("Number", int, float)
OK, WARN, ERROR = DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR
_LARGEST_COUNT = 2**63 - 1


def to_diagnostics(
    name: str,
    time_s: float,
    values: Mapping[str, object],
    *,
    level: bytes = OK,
    message: str = "",
    hardware: str = "serd",
) -> DiagnosticArray:
    """One status of one node; numbers are written so that they read back exactly."""
    pairs = [KeyValue(key=key, value=repr_of(value)) for key, value in values.items()]
    status = DiagnosticStatus(
        level=level, name=name, message=message, hardware_id=hardware, values=pairs
    )
    return DiagnosticArray(header=to_header("", time_s), status=[status])


def values_of(message: DiagnosticArray, name: str) -> dict[str, str] | None:
    """The values of the status of that name, None when the array has none."""
    status = _status_named(message, name)
    return None if status is None else {item.key: item.value for item in status.values}


def _status_named(message: DiagnosticArray, name: str) -> DiagnosticStatus | None:
    return next((status for status in message.status if status.name == name), None)


def from_world_report(message: DiagnosticArray) -> tuple[int, dict[str, str]] | None:
    """(stamp_ns, contacts and distances) of the simulator; None where the array has none."""
    values = values_of(message, "hallway_sim")
    if values is None:
        return None
    for key, example in UNCOUNTED.items():
        _number(values, key, int if example.isdecimal() else float)
    return stamp_ns(message.header.stamp), values


def from_learner_report(message: DiagnosticArray) -> tuple[float, float] | None:
    """Where (m) the next demonstration teaches most; None when the array does not have it.

    MessageError where it is no finite place.
    """
    values = values_of(message, "learner")
    if values is None or "next_x_m" not in values:
        return None
    place = _number(values, "next_x_m", float), _number(values, "next_y_m", float)
    if not np.isfinite(place).all():
        raise MessageError("next_x_m and next_y_m must be finite", place, "publish a place")
    return place


def _text(values: Mapping[str, str], key: str) -> str:
    if key not in values:
        present = ", ".join(values) or "none"
        raise MessageError(f"values must have the key {key}", present, "publish all keys")
    return values[key]


def _number(values: Mapping[str, str], key: str, kind: type[Number]) -> Number:
    """A count from 0 on, or any float."""
    text = _text(values, key)
    try:
        number = kind(text)
    except ValueError:
        raise MessageError(f"{key} must be a number", repr(text[:40]), "correct it") from None
    if kind is int and not 0 <= number < _LARGEST_COUNT:
        raise MessageError(f"{key} must be from 0 to {_LARGEST_COUNT}", number, "publish a count")
    return number


def repr_of(value: object) -> str:
    """Floats by repr (exact), anything else by str."""
    return repr(float(value)) if isinstance(value, float) else str(value)


def to_episode_message(mark: EpisodeMark) -> DiagnosticArray:
    """The mark as one status named `episode`."""
    names = ("episode", "driver", "seed", "start_area", "outcome", "reason")
    values = {name: getattr(mark, name) for name in names}
    return to_diagnostics(EPISODE, mark.time_s, values, message=mark.event, hardware=mark.driver)


def from_episode_message(message: DiagnosticArray) -> EpisodeMark:
    """The mark of a message; MessageError where a part of it is missing or is none."""
    status = _status_named(message, EPISODE)
    if status is None:
        names = ", ".join(status.name for status in message.status) or "none"
        raise MessageError("status must have one named 'episode'", names, "publish marks there")
    values = {item.key: item.value for item in status.values}
    return EpisodeMark(
        event=require_one_of("message", status.message, (START, END)),
        time_s=stamp_s(message.header.stamp),
        episode=_number(values, "episode", int),
        driver=_text(values, "driver"),
        seed=_number(values, "seed", int),
        start_area=_text(values, "start_area"),
        outcome=require_one_of("outcome", _text(values, "outcome"), OUTCOMES),
        reason=values.get("reason", ""),
    )
