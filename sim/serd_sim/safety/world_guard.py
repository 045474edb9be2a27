"""The guard of an episode in process, with the inputs that the nodes of a stack receive."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from serd_sim.safety.guard import Guard, GuardOutput
from serd_sim.safety.reasons import Source
from serd_sim.safety.scan import Scan, ScanGeometry
from serd_sim.safety.settings import GuardSettings
from serd_sim.scenario.settings import LidarSettings
from serd_sim.world.command import Command
from serd_sim.world.observation import Observation

if TYPE_CHECKING:  # which needs PyBullet
    from serd_sim.world.world import HallwayWorld

#: Returns the command that reaches the robot in place of a planner's.
CommandFilter = Callable[[Observation, Command], Command]


@dataclass(frozen=True, eq=False)
class Message:
    """An input. value: the arguments of the guard's receiver but for the stamp; a Scan has its own.

    `odom`: pose by the wheels and speeds (m/s, rad/s); `robot_pose`: Pose; `pedestrians`: People;
    `scan`: Scan.
    """

    source: Source
    stamp_s: float
    value: Any


def published(world: "HallwayWorld", observation: Observation) -> list[Message]:
    """What the nodes of the world publish at an observation."""
    time_s = observation.time_s
    speeds = observation.speed_mps, observation.yaw_rate_radps
    messages = [
        Message(Source.ODOMETRY, time_s, (world.odometry_pose, speeds)),
        Message(Source.POSE, time_s, observation.pose),
        Message(Source.PEOPLE, time_s, observation.people),
    ]
    if world.is_scan_tick:
        geometry = scan_geometry_of(world.scenario.lidar)
        scan = Scan(time_s, world.scan(observation), geometry)
        messages.append(Message(Source.SCAN, time_s, scan))
    return messages


def guarded(guard: Guard, messages: list[Message], command: Command, now_s: float) -> GuardOutput:
    """What the guard makes of a command after these inputs have arrived."""
    guard.advance(now_s)
    for each in messages:
        if each.source is Source.ODOMETRY:
            guard.receive_odometry(each.stamp_s, *each.value)
        elif each.source is Source.POSE:
            guard.receive_pose(each.stamp_s, each.value)
        elif each.source is Source.PEOPLE:
            guard.receive_people(each.stamp_s, each.value.position_m, each.value.velocity_mps)
        else:
            guard.receive_scan(each.value)
    guard.receive_command(now_s, command)
    return guard.step(now_s)


def scan_geometry_of(lidar: LidarSettings) -> ScanGeometry:
    """The geometry of the scans of a scenario's lidar."""
    return ScanGeometry(
        lidar.angle_min_rad, lidar.angle_increment_rad, lidar.range_min_m, lidar.range_max_m
    )


class WorldGuard:
    """Guards the robot of a world.

    people_from: scan leaves out the people as the world gives them.
    """

    def __init__(self, world: "HallwayWorld", people_from: str = "given") -> None:
        scenario = world.scenario
        settings = GuardSettings.of_scenario(scenario, people_from)
        self._guard = Guard(settings, scenario.wall_segments_m)
        self._world = world

    def __call__(self, observation: Observation, command: Command) -> Command:
        """The command that reaches the robot at an observation."""
        messages = published(self._world, observation)
        return guarded(self._guard, messages, command, observation.time_s).command


def no_guard(_: Observation, command: Command) -> Command:
    """Passes every command on."""
    return command
