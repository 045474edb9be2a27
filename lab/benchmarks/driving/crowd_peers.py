"""Crowds against PySocialForce and JuPedSim, crowd and lidar against IR-SIM, in one run.

All have the same people at the same places of the same closed corridor, and the same time step.
They do not compute the same: the table lists what each does.
"""

import json
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np

from lab.benchmarks.peers.crowd_task import seconds_per_step
from lab.benchmarks.peers.peer_environment import run_peer
from lab.benchmarks.report import Row, save
from serd_core.arrays import FloatArray
from serd_sim.crowd.crowd import Crowd
from serd_sim.crowd.robots import RobotBody
from serd_sim.crowd.routes import Routes
from serd_sim.crowd.social_force import model_named, model_names
from serd_sim.robot.sensors import Lidar
from serd_sim.scenario.settings import LidarSettings

PEOPLE = (30, 100, 200)
WIDTH_M, LENGTH_M, STEP_S, RADIUS_M, SPEED_MPS = 6.0, 24.0, 0.05, 0.25, 1.34
_END_M = 1.0
_PEERS = ("crowd_pysocialforce.py", "crowd_jupedsim.py", "crowd_irsim.py")
_CORNERS = np.array([[0.0, 0.0], [LENGTH_M, 0.0], [LENGTH_M, WIDTH_M], [0.0, WIDTH_M]])
_WALLS = np.stack([_CORNERS, np.roll(_CORNERS, -1, axis=0)], axis=1)


def run() -> None:
    """Measure every simulator with every number of people."""
    rows: list[Row] = []
    for count in PEOPLE:
        start_m = lattice_m(count)
        measured = [*_own(start_m), *_peers(start_m)]
        rows += [
            {
                "people": count,
                "simulator": each["simulator"],
                "computes": each["computes"],
                "ms_per_step": 1e3 * each["step_seconds"],
                "real_time_factor": STEP_S / each["step_seconds"],
            }
            for each in measured
        ]
    area = f"{WIDTH_M:g} m x {LENGTH_M:g} m, steps of {STEP_S:g} s"
    save("crowd_peers", f"Crowds, and crowds with a lidar, in a corridor of {area}", rows)


def lattice_m(count: int) -> FloatArray:
    """(N, 2) places evenly over the corridor, well apart and away from its ends."""
    columns = int(np.ceil(np.sqrt(count * (LENGTH_M - 4.0) / WIDTH_M)))
    rows = int(np.ceil(count / columns))
    slot = np.arange(count)
    x_m = 2.0 + (slot % columns + 0.5) * (LENGTH_M - 4.0) / columns
    y_m = 0.5 + (slot // columns + 0.5) * (WIDTH_M - 1.0) / rows
    return np.stack([x_m, y_m], axis=1)


def _own(start_m: FloatArray) -> list[dict[str, object]]:
    rows: list[dict[str, object]] = []
    lidar = Lidar(LidarSettings(), _WALLS, RADIUS_M)
    robot = RobotBody(LENGTH_M / 2, WIDTH_M / 2, 0.0, 0.0, RADIUS_M)
    for name in model_names():
        crowd = _crowd(start_m, name)
        rows.append(_row(f"SERD, {name}", "social force, walls, robot as a body",
                         lambda crowd=crowd: crowd.step(STEP_S, robot)))  # fmt: skip
    crowd = _crowd(start_m, model_names()[0])

    def step_and_scan() -> None:
        crowd.step(STEP_S, robot)
        lidar.scan((robot.x_m, robot.y_m, 0.0), crowd.x_m, crowd.y_m)

    n_rays = LidarSettings().n_rays
    computes = f"social force, walls, robot as a body, {n_rays} rays"
    return [*rows, _row(f"SERD, {model_names()[0]} and lidar", computes, step_and_scan)]


def _row(simulator: str, computes: str, step: Callable[[], object]) -> dict[str, object]:
    seconds = seconds_per_step(step)
    return {"simulator": simulator, "computes": computes, "step_seconds": seconds}


def _crowd(start_m: FloatArray, model_name: str) -> Crowd:
    """People who walk round loops from end to end, every other one the other way."""
    ends = (_END_M, LENGTH_M - _END_M)
    loops = []
    for number, (_, y_m) in enumerate(start_m):
        back_m = WIDTH_M - y_m if abs(WIDTH_M - 2 * y_m) > 0.5 else y_m + 0.5
        loop = np.array([[ends[0], y_m], [ends[1], y_m], [ends[1], back_m], [ends[0], back_m]])
        loops.append(loop if number % 2 == 0 else loop[[1, 0, 3, 2]])
    routes = Routes(loops)
    routes.place(np.full(len(start_m), 0.1))
    return Crowd(
        model=model_named(model_name),
        routes=routes,
        x_m=start_m[:, 0].copy(),
        y_m=start_m[:, 1].copy(),
        desired_speed_mps=np.full(len(start_m), SPEED_MPS),
        walls_m=_WALLS,
        fluctuation_mps2=0.1,
        rng=np.random.default_rng(1),
    )


def _peers(start_m: FloatArray) -> list[dict[str, object]]:
    people = [
        {
            "x_m": float(x_m),
            "y_m": float(y_m),
            "speed_mps": SPEED_MPS,
            "velocity_mps": [SPEED_MPS if number % 2 == 0 else -SPEED_MPS, 0.0],
            "goal_m": [LENGTH_M - _END_M if number % 2 == 0 else _END_M, float(y_m)],
        }
        for number, (x_m, y_m) in enumerate(start_m)
    ]
    task = {"width_m": WIDTH_M, "length_m": LENGTH_M, "step_s": STEP_S, "radius_m": RADIUS_M}
    task |= {"n_rays": LidarSettings().n_rays, "people": people}
    rows: list[dict[str, object]] = []
    with tempfile.TemporaryDirectory() as folder:
        given, measured = Path(folder) / "task.json", Path(folder) / "measured.json"
        given.write_text(json.dumps(task))
        for script in _PEERS:
            run_peer("crowd", script, given, measured)
            rows += json.loads(measured.read_text())
    return rows
