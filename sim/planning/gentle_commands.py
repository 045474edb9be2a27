"""Commands that keep to accelerations lower than those the robot keeps to by itself."""

from sim.robot.unicycle import limited_velocity
from sim.scenario.scenario import Scenario
from sim.world.command import Command
from sim.world.observation import Observation


class GentleCommands:
    """Where the planners may accelerate as hard as the robot can, commands stay as they are."""

    def __init__(self, scenario: Scenario) -> None:
        robot = scenario.robot
        self._limits = scenario.local_planner.limited(robot)
        self._period_s = scenario.control_period_s
        self._is_gentler = (
            self._limits.acc_lim_x_mps2 < robot.acc_lim_x_mps2
            or self._limits.acc_lim_theta_radps2 < robot.acc_lim_theta_radps2
        )

    def gentle(self, observation: Observation, command: Command) -> Command:
        """As far towards a command as one control period allows from the speeds observed."""
        if not self._is_gentler:
            return command
        speed_mps, turning_radps = observation.speed_mps, observation.yaw_rate_radps
        return Command(
            *limited_velocity(command, speed_mps, turning_radps, self._limits, self._period_s)
        )
