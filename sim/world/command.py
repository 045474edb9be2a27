"""What the robot is told to do for one control period."""

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class Command:
    """Wanted forward speed and turning rate (positive turns left), as geometry_msgs/Twist."""

    linear_mps: float
    angular_radps: float

    @property
    def is_finite(self) -> bool:
        """Whether both numbers can be driven."""
        return math.isfinite(self.linear_mps) and math.isfinite(self.angular_radps)


STOP = Command(linear_mps=0.0, angular_radps=0.0)
