"""Several robots among the same people, on one clock.

Each robot has a `HallwayWorld`, which is the world as this robot observes it; people are the same
in all. In a control period the people move first, then the robots in their order; a robot that
would drive into another stands where it was. One robot alone drives to the bit as in its own world.
"""

from collections.abc import Sequence
from functools import partial

from sim.crowd.robots import RobotBody
from sim.crowd.social_force import model_named
from sim.errors import SimError
from sim.scenario.scenario import Scenario
from sim.world.command import Command
from sim.world.observation import Observation
from sim.world.other_robots import OtherRobots
from sim.world.world import HallwayWorld

#: How robots drive that share a world; forces between bodies need one physics engine for all.
_DRIVE = "kinematic"


def sharable(scenario: Scenario) -> Scenario:
    """The scenario with a robot that drives as several robots in one world must."""
    if scenario.robot.drive == _DRIVE:
        return scenario
    return scenario.with_values("robot", drive=_DRIVE)


class SharedWorld:
    """worlds: of each robot; do not call their `reset`, `step` and `restore`."""

    def __init__(
        self, scenario: Scenario, *, seed: int, robots: int = 1, gui: bool = False
    ) -> None:
        if robots > 1:
            _require_sharing(scenario, gui=gui)
        self.worlds: tuple[HallwayWorld, ...] = ()
        for number in range(robots):
            world = HallwayWorld(scenario, seed=seed, gui=gui, number=number)
            world.others = OtherRobots(partial(self._others_of, number))
            self.worlds = (*self.worlds, world)

    @property
    def time_s(self) -> float:
        """Simulated time since the world was made."""
        return self.worlds[0].time_s

    def reset(self, episode: int, start_area: str = "train") -> tuple[Observation, ...]:
        """Begin an episode: new people, warmed up, and each robot standing at a random start."""
        first, *more = self.worlds
        people = first.place_robot(episode, start_area)
        for number, world in enumerate(more, 1):
            placed = [each.body for each in self.worlds[:number]]
            world.place_robot(episode, start_area, people, placed)
        first.warm_up_people(self._bodies)
        return tuple(world.observe() for world in self.worlds)

    def step(self, commands: Sequence[Command]) -> tuple[Observation, ...]:
        """Advance by one control period, with one command for each robot."""
        self.worlds[0].move_people(self._bodies)
        for world, command in zip(self.worlds, commands, strict=True):
            world.drive(command)
        self.worlds[0].keep_people_out_of(self._bodies)
        for world in self.worlds:
            world.tick += 1
        return tuple(world.observe() for world in self.worlds)

    def close(self) -> None:
        """Close the worlds; a second call does nothing."""
        for world in self.worlds:
            world.close()

    def __enter__(self) -> "SharedWorld":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def _bodies(self) -> list[RobotBody]:
        return [world.body for world in self.worlds]

    def _others_of(self, number: int) -> tuple[tuple[int, RobotBody], ...]:
        return tuple(
            (other, world.body) for other, world in enumerate(self.worlds) if other != number
        )


def _require_sharing(scenario: Scenario, *, gui: bool) -> None:
    """SimError where several robots cannot share a world of the scenario."""
    if scenario.robot.drive != _DRIVE or gui:
        got = "gui: true" if gui else f"drive: {scenario.robot.drive}"
        raise SimError(
            f"robots that share a world must have the drive {_DRIVE} and no window,"
            f" got {got}; give drive: {_DRIVE} and gui: false"
        )
    person_m = model_named(scenario.pedestrians.model).body_radius_m
    if scenario.robot.radius_m > person_m:
        raise SimError(
            "robot.radius_m must be at most the radius of a person where robots share a world,"
            f" {person_m:g} m, since each is among the people that others observe,"
            f" got {scenario.robot.radius_m:g}; give a smaller one"
        )
