"""IR-SIM: a crowd by its batched social force, and a robot whose lidar scans at every step."""

import json
import os
import tempfile
from importlib.metadata import version
from pathlib import Path

os.environ["MPLBACKEND"] = "Agg"

import irsim
import numpy as np
from crowd_task import answer, read_task, seconds_per_step

task = read_task()
width_m, length_m = task["width_m"], task["length_m"]
corners = [[0, 0], [length_m, 0], [length_m, width_m], [0, width_m], [0, 0]]
world = {
    "world": {
        "width": length_m,
        "height": width_m,
        "step_time": task["step_s"],
        "sample_time": task["step_s"],
        "collision_mode": "unobstructed",
    },
    "robot": [
        {
            "kinematics": {"name": "diff"},
            "shape": {"name": "circle", "radius": task["radius_m"]},
            "state": [length_m / 2, width_m / 2, 0.0],
            "sensors": [
                {
                    "name": "lidar2d",
                    "range_min": 0.1,
                    "range_max": 10.0,
                    "angle_range": 2.0 * np.pi,
                    "number": task["n_rays"],
                }
            ],
        }
    ],
    "obstacle": [
        {
            "number": len(task["people"]),
            "kinematics": {"name": "omni"},
            "shape": {"name": "circle", "radius": task["radius_m"]},
            "distribution": {"name": "manual"},
            "state": [[each["x_m"], each["y_m"], 0.0] for each in task["people"]],
            "goal": [[*each["goal_m"], 0.0] for each in task["people"]],
            "vel_max": [2.0, 2.0],
            "group_behavior": {"name": "sfm", "vmax": 1.34},
        },
        {"shape": {"name": "linestring", "vertices": corners}, "state": [0, 0, 0]},
    ],
}
with tempfile.TemporaryDirectory() as folder:
    file = Path(folder) / "world.yaml"
    file.write_text(json.dumps(world))  # JSON is YAML
    env = irsim.make(str(file), display=False, log_level="ERROR")
    people = [each for each in env.obstacle_list if each.shape == "circle"]
    assert len(people) == len(task["people"])
    start = np.array([each.state[:2, 0] for each in people])
    step_seconds = seconds_per_step(lambda: env.step(np.zeros((2, 1))))
    moved = np.array([each.state[:2, 0] for each in people]) - start
assert np.abs(moved).max() > 1.0, "the crowd must walk"
ranges = np.array(env.get_lidar_scan()["ranges"])
assert len(ranges) == task["n_rays"]
assert ranges.min() < width_m / 2, "the lidar must see walls and people"
computes = f"social force in a batch, walls, collision checks, {task['n_rays']} rays"
answer(f"IR-SIM {version('ir-sim')}", {computes: step_seconds})
