"""Everything that changes in a world, as one value: to go back to, or to carry on elsewhere."""

from dataclasses import dataclass

from sim.crowd.crowd import CrowdState
from sim.robot.contacts import ContactState
from sim.robot.odometry import OdometryState
from sim.robot.robot import RobotState
from sim.scenario.goal import Area


@dataclass(frozen=True, eq=False)
class WorldState:
    """A snapshot of a world of one scenario and seed; restoring repeats what followed exactly."""

    scenario_digest: str
    seed: int
    episode: int
    tick: int
    first_tick: int
    n_rejected_commands: int
    goal_area_m: Area
    robot: RobotState
    crowd: CrowdState
    contacts: ContactState
    odometry: OdometryState
