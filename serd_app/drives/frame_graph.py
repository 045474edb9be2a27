"""Frames that transforms place in each other (REP 105), as matrices; for bags and for nodes.

A frame is in one other frame, its parent. The placement of a frame in another one is the product of
the transforms from both up to the frame above them.
"""

from collections.abc import Callable, Iterable
from functools import reduce

import numpy as np

from serd_core.arrays import FloatArray


def plain_name(frame: str) -> str:
    """A frame without the leading slash of ROS 1."""
    return frame.lstrip("/")


def matrices_of(rows: FloatArray) -> FloatArray:
    """(N, 4, 4) of (N, 7) x, y, z and quaternion x, y, z, w, or (N, 3) x, y, yaw, or (N, 2) x, y.

    A quaternion of zeros, which a sender without a heading leaves, is no rotation.
    """
    found = np.tile(np.eye(4), (len(rows), 1, 1))
    found[:, :2, 3] = rows[:, :2]
    turn = np.tile([0.0, 0.0, 0.0, 1.0], (len(rows), 1))
    if rows.shape[1] == 7:
        found[:, 2, 3] = rows[:, 2]
        turned = rows[:, 3:].any(axis=1)
        turn[turned] = rows[turned, 3:]
        turn /= np.linalg.norm(turn, axis=1)[:, None]
    elif rows.shape[1] == 3:
        turn[:, 2], turn[:, 3] = np.sin(rows[:, 2] / 2.0), np.cos(rows[:, 2] / 2.0)
    cross = np.zeros((len(rows), 3, 3))
    cross[:, (2, 0, 1), (1, 2, 0)] = turn[:, :3]
    cross -= np.swapaxes(cross, 1, 2)
    found[:, :3, :3] += 2.0 * (turn[:, 3, None, None] * cross + cross @ cross)
    return found


def planar(matrices: FloatArray) -> FloatArray:
    """(N, 3) x, y and heading of (N, 4, 4), seen from above."""
    yaw_rad = np.arctan2(matrices[:, 1, 0], matrices[:, 0, 0])
    return np.column_stack([matrices[:, :2, 3], yaw_rad])


def inverse(matrices: FloatArray) -> FloatArray:
    """(..., 4, 4) placements of the parent in the child."""
    found = np.zeros_like(matrices)
    turned = np.swapaxes(matrices[..., :3, :3], -1, -2)
    found[..., :3, :3], found[..., 3, 3] = turned, 1.0
    found[..., :3, 3] = -np.squeeze(turned @ matrices[..., :3, 3:], -1)
    return found


class FrameGraph:
    """Which frame is in which; the transforms are kept by who extends it."""

    def __init__(self) -> None:
        self._parents: dict[str, str] = {}

    @property
    def names(self) -> tuple[str, ...]:
        """All frames that occur."""
        return tuple(sorted(self._parents.keys() | set(self._parents.values())))

    def chain(self, frame: str) -> list[str]:
        """A frame and those that it is in, each once."""
        found = [frame]
        while (parent := self._parents.get(found[-1])) is not None and parent not in found:
            found.append(parent)
        return found

    def between(self, frame: str, target: str) -> tuple[list[str], list[str]] | None:
        """Frames from the one, and from the other, up to below the one above both; None where none
        is."""
        up, down = self.chain(frame), self.chain(target)
        shared = next((name for name in up if name in down), None)
        if shared is None:
            return None
        return up[: up.index(shared)], down[: down.index(shared)]

    @staticmethod
    def placement(
        up: Iterable[str], down: Iterable[str], transform: Callable[[str], FloatArray]
    ) -> FloatArray:
        """(..., 4, 4) of a frame in a target; up, down: see `between`; transform: of a frame in its
        parent."""
        inner, outer = (
            reduce(lambda matrix, child: transform(child) @ matrix, chain, np.eye(4))
            for chain in (up, down)
        )
        return inverse(outer) @ inner
