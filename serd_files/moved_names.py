"""Names of version 0.2.0 that left or moved, and where to; version 0.4.0 forgets them."""

from collections.abc import Callable, Iterable
from typing import Any, Literal

from serd_bag.nearest import hint

Kind = Literal["command", "option", "parameter", "executable", "key"]

_LAB = "it is run by the authors now, from a checkout: python -m lab"
_NO_GAIN = "it improved no forecast and has left (docs/arrival.md)"
_TYPES = "types of experts are a library now: serd_core.choose_expert_types (docs/mixed_experts.md)"
_ROBOTS = "start one stack per robot: namespace:=robot1 frame_prefix:=robot1/ (docs/own_robot.md)"
_PROCESSES = "each node has a process of its own, and a lock-step stack takes twice the time"
_KEYBOARD = (
    "the page of serd teleop has the keys, also from another machine (--address), and any publisher"
    " of cmd_vel_teleop drives, as teleop_twist_keyboard (docs/how_to/drive_by_hand.md)"
)
_WALL = "every obstacle is a wall now; delete the key"
_EVENTS = (
    "a decision ends where the robot enters another cell, or after patience_s (docs/scenarios.md)"
)
_WAYPOINT = "waypoints are straight ahead, at least a metre beyond the next cell (docs/runtime.md)"
_DWELL_TIMES = "'serd learn' learns how long moves take from every table of decisions"
_REPLAY = "a replay starts with the nodes of --wait-for and does not pause"
_LEFT: dict[tuple[Kind, str], str] = {
    ("command", "experiment"): f"{_LAB} lists what there is",
    ("command", "study"): f"{_LAB} lists what there is",
    ("command", "faults"): f"{_LAB} faults",
    ("command", "crowd"): f"{_LAB} crowd",
    ("command", "compare"): (
        "the report scores trajectories: serd report MODEL --demonstrations FILE (docs/compare.md)"
    ),
    ("command", "episode"): "serd scenario film drives one episode and draws it",
    ("option", "--density"): _NO_GAIN,
    ("option", "--experts"): _TYPES,
    ("option", "--same-expert"): _TYPES,
    ("option", "--expert"): _TYPES,
    ("option", "--lerobot"): "the export as a LeRobot dataset has left; leave it out",
    ("executable", "composed"): _PROCESSES,
    ("option", "--period-s"): f"{_EVENTS}; leave it out",
    ("option", "--lookahead"): f"{_WAYPOINT}; leave it out",
    ("option", "--times"): f"{_DWELL_TIMES}; leave it out",
    ("option", "--keyboard"): _KEYBOARD,
    ("option", "--no-page"): f"serd teleop and serd demo always have their page; {_KEYBOARD}",
    ("option", "--page"): "serd teleop and serd demo always have their page; leave the option out",
    ("option", "--list"): "serd launch lists the stacks where no name follows",
    ("option", "--ros"): "serd demo and 'serd launch navigate model:=MODEL' drive through ROS 2",
    ("option", "--paused"): _REPLAY,
    ("option", "--wait"): _REPLAY,
    ("option", "--no-clock"): "a replay plays the /clock that was recorded; leave it out",
    ("option", "--episode"): "a film shows the first episode of its --seed; leave it out",
    ("option", "--frames-per-s"): "a movie has 10 frames per second; leave it out",
    ("option", "--pixels-per-m"): "a view from above has 24 pixels per metre; leave it out",
    ("executable", "teleop_keyboard"): _KEYBOARD,
    ("executable", "foxglove_server"): (
        "Foxglove opens recordings by itself, and foxglove_bridge of ROS shows a running stack"
    ),
    ("parameter", "lookahead_cells"): f"{_WAYPOINT}; leave it out",
    ("parameter", "patience_periods"): "it is called patience_decisions",
    ("parameter", "composed"): f"{_PROCESSES}; leave it out",
    ("parameter", "robots"): _ROBOTS,
    ("parameter", "expert"): _TYPES,
    ("parameter", "keys"): f"{_REPLAY}; leave it out",
    ("parameter", "paused"): f"{_REPLAY}; leave it out",
    ("parameter", "wait_s"): f"{_REPLAY}; leave it out",
    ("parameter", "clock_hz"): "a replay plays the /clock that was recorded; leave it out",
    ("parameter", "exit_when_done"): "learner with a bag ends when it is done; leave it out",
    ("parameter", "actions"): "'serd demos --actions hidden' makes decisions of poses alone",
    ("parameter", "behavior_tree"): "Nav2 has its default behavior tree in its own parameters",
    ("parameter", "maximum_file_mb"): "a bag is one file; leave it out",
    ("parameter", "compression"): "'serd bag convert BAG --compression zstd' compresses a bag",
    ("key", "decision_period_s"): (
        f"{_EVENTS}; delete the key, a scenario may have patience_s and wait_s instead"
    ),
    ("key", "period_s"): f"{_EVENTS}; delete the key",
    ("key", "lookahead_cells"): f"{_WAYPOINT}; delete the key",
    ("key", "patience_periods"): "it is called patience_decisions",
    ("key", "density"): f"{_NO_GAIN}; delete the key",
    ("key", "expert"): f"{_TYPES}; delete the key",
    ("key", "types"): f"{_TYPES}; learn again, or delete the key",
    ("key", "imu"): "no node read it, and it has left; delete the key",
    ("key", "mass_kg"): _WALL,
    ("key", "hinge_m"): _WALL,
}

_IMU = {
    "gyroscope_noise_density": 1.7e-4,
    "gyroscope_bias_walk": 1.9e-5,
    "accelerometer_noise_density": 2.0e-3,
    "accelerometer_bias_walk": 3.0e-3,
}
#: Keys that 0.2.0 wrote beside each model and that had no effect, with the values that said so.
_WITHOUT_EFFECT: dict[str, Callable[[Any], bool]] = {
    "density": lambda value: value is False,
    "imu": lambda value: value == _IMU,
    "mass_kg": lambda value: value is None,
    "hinge_m": lambda value: value is None,
}


def without_what_had_no_effect(values: Any) -> Any:
    """The content of a YAML file without keys of 0.2.0 that changed nothing."""
    if isinstance(values, list):
        return [without_what_had_no_effect(each) for each in values]
    if not isinstance(values, dict):
        return values
    return {
        key: without_what_had_no_effect(each)
        for key, each in values.items()
        if not (key in _WITHOUT_EFFECT and _WITHOUT_EFFECT[key](each))
    }


def where(kind: Kind, name: str) -> str:
    """Where a name went, as the end of a sentence; empty for one that never was.

    >>> where("command", "faults")
    'it is run by the authors now, from a checkout: python -m lab faults'
    """
    return _LEFT.get((kind, name), "")


def where_or_near(kind: Kind, name: str, candidates: Iterable[str]) -> str:
    """Where a name went, or the candidate that was meant."""
    return where(kind, name) or hint(name, candidates)
