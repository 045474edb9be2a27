"""Speed and acceleration limits of a command: v' = clip(clip(w, low, high), v - a dt, v + a dt)."""

from dataclasses import dataclass

from sim.world.command import Command


@dataclass(frozen=True)
class VelocityLimits:
    """Names as Nav2 users know them; accelerations hold for speeding up and slowing down alike."""

    max_vel_x_mps: float
    min_vel_x_mps: float
    max_vel_theta_radps: float
    acc_lim_x_mps2: float
    acc_lim_theta_radps2: float

    def speed_limited(self, wanted: Command) -> Command:
        """The nearest command within the speed limits."""
        return Command(
            linear_mps=_clip(wanted.linear_mps, self.min_vel_x_mps, self.max_vel_x_mps),
            angular_radps=_clip(
                wanted.angular_radps, -self.max_vel_theta_radps, self.max_vel_theta_radps
            ),
        )

    def limited(self, wanted: Command, before: Command, duration_s: float) -> Command:
        """The nearest command within the speed limits that is in reach of `before` in that time."""
        goal = self.speed_limited(wanted)
        reach_mps = self.acc_lim_x_mps2 * duration_s
        reach_radps = self.acc_lim_theta_radps2 * duration_s
        linear, angular = before.linear_mps, before.angular_radps
        return Command(
            linear_mps=_clip(goal.linear_mps, linear - reach_mps, linear + reach_mps),
            angular_radps=_clip(goal.angular_radps, angular - reach_radps, angular + reach_radps),
        )


def _clip(value: float, low: float, high: float) -> float:
    return min(max(value, low), high)
