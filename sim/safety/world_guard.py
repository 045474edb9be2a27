"""The guard of an episode in process, with the inputs that the nodes of a stack receive."""

from collections.abc import Callable

from sim.safety.guard import Guard, GuardOutput
from sim.safety.scan import Scan, ScanGeometry
from sim.safety.settings import GuardSettings
from sim.scenario.settings import LidarSettings
from sim.world.command import Command
from sim.world.observation import Observation
from sim.world.world import HallwayWorld

#: Returns the command that reaches the robot in place of a planner's.
CommandFilter = Callable[[Observation, Command], Command]


def scan_geometry_of(lidar: LidarSettings) -> ScanGeometry:
    """The geometry of the scans of a scenario's lidar."""
    return ScanGeometry(
        lidar.angle_min_rad, lidar.angle_increment_rad, lidar.range_min_m, lidar.range_max_m
    )


class WorldGuard:
    """Guards the robot of a world; `output`: of the last step.

    people_from: scan leaves out the people as the world gives them.
    """

    def __init__(self, world: HallwayWorld, people_from: str = "given") -> None:
        self.guard = Guard(GuardSettings.of_scenario(world.scenario, people_from))
        self.output: GuardOutput | None = None
        self._world = world
        self._geometry = scan_geometry_of(world.scenario.lidar)

    def __call__(self, observation: Observation, command: Command) -> Command:
        """The command that reaches the robot at an observation."""
        guard, world, time_s = self.guard, self._world, observation.time_s
        speeds = observation.speed_mps, observation.yaw_rate_radps
        guard.advance(time_s)
        guard.receive_odometry(time_s, world.odometry_pose, speeds)
        guard.receive_pose(time_s, observation.pose)
        guard.receive_people(time_s, observation.people_position_m, observation.people_velocity_mps)
        if world.is_scan_tick:
            guard.receive_scan(Scan(time_s, world.scan(observation), self._geometry))
        guard.receive_command(time_s, command)
        self.output = guard.step(time_s)
        return self.output.command


def no_guard(_: Observation, command: Command) -> Command:
    """Passes every command on."""
    return command
