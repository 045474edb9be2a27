"""What draws a tick of a recorded episode, from above or in three dimensions."""

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from sim.pictures.trajectory import Trajectory

Frame = NDArray[np.uint8]


class EpisodeView(Protocol):
    """Draws one scenario."""

    def frame_at(self, trajectory: Trajectory, tick: int) -> Frame:
        """(height, width, 3) picture of the trajectory at a tick."""
        ...
