"""Faults of inputs: what reaches planner and guard of the messages of each control period."""

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from serd_bag.nearest import choice_rule
from serd_core.arrays import BoolArray
from serd_sim.errors import SimError
from serd_sim.safety.motion import Pose
from serd_sim.safety.reasons import Source
from serd_sim.safety.scan import Scan
from serd_sim.safety.world_guard import Message

_NOISE_M = 0.05
_JUMP_M = 2.0


Messages = list[Message]
#: Called every control period with the messages that were published; returns those that arrive.
Channel = Callable[[Messages], Messages]


def intact(messages: Messages) -> Messages:
    """Every message arrives."""
    return messages


def _stops(source: Source) -> Channel:
    return lambda messages: [each for each in messages if each.source is not source]


def _altered(source: Source, change: Callable[[Any], Any]) -> Channel:
    def altered(messages: Messages) -> Messages:
        return [
            replace(each, value=change(each.value)) if each.source is source else each
            for each in messages
        ]

    return altered


def _frozen(source: Source) -> Channel:
    """The first value again and again, with the stamps of the messages."""
    first: list[Any] = []

    def kept(value: Any) -> Any:
        first[:] = first or [value]
        is_scan = isinstance(value, Scan)
        return replace(first[0], stamp_s=value.stamp_s) if is_scan else first[0]

    return _altered(source, kept)


def _late(delay_s: float, period_s: float) -> Channel:
    """Every message that much later, with its true stamp."""
    waiting: deque[Messages] = deque([] for _ in range(round(delay_s / period_s)))

    def late(messages: Messages) -> Messages:
        waiting.append(messages)
        return waiting.popleft()

    return late


def _every_range(value: float) -> Channel:
    return _altered(
        Source.SCAN, lambda scan: replace(scan, ranges_m=np.full_like(scan.ranges_m, value))
    )


def rays_ahead(scan: Scan) -> BoolArray:
    """(n_rays,) which rays are in the quarter turn ahead of the robot."""
    bearing_rad = scan.angles_rad + (0.0 if scan.mount is None else scan.mount[2])
    return np.cos(bearing_rad) > math.sqrt(0.5)


def _sector_ahead(value: float) -> Channel:
    """The ranges of a quarter turn ahead have that value."""

    def hidden(scan: Scan) -> Scan:
        ranges_m = np.where(rays_ahead(scan), np.float32(value), scan.ranges_m)
        return replace(scan, ranges_m=ranges_m)

    return _altered(Source.SCAN, hidden)


def _without_twist(odometry: tuple[Pose, tuple[float, float]]) -> tuple[Pose, tuple[float, float]]:
    return odometry[0], (0.0, 0.0)


def _noisy(rng: np.random.Generator, lost_share: float) -> Channel:
    """Normal noise on every range, and that share of the rays without one."""

    def noisy(scan: Scan) -> Scan:
        noise = _NOISE_M * rng.standard_normal(len(scan.ranges_m))
        lost = rng.random(len(scan.ranges_m)) < lost_share
        ranges_m = np.where(lost, np.inf, scan.ranges_m + noise).astype(np.float32)
        return replace(scan, ranges_m=ranges_m)

    return _altered(Source.SCAN, noisy)


def _jumped(pose: Pose) -> Pose:
    return pose[0] + _JUMP_M, pose[1], pose[2]


@dataclass(frozen=True)
class FaultKind:
    """One fault.

    make: the channel, from a random generator and the control period (s). people_from: what the
    planner relies on. lasts: through the whole episode, not from full speed on. ends_waypoints: the
    source of waypoints falls silent instead.
    """

    about: str
    make: Callable[[np.random.Generator, float], Channel]
    people_from: str = "given"
    lasts: bool = False
    ends_waypoints: bool = False


FAULTS: dict[str, FaultKind] = {
    "none": FaultKind("no fault, people as given", lambda *_: intact, lasts=True),
    "none_scan": FaultKind("no fault, people from scans", lambda *_: intact, "scan", lasts=True),
    "scan_stops": FaultKind("scan stops", lambda *_: _stops(Source.SCAN), "scan"),
    "scan_nan": FaultKind("scan is all NaN", lambda *_: _every_range(np.nan), "scan"),
    "scan_inf": FaultKind("scan is all inf", lambda *_: _every_range(np.inf), "scan"),
    "scan_near": FaultKind(
        "a quarter turn ahead is -inf", lambda *_: _sector_ahead(-np.inf), "scan"
    ),
    "scan_zero": FaultKind("a quarter turn ahead is 0", lambda *_: _sector_ahead(0.0), "scan"),
    "scan_sector": FaultKind(
        "a quarter turn ahead turns inf", lambda *_: _sector_ahead(np.inf), "scan"
    ),
    "scan_frozen": FaultKind(
        "scan frozen under fresh stamps", lambda *_: _frozen(Source.SCAN), "scan"
    ),
    "people_stop": FaultKind("pedestrians stop", lambda *_: _stops(Source.PEOPLE)),
    "people_frozen": FaultKind(
        "pedestrians frozen under fresh stamps", lambda *_: _frozen(Source.PEOPLE)
    ),
    "pose_stops": FaultKind(
        "robot_pose stops, or is in another frame", lambda *_: _stops(Source.POSE)
    ),
    "pose_frozen": FaultKind(
        "robot_pose frozen under fresh stamps", lambda *_: _frozen(Source.POSE)
    ),
    "pose_jumps": FaultKind("robot_pose jumps by 2 m", lambda *_: _altered(Source.POSE, _jumped)),
    "odom_stops": FaultKind("odom stops", lambda *_: _stops(Source.ODOMETRY)),
    "odom_twist": FaultKind(
        "the twist of odom is 0", lambda *_: _altered(Source.ODOMETRY, _without_twist)
    ),
    "odom_frozen": FaultKind("odom frozen under fresh stamps", lambda *_: _frozen(Source.ODOMETRY)),
    "delay_1s": FaultKind("every input 1 s late", lambda _, period_s: _late(1.0, period_s)),
    "delay_3s": FaultKind("every input 3 s late", lambda _, period_s: _late(3.0, period_s)),
    "delay_1s_scan": FaultKind(
        "every input 1 s late", lambda _, period_s: _late(1.0, period_s), "scan"
    ),
    "waypoints_stop": FaultKind("waypoints stop", lambda *_: intact, ends_waypoints=True),
    "scan_noise": FaultKind(
        "5 cm noise and 10 % of the rays lost", lambda rng, _: _noisy(rng, 0.1), "scan", lasts=True
    ),
    "scan_half": FaultKind(
        "5 cm noise and half of the rays lost", lambda rng, _: _noisy(rng, 0.5), "scan", lasts=True
    ),
}


def fault_named(name: str) -> FaultKind:
    """The fault of that name; SimError with the nearest name when there is none."""
    if name not in FAULTS:
        raise SimError(choice_rule("fault", name, FAULTS))
    return FAULTS[name]
