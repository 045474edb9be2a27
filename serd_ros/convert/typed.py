"""Messages of serd_msgs, made and sent as bytes, so that the package need not be installed.

The definitions are those of ros_ws/src/serd_msgs. colcon builds that package where ROS is
installed, `make interfaces` elsewhere; who subscribes in a program of his own needs it.
"""

import math
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from rosbags.typesys import get_types_from_msg

from serd_bag.formats.rosbag2.message_types import rosbags_types
from serd_core.grid.grid import direction_of_action
from serd_ros.convert.stamp import to_stamp
from serd_ros.endpoints import topics
from serd_ros.errors import MessageError
from serd_sim.safety.reasons import GuardAction

if TYPE_CHECKING:  # all nodes import this module, and few load SciPy
    from serd_app.navigation.navigator import ArrivalForecast
    from serd_core.arrival.law import ArrivalLaw
    from serd_sim.safety.guard import GuardOutput

PACKAGE = "serd_msgs"
REPLAYED, GUARD_STATE = f"{PACKAGE}/msg/Replayed", f"{PACKAGE}/msg/GuardState"
_DEFINITIONS = Path(__file__).parents[1] / "interfaces"
SHARES = (0.1, 0.25, 0.5, 0.75, 0.9)
_SMALLEST_STEP = 1e-3


@cache
def register() -> None:
    """Make the messages known to the type store of bags."""
    for file in sorted(_DEFINITIONS.glob("*.msg")):
        text = file.read_text("utf-8")
        rosbags_types().register(get_types_from_msg(text, f"{PACKAGE}/msg/{file.stem}"))


def _made(name: str, time_s: float, **fields: Any) -> bytes:
    register()
    types, stamp = rosbags_types().types, to_stamp(time_s)
    at = types["builtin_interfaces/msg/Time"](stamp.sec, stamp.nanosec)
    header = types["std_msgs/msg/Header"](at, topics.MAP_FRAME)
    full = f"{PACKAGE}/msg/{name}"
    message = types[full](header=header, **fields)
    return bytes(rosbags_types().serialize_cdr(message, full))


def to_replayed(topic: str, log_times_ns: Sequence[int]) -> bytes:
    """serd_msgs/Replayed: the log times of messages that were published on a topic."""
    register()
    times_ns = np.array(log_times_ns, dtype=np.int64)
    message = rosbags_types().types[REPLAYED](topic=topic, log_times=times_ns)
    return bytes(rosbags_types().serialize_cdr(message, REPLAYED))


def to_guard_state(output: "GuardOutput", time_s: float) -> bytes:
    """serd_msgs/GuardState."""
    return _made(
        "GuardState", time_s,
        **{each.name: each.value for each in type(output.action)},
        action=int(output.action),
        overridden=output.overridden,
        reasons=list(map(str, output.reasons)),
    )  # fmt: skip


def from_guard_state(data: bytes) -> dict[str, str]:
    """The values action, overridden and reasons of a GuardState; MessageError where it is none."""
    try:
        message: Any = rosbags_types().deserialize_cdr(data, GUARD_STATE)
        action = GuardAction(message.action).name
    except Exception as error:  # rosbags raises what its decoder meets
        raise MessageError(f"message must be a {GUARD_STATE}", error, "correct it") from None
    reasons = ", ".join(message.reasons)
    return {"action": action, "overridden": str(message.overridden), "reasons": reasons}


def quantiles_s(law: "ArrivalLaw", shares: Sequence[float]) -> list[float]:
    """When each share has arrived; NaN where fewer ever do."""
    found = (law.quantile_s(share) for share in shares)
    return [math.nan if time_s is None else time_s for time_s in found]


def to_arrival_forecast(
    law: "ArrivalLaw",
    time_s: float,
    *,
    elapsed_s: float,
    area_m: Sequence[tuple[float, float]],
    deadline_s: float,
    shares: Sequence[float] = SHARES,
) -> bytes:
    """serd_msgs/ArrivalForecast of the law of the remaining time at a time.

    area_m: corners of the goal area. The steps of the law are of at least a thousandth.
    """
    kept = [0]
    for step in range(1, len(law.cdf)):
        if law.cdf[step] - law.cdf[kept[-1]] >= _SMALLEST_STEP:
            kept.append(step)
    steps_s = np.diff(law.times_s)
    point = rosbags_types().types["geometry_msgs/msg/Point"](
        *map(float, np.mean(area_m, axis=0)), 0.0
    )
    return _made(
        "ArrivalForecast", time_s,
        goal=point,
        elapsed=float(elapsed_s),
        shares=np.array(shares, dtype=np.float64),
        quantiles=np.array(quantiles_s(law, shares)),
        mean=float(law.times_s[0] + (1.0 - law.cdf[:-1]) @ steps_s),
        deadline=float(deadline_s),
        probability=float(law.probability_by(deadline_s)),
        arrival_probability=float(law.arrival_probability),
        times=law.times_s[kept],
        probabilities=law.cdf[kept],
    )  # fmt: skip


def to_decision(forecast: "ArrivalForecast") -> bytes:
    """serd_msgs/Decision of a decision that has its forecast."""
    east, north = direction_of_action(forecast.action)
    return _made(
        "Decision", forecast.time_s,
        WAIT=0, NORTH=1, EAST=2, SOUTH=3, WEST=4,
        cell=forecast.state,
        action=int(forecast.action),
        direction=rosbags_types().types["geometry_msgs/msg/Vector3"](east, north, 0.0),
        elapsed=float(forecast.elapsed_s),
        trapped=bool(forecast.trapped),
        least_time=bool(forecast.by_time),
        decisions_without_progress=forecast.decisions_without_progress,
        situation=forecast.situation,
    )  # fmt: skip
