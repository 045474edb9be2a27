"""JuPedSim: people walk along a corridor; processor time of a step.

    python jupedsim_steps.py problem.npz result.npz MODEL

Run in an environment with JuPedSim. MODEL is the name of one of its classes.
"""

import sys
import time
from pathlib import Path

import jupedsim
import numpy as np

#: Of free corridor before the people, so that none has arrived when the time is taken.
AHEAD_M = 60.0


def main(problem_file: Path, result_file: Path, model: str) -> None:
    """Walk, write the milliseconds of a step."""
    given = np.load(problem_file)
    place_m, speed_mps = given["place_m"], given["speed_mps"]
    width_m, end_m = float(given["width_m"]), float(place_m[:, 0].max() + AHEAD_M)
    walls = [(-2.0, 0.0), (end_m, 0.0), (end_m, width_m), (-2.0, width_m)]
    simulation = jupedsim.Simulation(
        model=getattr(jupedsim, model)(), geometry=walls, dt=float(given["step_s"])
    )
    corner_m = end_m - 1.0
    goal = simulation.add_exit_stage(
        [(corner_m, 0.0), (end_m, 0.0), (end_m, width_m), (corner_m, width_m)]
    )
    journey = simulation.add_journey(jupedsim.JourneyDescription([goal]))
    parameters = getattr(jupedsim, f"{model}AgentParameters")
    for place, speed in zip(place_m, speed_mps, strict=True):
        simulation.add_agent(
            parameters(
                position=tuple(place), desired_speed=speed, radius=float(given["radius_m"]),
                journey_id=journey, stage_id=goal,
            )
        )  # fmt: skip
    simulation.iterate(int(given["settle_steps"]))
    start_s = time.process_time()
    simulation.iterate(int(given["steps"]))
    step_ms = 1e3 * (time.process_time() - start_s) / int(given["steps"])
    assert simulation.agent_count() == len(place_m)
    np.savez(result_file, step_ms=step_ms)


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]), sys.argv[3])
