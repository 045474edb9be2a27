"""A bare room with movable obstacles, for the physical robot."""

from sim.scenario.scenario import Scenario

CHAIR = {"name": "chair", "outline_m": [[5, 5], [5.4, 5], [5.4, 5.4], [5, 5.4]], "mass_kg": 5.0}
DOOR = {
    "name": "door",
    "outline_m": [[5, 5], [5.05, 5], [5.05, 6], [5, 6]],
    "mass_kg": 20.0,
    "hinge_m": [5.025, 5],
}


def room(*obstacles, people=(), drive="physical", **robot) -> Scenario:
    """10 m x 10 m with people who stand at (x, y); the robot starts in the lower left corner."""
    return Scenario.model_validate(
        {
            "name": "room",
            "walkable_area_m": [[0, 0], [10, 0], [10, 10], [0, 10]],
            "obstacles": obstacles,
            "goal_area_m": [[8, 8], [10, 8], [10, 10], [8, 10]],
            "start_areas_m": {"train": [[0, 0], [2, 0], [2, 2], [0, 2]]},
            "pedestrians": {"count": 0, "standing_m": people, "robot_visible": False},
            "robot": {"drive": drive, **robot},
        }
    )
