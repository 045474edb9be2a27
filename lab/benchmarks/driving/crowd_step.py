"""What a step of the crowd costs, from 30 to 1,000 people.

All walk one way along a corridor at the same density, which is closed to a ring.
"""

import time

import numpy as np

from lab.benchmarks.report import Row, save
from lab.crowd.ring_corridor import ring_corridor_crowd
from serd_sim.crowd.social_force import model_names

PEOPLE, DENSITY_PM2, WIDTH_M, STEP_S = (30, 60, 200, 1000), 1.4, 4.0, 0.02
SETTLE_STEPS, STEPS = 50, 200


def run() -> None:
    """Measure each number of people by each model."""
    rows = [_measured(people, name) for people in PEOPLE for name in model_names()]
    save("crowd_step", f"Processor time of a step at {DENSITY_PM2} people per m²", rows)


def _measured(people: int, model: str) -> Row:
    crowd = ring_corridor_crowd(
        width_m=WIDTH_M,
        length_m=people / (DENSITY_PM2 * WIDTH_M),
        density_pm2=DENSITY_PM2,
        model_name=model,
        rng=np.random.default_rng(1),
    )
    for _ in range(SETTLE_STEPS):
        crowd.step(STEP_S)
    start_s = time.process_time()
    for _ in range(STEPS):
        crowd.step(STEP_S)
    step_ms = 1e3 * (time.process_time() - start_s) / STEPS
    return {"model": model, "people": people, "step_ms": step_ms}
