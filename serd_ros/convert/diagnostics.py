"""A node's health and numbers as diagnostic_msgs/DiagnosticArray."""

from collections.abc import Mapping

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from serd_ros.convert.stamp import to_stamp

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
