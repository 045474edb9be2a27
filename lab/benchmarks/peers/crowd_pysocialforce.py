"""PySocialForce: Helbing and Molnar's model with Moussaid's social force, in NumPy and numba."""

import logging
import tempfile
from importlib.metadata import version
from pathlib import Path

logging.disable(logging.INFO)  # it switches all debugging output on

import numpy as np  # noqa: E402
import pysocialforce  # noqa: E402
from crowd_task import answer, read_task, seconds_per_step  # noqa: E402

task = read_task()
width_m, length_m = task["width_m"], task["length_m"]
people = [
    [each["x_m"], each["y_m"], *each["velocity_mps"], *each["goal_m"]] for each in task["people"]
]
# Lines as (start x, end x, start y, end y); the force needs them as points, ten per metre.
walls = [
    [0.0, length_m, 0.0, 0.0],
    [0.0, length_m, width_m, width_m],
    [0.0, 0.0, 0.0, width_m],
    [length_m, length_m, 0.0, width_m],
]
with tempfile.TemporaryDirectory() as folder:
    settings = Path(folder) / "settings.toml"
    settings.write_text(
        f"step_width = {task['step_s']}\nagent_radius = {task['radius_m']}\n[scene]\n"
        "enable_group = false\n"
    )
    crowd = pysocialforce.Simulator(
        np.array(people), groups=None, obstacles=walls, config_file=str(settings)
    )
assert crowd.peds.step_width == task["step_s"]
start = crowd.peds.pos().copy()
step_seconds = seconds_per_step(crowd.step_once)
assert np.abs(crowd.peds.pos() - start).max() > 1.0
name = f"PySocialForce {version('pysocialforce')}"
answer(name, {"social force, walls as points": step_seconds})
