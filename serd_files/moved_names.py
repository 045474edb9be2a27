"""Names of version 0.3.0 that left or moved, and where to; version 0.5.0 forgets them."""

from collections.abc import Iterable
from typing import Literal

from serd_bag.nearest import hint

Kind = Literal["command", "option", "parameter", "key"]

_PAGE = (
    "serd teleop and serd demo always have their page, which has the keys, also from another"
    " machine (--address)"
)
_EVENTS = (
    "a decision ends where the robot enters another cell, or after patience_s (docs/scenarios.md)"
)
_WAYPOINT = "waypoints are straight ahead, at least a metre beyond the next cell (docs/runtime.md)"
_DWELL_TIMES = "'serd learn' learns how long moves take from every table of decisions"
_REPLAY = "a replay starts with the nodes of --wait-for and does not pause"

#: Parameters of the guard that have left.
_STUDY = "'python -m lab hallway' has that learner"
_OF_STUDY = ("entropy_slack", "reirl_samples", "reirl_smoothing", "reirl_threshold_shares")
_GUARD = (
    "clock_jump",
    "vanished_hold",
    "frozen_messages",
    "unseen_people",
    "people_look",
    "consistency_window",
    "second_look",
)
_LEFT: dict[tuple[Kind, str], str] = {
    ("command", "episode"): "serd scenario film drives one episode and draws it",
    ("command", "recover"): "it is called rescue",
    ("option", "--period-s"): f"{_EVENTS}; leave it out",
    ("option", "--lookahead"): f"{_WAYPOINT}; leave it out",
    ("option", "--times"): f"{_DWELL_TIMES}; leave it out",
    ("option", "--no-page"): _PAGE,
    ("option", "--page"): _PAGE,
    ("option", "--list"): "serd launch lists the stacks where no name follows",
    ("option", "--ros"): "serd demo and 'serd launch navigate model:=MODEL' drive through ROS 2",
    ("option", "--paused"): _REPLAY,
    ("option", "--wait"): _REPLAY,
    ("option", "--no-clock"): "a replay plays the /clock that was recorded; leave it out",
    ("option", "--episode"): "a film shows the first episode of its --seed; leave it out",
    ("option", "--frames-per-s"): "a movie has 10 frames per second; leave it out",
    ("option", "--pixels-per-m"): "a view from above has 24 pixels per metre; leave it out",
    ("option", "--inverse-temperature"): "serd_core.fit_policy_matching has it",
    ("option", "--backend"): "batches run on the processes of this machine; leave it out",
    ("option", "--planner"): "there is one local planner; leave it out",
    ("parameter", "lookahead_cells"): f"{_WAYPOINT}; leave it out",
    ("parameter", "patience_periods"): "it is called patience_decisions",
    ("parameter", "keys"): f"{_REPLAY}; leave it out",
    ("parameter", "paused"): f"{_REPLAY}; leave it out",
    ("parameter", "clock_hz"): "a replay plays the /clock that was recorded; leave it out",
    ("parameter", "exit_when_done"): "learner with a bag ends when it is done; leave it out",
    ("parameter", "actions"): "'serd demos --actions hidden' makes decisions of poses alone",
    ("parameter", "behavior_tree"): "Nav2 has its default behavior tree in its own parameters",
    ("parameter", "maximum_file_mb"): "a bag is one file; leave it out",
    ("parameter", "compression"): "'serd bag convert BAG --compression zstd' compresses a bag",
    ("parameter", "planner"): "there is one local planner; leave it out",
    ("parameter", "gui"): "'serd watch' shows the world on a web page; leave it out",
    **{("parameter", name): "the guard has its default; leave it out" for name in _GUARD},
    **{("parameter", name): _STUDY for name in _OF_STUDY},
    **{("option", f"--{name.replace('_', '-')}"): _STUDY for name in _OF_STUDY},
    ("key", "planner"): "there is one local planner; delete the key",
    ("key", "decision_period_s"): (
        f"{_EVENTS}; delete the key, a scenario may have patience_s and wait_s instead"
    ),
    ("key", "period_s"): f"{_EVENTS}; delete the key",
    ("key", "lookahead_cells"): f"{_WAYPOINT}; delete the key",
    ("key", "patience_periods"): "it is called patience_decisions",
    ("key", "flow_convention"): "loops are walked in the order of their waypoints; delete the key",
    ("key", "friction"): "wheels have one friction; delete the key",
    ("key", "wheel_separation_m"): "it is that of the wheels of the URDF; delete the key",
    ("key", "use_stamped"): "each topic has its own key stamped; delete the key",
    ("key", "button_topic"): "goal_area_m and stop_s cut episodes; delete the key",
    ("key", "button_field"): "goal_area_m and stop_s cut episodes; delete the key",
    ("key", "goals_m"): "goal_area_m has the corners of the area in which an episode ends",
    ("key", "goal_radius_m"): "goal_area_m has the corners of the area in which an episode ends",
    ("key", "waypoint_reached_m"): "actions are no longer read from waypoints; delete the key",
    ("key", "people"): "scenarios have pedestrians; one table holds robot and people, by ids",
    ("key", "experts"): "the robot of a bag demonstrates; people demonstrate in a table",
}


def where(kind: Kind, name: str) -> str:
    """Where a name went, as the end of a sentence; empty for one that never was.

    >>> where("key", "patience_periods")
    'it is called patience_decisions'
    """
    return _LEFT.get((kind, name), "")


def where_or_near(kind: Kind, name: str, candidates: Iterable[str]) -> str:
    """Where a name went, or the candidate that was meant."""
    return where(kind, name) or hint(name, candidates)
