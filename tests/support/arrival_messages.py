"""The inverse of `to_arrival_message`, for tests that read a prediction."""

import numpy as np
from std_msgs.msg import Float64MultiArray

from serd_core.arrival.law import ArrivalLaw


def from_arrival_message(message: Float64MultiArray) -> tuple[float, ArrivalLaw]:
    """(now_s, law) of a message; what comes after its last step is not known."""
    times_s, cdf = np.array(message.data, dtype=np.float64).reshape(2, -1)
    return float(times_s[0]), ArrivalLaw(times_s - times_s[0], cdf, float(cdf[-1]))
