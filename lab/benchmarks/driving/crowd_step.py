"""What a step of the crowd costs, against JuPedSim, from 30 to 1,000 people.

All walk one way along a corridor at the same density from the same places, with the same wanted
speeds and the same length of a step. Ours is closed to a ring; that of JuPedSim is long enough.
"""

import time
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from lab.benchmarks.peers.peer_environment import run_peer
from lab.benchmarks.report import Row, save
from lab.crowd.ring_corridor import ring_corridor_crowd
from serd_sim.crowd.crowd import Crowd
from serd_sim.crowd.social_force import model_names

PEOPLE, DENSITY_PM2, WIDTH_M, STEP_S = (30, 60, 200, 1000), 1.4, 4.0, 0.02
SETTLE_STEPS, STEPS = 50, 200
PEERS = ("CollisionFreeSpeedModel", "SocialForceModel")
#: A public simulator of pedestrians.
REQUIREMENTS = ("jupedsim==1.4.2",)


def run() -> None:
    """Measure each number of people by each model."""
    rows: list[Row] = []
    with TemporaryDirectory() as folder:
        for people in PEOPLE:
            rows += [{"model": name, **_ours(people, name)} for name in model_names()]
            file, result = Path(folder) / "corridor.npz", Path(folder) / "result.npz"
            crowd = _crowd(people, model_names()[0])
            np.savez(
                file, place_m=crowd.position_m, speed_mps=crowd.desired_speed_mps, step_s=STEP_S,
                width_m=WIDTH_M, radius_m=0.2, settle_steps=SETTLE_STEPS, steps=STEPS,
            )  # fmt: skip
            for model in PEERS:
                run_peer("jupedsim", REQUIREMENTS, "jupedsim_steps.py", file, result, model)
                with np.load(result) as found:
                    step_ms = float(found["step_ms"])
                rows.append({"model": f"JuPedSim {model}", "people": people, "step_ms": step_ms})
    save("crowd_step", f"Processor time of a step at {DENSITY_PM2} people per m²", rows)


def _crowd(people: int, model: str) -> Crowd:
    return ring_corridor_crowd(
        width_m=WIDTH_M,
        length_m=people / (DENSITY_PM2 * WIDTH_M),
        density_pm2=DENSITY_PM2,
        model_name=model,
        rng=np.random.default_rng(1),
    )


def _ours(people: int, model: str) -> Row:
    crowd = _crowd(people, model)
    for _ in range(SETTLE_STEPS):
        crowd.step(STEP_S)
    start_s = time.process_time()
    for _ in range(STEPS):
        crowd.step(STEP_S)
    return {"people": people, "step_ms": 1e3 * (time.process_time() - start_s) / STEPS}
