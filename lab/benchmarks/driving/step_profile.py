"""Where the time of a whole step goes: crowd, physics, lidar, planner, and what is left.

The parts are timed inside the running world, in processor time, so their sum and the rest are one
and the same drive.
"""

import time
from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from typing import Any
from unittest.mock import patch

from serd_sim.crowd.crowd import Crowd
from serd_sim.drivers.expert import ScriptedExpert
from serd_sim.episodes.episode import run_episode
from serd_sim.planning.catalogue import make_planner
from serd_sim.planning.recovery import RecoveringPlanner
from serd_sim.robot.contacts import ContactCounter
from serd_sim.robot.physical_robot import PhysicalRobot
from serd_sim.robot.robot import KinematicRobot
from serd_sim.robot.sensors import Lidar
from serd_sim.safety.guard import Guard
from serd_sim.safety.world_guard import no_guard
from serd_sim.scenario.scenario import Scenario
from serd_sim.world.world import HallwayWorld

#: What belongs to each part: (class, method).
PARTS: dict[str, tuple[tuple[type, str], ...]] = {
    "crowd": ((Crowd, "step"), (Crowd, "push_out_of")),
    "physics": ((KinematicRobot, "drive"), (PhysicalRobot, "drive"), (ContactCounter, "update")),
    "lidar": ((Lidar, "scan"),),
    "planner": ((RecoveringPlanner, "step"),),
    "guard": ((Guard, "step"),),
}
REST = "world, clock and observation"


@dataclass(frozen=True)
class StepProfile:
    """Times faster than real time, and microseconds per step of each part and of the rest."""

    real_time_factor: float
    step_us: float
    parts_us: dict[str, float]

    @property
    def bottleneck(self) -> str:
        """The part that takes longest."""
        return max(self.parts_us, key=lambda part: self.parts_us[part])

    def share(self, part: str) -> float:
        """Share of a step that a part takes."""
        return self.parts_us[part] / self.step_us


def profile_steps(
    scenario: Scenario, *, seed: int, episodes: int, planner: str = "dwa", guarded: bool = True
) -> StepProfile:
    """Drive some episodes, without warm-up time; all scans are made, also without a guard."""
    seconds: dict[str, float] = defaultdict(float)
    with HallwayWorld(scenario, seed=seed) as world:
        driver, local_planner = ScriptedExpert(scenario, seed), make_planner(planner, scenario)
        guard = None if guarded else no_guard

        def scan(*_: object) -> None:
            if world.is_scan_tick:
                world.scan()

        wall_s = 0.0
        n_ticks = 0
        for episode in range(episodes):
            with _timed_parts(seconds, world):
                began_s = time.process_time()
                record = run_episode(
                    world, local_planner, driver, episode=episode, guard=guard, observer=scan
                )
                wall_s += time.process_time() - began_s - seconds.pop(_RESET, 0.0)
            n_ticks += record.n_ticks
    return _profile(scenario, seconds, wall_s, n_ticks)


_RESET = "reset"


@contextmanager
def _timed_parts(seconds: dict[str, float], world: HallwayWorld) -> Iterator[None]:
    """Every method of PARTS adds its time to its part; what happens inside reset does not count."""
    resetting = False

    def timed(part: str, method: Callable[..., Any]) -> Callable[..., Any]:
        def call(*arguments: Any) -> Any:
            if resetting:
                return method(*arguments)
            start_s = time.process_time()
            result = method(*arguments)
            seconds[part] += time.process_time() - start_s
            return result

        return call

    reset = world.reset

    def timed_reset(*arguments: Any) -> Any:
        nonlocal resetting
        start_s, resetting = time.process_time(), True
        result = reset(*arguments)
        resetting = False
        seconds[_RESET] = time.process_time() - start_s
        return result

    with ExitStack() as stack:
        stack.enter_context(patch.object(world, "reset", timed_reset))
        for part, methods in PARTS.items():
            for owner, name in methods:
                replaced = timed(part, getattr(owner, name))
                stack.enter_context(patch.object(owner, name, replaced))
        yield


def _profile(
    scenario: Scenario, seconds: dict[str, float], wall_s: float, n_ticks: int
) -> StepProfile:
    parts_us = {part: 1e6 * seconds[part] / n_ticks for part in PARTS}
    step_us = 1e6 * wall_s / n_ticks
    parts_us[REST] = step_us - sum(parts_us.values())
    return StepProfile(1e6 * scenario.control_period_s / step_us, step_us, parts_us)
