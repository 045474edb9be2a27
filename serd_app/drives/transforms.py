"""Transforms poses between frames, by recorded /tf and /tf_static, in the plane.

A pose is (x, y, yaw). Frames form a tree; each moving edge is interpolated at the time asked for,
and unknown more than a second before its first transform or after its last.
"""

from array import array
from collections.abc import Iterator

import numpy as np

from bags.errors import BagError
from bags.messages.plain import PlanarTransform
from serd_core.arrays import FloatArray
from storage.nearest import hint

_LONGEST_REACH_S = 1.0


class TransformTree:
    """Collects transforms and evaluates them at arrays of times."""

    def __init__(self) -> None:
        self._parents: dict[str, str] = {}
        self._samples: dict[str, array[float]] = {}
        self._static: set[str] = set()

    @property
    def frames(self) -> tuple[str, ...]:
        """All frames that occur."""
        return tuple(sorted({*self._parents, *self._parents.values()}))

    def add(self, transform: PlanarTransform, *, static: bool) -> None:
        """One transform; a frame has one parent at a time, that of the latest transform."""
        child, pose = _bare(transform.child), transform.pose
        parent = _bare(pose.header.frame)
        if self._parents.get(child, parent) != parent:
            self._samples.pop(child, None)
        self._parents[child] = parent
        samples = self._samples.setdefault(child, array("d"))
        samples.extend((pose.header.stamp_ns / 1e9, pose.x_m, pose.y_m, pose.yaw_rad))
        if static:
            self._static.add(child)

    def into(self, target: str, source: str, poses: FloatArray, times_s: FloatArray) -> FloatArray:
        """(N, 3) poses given in `source`, in `target`; NaN at times at which that is unknown.

        BagError where no chain joins the frames.
        """
        target, source = _bare(target), _bare(source)
        up = list(self._ancestry(source))
        down = list(self._ancestry(target))
        shared = next((frame for frame in up if frame in down), None)
        if shared is None:
            raise BagError(
                f"frame {source!r} must be joined with {target!r} by /tf, it is not;"
                f" {hint(target, self.frames)}"
            )
        for frame in up[: up.index(shared)]:
            poses = composed(self._edge(frame, times_s), poses)
        for frame in reversed(down[: down.index(shared)]):
            poses = composed(inverse(self._edge(frame, times_s)), poses)
        return poses

    def _ancestry(self, frame: str) -> Iterator[str]:
        seen: set[str] = set()
        while frame not in seen:
            seen.add(frame)
            yield frame
            frame = self._parents.get(frame, frame)

    def _edge(self, child: str, times_s: FloatArray) -> FloatArray:
        rows: FloatArray = np.array(self._samples[child]).reshape(-1, 4)
        if child in self._static:
            return np.repeat(rows[-1:, 1:], len(times_s), axis=0)
        rows = rows[np.unique(rows[:, 0], return_index=True)[1]]
        columns = (rows[:, 1], rows[:, 2], np.unwrap(rows[:, 3]))
        edge = np.stack([np.interp(times_s, rows[:, 0], each) for each in columns], axis=1)
        beyond_s = np.maximum(rows[0, 0] - times_s, times_s - rows[-1, 0])
        edge[beyond_s > _LONGEST_REACH_S] = np.nan
        return edge


def composed(outer: FloatArray, inner: FloatArray) -> FloatArray:
    """(N, 3) poses `inner`, given in the frames whose poses are `outer`, in the outer frame."""
    cos, sin = np.cos(outer[:, 2]), np.sin(outer[:, 2])
    x = outer[:, 0] + cos * inner[:, 0] - sin * inner[:, 1]
    y = outer[:, 1] + sin * inner[:, 0] + cos * inner[:, 1]
    return np.stack([x, y, outer[:, 2] + inner[:, 2]], axis=1)


def inverse(poses: FloatArray) -> FloatArray:
    """(N, 3) poses of the parent in the child."""
    cos, sin = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    x = -cos * poses[:, 0] - sin * poses[:, 1]
    y = sin * poses[:, 0] - cos * poses[:, 1]
    return np.stack([x, y, -poses[:, 2]], axis=1)


def _bare(frame: str) -> str:
    return frame.lstrip("/")
