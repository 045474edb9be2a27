"""Names of version 0.2.0 that left or moved, and where to; version 0.4.0 forgets them."""

from collections.abc import Callable, Iterable
from functools import partial
from operator import eq
from typing import Any, Literal

from serd_bag.nearest import hint

Kind = Literal["command", "option", "argument", "parameter", "executable", "key"]

_LAB = "it is run by the authors now, from a checkout: python -m lab"
_NO_GAIN = "it improved no forecast and has left (docs/arrival.md)"
_TYPES = "types of experts are a library now: serd_core.choose_expert_types (docs/mixed_experts.md)"
_ROBOTS = (
    "start one stack per robot, with namespace:=robot1 frame_prefix:=robot1/ (docs/own_robot.md)"
)
_PROCESSES = "each node has a process of its own, and a lock-step stack takes twice the time"
_KEYBOARD = (
    "the page of serd teleop has the keys, also from another machine (--address), and any publisher"
    " of cmd_vel_teleop drives, as teleop_twist_keyboard (docs/how_to/drive_by_hand.md)"
)
_WALL = "every obstacle is a wall now; delete the key"

_ONE_PLANNER = "the dynamic window planner is the only one (docs/planners.md); leave it out"
_JOBLIB = "batches run on the processes of this machine; leave it out"
#: Keys of a planner that has left, with their defaults, which files of older versions have.
_MPPI = {
    "batch_size": 300, "time_steps": 14, "model_dt": 0.1,
    "temperature": 0.08, "vx_std": 2.0, "wz_std": 6.0,
}  # fmt: skip

_FIXED = "it is fixed now (docs/safety.md); leave it out"
_OF_GUARD = (
    "clock_jump", "vanished_hold", "frozen_messages", "unseen_people", "people_look",
    "consistency_window", "second_look",
)  # fmt: skip

_EVENTS = (
    "a decision ends where the robot enters another cell, or after patience_s (docs/scenarios.md)"
)

_WAYPOINT = "waypoints are straight ahead, at least a metre beyond the next cell (docs/runtime.md)"
_DWELL_TIMES = "'serd learn' learns how long moves take from every table of decisions"

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
    ("option", "--lerobot"): f"{_LAB} lerobot",
    ("executable", "composed"): _PROCESSES,
    ("option", "--period-s"): f"{_EVENTS}; leave it out",
    ("option", "--lookahead"): f"{_WAYPOINT}; leave it out",
    ("option", "--times"): f"{_DWELL_TIMES}; leave it out",
    ("option", "--keyboard"): _KEYBOARD,
    ("option", "--no-page"): f"serd teleop and serd demo always have their page; {_KEYBOARD}",
    ("option", "--page"): "serd teleop and serd demo always have their page; leave the option out",
    ("option", "--list"): "serd launch and serd run list what there is where no name follows",
    ("option", "--planner"): _ONE_PLANNER,
    ("option", "--backend"): _JOBLIB,
    ("option", "--view"): "films are drawn from above; leave it out",
    ("option", "--frames-per-s"): "a movie has 10 frames per second; leave it out",
    ("option", "--pixels-per-m"): "a view from above has 24 pixels per metre; leave it out",
    ("argument", "watch BAG"): (
        "open a recording in Foxglove, which has a time line, or play it with 'serd bag play'"
        " beside 'serd watch'"
    ),
    ("executable", "teleop_keyboard"): _KEYBOARD,
    ("executable", "foxglove_server"): (
        "Foxglove opens recordings by itself, and foxglove_bridge of ROS shows a running stack"
    ),
    ("parameter", "lookahead_cells"): f"{_WAYPOINT}; leave it out",
    ("parameter", "patience_periods"): "it is called patience_decisions",
    ("parameter", "planner"): _ONE_PLANNER,
    **{("parameter", name): _FIXED for name in _OF_GUARD},
    ("parameter", "gui"): "serd watch shows a running stack; leave it out",
    ("parameter", "composed"): f"{_PROCESSES}; leave it out",
    ("parameter", "robots"): _ROBOTS,
    ("parameter", "expert"): _TYPES,
    ("parameter", "keys"): (
        "the services pause and step of bag_replay, and its parameter rate, steer a replay"
    ),
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
    **{("key", name): _ONE_PLANNER for name in _MPPI},
    (
        "key",
        "wheel_separation_m",
    ): "it is that of the URDF; delete the key",
    ("key", "flow_convention"): "people walk a loop in the order of its waypoints; delete the key",
    ("key", "circular_anisotropic"): "it walked slower than people do and has left (docs/crowd.md)",
    ("key", "planner"): _ONE_PLANNER,
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
    "wheel_separation_m": lambda value: value is None,
    "flow_convention": partial(eq, "right_hand"),
    **{name: partial(eq, default) for name, default in _MPPI.items()},
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
