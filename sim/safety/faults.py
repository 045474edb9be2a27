"""Faults of inputs: what reaches planner and guard of the messages of each control period."""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from sim.errors import SimError
from sim.safety.motion import Pose
from sim.safety.reasons import Source
from sim.safety.scan import Scan
from sim.safety.world_guard import Message
from storage.nearest import choice_rule

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
        return first[0]

    return _altered(source, kept)


def _frozen_scan() -> Channel:
    first: list[Scan] = []

    def kept(scan: Scan) -> Scan:
        first[:] = first or [scan]
        return replace(first[0], stamp_s=scan.stamp_s)

    return _altered(Source.SCAN, kept)


def _late(delay_periods: int) -> Channel:
    """Every message that many control periods later, with its true stamp."""
    waiting: deque[Messages] = deque([] for _ in range(delay_periods))

    def late(messages: Messages) -> Messages:
        waiting.append(messages)
        return waiting.popleft()

    return late


def _every_range(value: float) -> Channel:
    return _altered(
        Source.SCAN, lambda scan: replace(scan, ranges_m=np.full_like(scan.ranges_m, value))
    )


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

    people_from: what the planner relies on. make: the channel, from a random generator and the
    control period (s). lasts: through the whole episode, not from full speed on.
    ends_waypoints: the source of waypoints falls silent instead.
    """

    about: str
    people_from: str
    make: Callable[[np.random.Generator, float], Channel]
    lasts: bool = False
    ends_waypoints: bool = False


def _fault(about: str, make: Callable[[], Channel], people_from: str = "given") -> FaultKind:
    return FaultKind(about, people_from, lambda _rng, _period_s: make())


FAULTS: dict[str, FaultKind] = {
    "none": FaultKind(
        "no fault, people as given", "given", lambda _rng, _period_s: intact, lasts=True
    ),
    "none_scan": FaultKind(
        "no fault, people from scans", "scan", lambda _rng, _period_s: intact, lasts=True
    ),
    "scan_stops": _fault("scan stops", lambda: _stops(Source.SCAN), "scan"),
    "scan_nan": _fault("scan is all NaN", lambda: _every_range(np.nan), "scan"),
    "scan_inf": _fault("scan is all inf", lambda: _every_range(np.inf), "scan"),
    "scan_frozen": _fault("scan frozen under fresh stamps", _frozen_scan, "scan"),
    "people_stop": _fault("pedestrians stop", lambda: _stops(Source.PEOPLE)),
    "people_frozen": _fault(
        "pedestrians frozen under fresh stamps", lambda: _frozen(Source.PEOPLE)
    ),
    "pose_stops": _fault("robot_pose stops, or is in another frame", lambda: _stops(Source.POSE)),
    "pose_frozen": _fault("robot_pose frozen under fresh stamps", lambda: _frozen(Source.POSE)),
    "pose_jumps": _fault("robot_pose jumps by 2 m", lambda: _altered(Source.POSE, _jumped)),
    "odom_stops": _fault("odom stops", lambda: _stops(Source.ODOMETRY)),
    "odom_frozen": _fault("odom frozen under fresh stamps", lambda: _frozen(Source.ODOMETRY)),
    "delay_1s": FaultKind(
        "every input 1 s late", "given", lambda _rng, period_s: _late(round(1.0 / period_s))
    ),
    "delay_3s": FaultKind(
        "every input 3 s late", "given", lambda _rng, period_s: _late(round(3.0 / period_s))
    ),
    "delay_1s_scan": FaultKind(
        "every input 1 s late", "scan", lambda _rng, period_s: _late(round(1.0 / period_s))
    ),
    "waypoints_stop": FaultKind(
        "waypoints stop", "given", lambda _rng, _period_s: intact, ends_waypoints=True
    ),
    "scan_noise": FaultKind(
        "5 cm noise and 10 % of the rays lost",
        "scan",
        lambda rng, _period_s: _noisy(rng, 0.1),
        lasts=True,
    ),
    "scan_half": FaultKind(
        "5 cm noise and half of the rays lost",
        "scan",
        lambda rng, _period_s: _noisy(rng, 0.5),
        lasts=True,
    ),
}


def fault_named(name: str) -> FaultKind:
    """The fault of that name; SimError with the nearest name when there is none."""
    if name not in FAULTS:
        raise SimError(choice_rule("fault", name, FAULTS))
    return FAULTS[name]
