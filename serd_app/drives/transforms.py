"""Transforms poses between frames, by recorded /tf and /tf_static.

Frames form a tree; each moving edge is interpolated at the time asked for (positions linearly,
rotations along the shortest arc), and unknown more than a second before its first transform or
after its last.
"""

from array import array
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from serd_bag.errors import BagError
from serd_bag.messages.fields import store_of
from serd_bag.messages.plain import Transform, transforms
from serd_bag.nearest import hint
from serd_bag.topic import RawMessage, Topic
from serd_core.arrays import FloatArray, IntArray

TF_TYPES = ("tf2_msgs/msg/TFMessage", "tf/msg/tfMessage")
_LONGEST_REACH_S = 1.0
_COLUMNS = 9
#: From which on a transform moves (m, or parts of a quaternion), and travels.
_STILL, _TRAVEL_M = 1e-3, 0.2


@dataclass(frozen=True, eq=False)
class Poses:
    """position_m: (N, 3), NaN where it is unknown; rotation: N of them, or one for all."""

    position_m: FloatArray
    rotation: Rotation

    @classmethod
    def of_numbers(cls, rows: FloatArray) -> "Poses":
        """From (N, 7) x, y, z and quaternion x, y, z, w, or (N, 3) x, y, yaw, or (N, 2) x, y.

        A quaternion of zeros, which a sender without a heading leaves, is no rotation.
        """
        quaternion = np.tile([0.0, 0.0, 0.0, 1.0], (len(rows), 1))
        position_m = np.zeros((len(rows), 3))
        if rows.shape[1] == 7:
            position_m[:] = rows[:, :3]
            turned = rows[:, 3:].any(axis=1)
            quaternion[turned] = rows[turned, 3:]
            return cls(position_m, Rotation.from_quat(quaternion))
        position_m[:, :2] = rows[:, :2]
        yaw_rad = rows[:, 2] if rows.shape[1] == 3 else np.zeros(len(rows))
        return cls(position_m, Rotation.from_rotvec(np.outer(yaw_rad, [0.0, 0.0, 1.0])))

    def select(self, rows: IntArray) -> "Poses":
        """Those of the rows."""
        return Poses(self.position_m[rows], self.rotation[rows])

    @property
    def planar(self) -> FloatArray:
        """(N, 3) x, y and heading, seen from above."""
        matrix = np.broadcast_to(self.rotation.as_matrix(), (len(self.position_m), 3, 3))
        yaw_rad = np.arctan2(matrix[:, 1, 0], matrix[:, 0, 0])
        return np.column_stack([self.position_m[:, :2], yaw_rad])

    @property
    def inverse(self) -> "Poses":
        """Poses of the parent in the child."""
        back = self.rotation.inv()
        return Poses(-back.apply(self.position_m), back)

    def __matmul__(self, inner: "Poses") -> "Poses":
        """Poses `inner`, given in the frames whose poses these are, in the outer frame."""
        position_m = self.position_m + self.rotation.apply(inner.position_m)
        return Poses(position_m, self.rotation * inner.rotation)


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

    def add(self, transform: Transform, *, log_time_ns: int = 0, static: bool) -> None:
        """One transform; a frame has one parent at a time, that of the latest transform."""
        child, parent = transform.child.lstrip("/"), transform.header.frame.lstrip("/")
        if not np.isfinite(transform.placed).all():
            return
        if self._parents.get(child, parent) != parent:
            self._samples.pop(child, None)
        self._parents[child] = parent
        stamp_ns = transform.header.stamp_ns or log_time_ns
        samples = self._samples.setdefault(child, array("d"))
        samples.extend((log_time_ns / 1e9, stamp_ns / 1e9, *transform.placed))
        if static:
            self._static.add(child)

    def root(self, frame: str) -> str:
        """The frame at the end of its chain of parents."""
        return list(self._ancestry(frame))[-1]

    def frame_that_corrects(self, frame: str) -> str:
        """The topmost of the ancestors in which a frame moves, as a map in which a localisation
        moves the frame of odometry; empty where none does."""
        chain = list(self._ancestry(frame))
        moving = [parent for child, parent in pairwise(chain) if self._moves(child)]
        return moving[-1] if moving else ""

    def carried(self) -> list[str]:
        """The lowest frames that travel: bodies, as wheels and lidars only turn on them."""
        travelling = {
            child
            for child in self._parents.keys() - self._static
            if np.ptp(self._rows(child)[:, 2:5], axis=0).max() >= _TRAVEL_M
        }
        above = {parent for child in travelling for parent in list(self._ancestry(child))[1:]}
        return sorted(travelling - above)

    def _moves(self, child: str) -> bool:
        rows = self._rows(child)[:, 2:]
        return child not in self._static and bool(np.ptp(rows, axis=0).max() > _STILL)

    def times(self, target: str, source: str) -> FloatArray:
        """(N, 2) log times and stamps (s) of the edge between the frames that has most of them, in
        the order of arrival; BagError where nothing moves between them."""
        up, down = self._chain(target, source)
        moving = [self._rows(frame) for frame in (*up, *down) if frame not in self._static]
        if not moving:
            raise BagError(
                f"frame {source!r} must move in {target!r}, /tf_static holds it still;"
                f" name another frame of {', '.join(self.frames)}"
            )
        return max(moving, key=len)[:, :2]

    def into(self, target: str, source: str, poses: Poses, times_s: FloatArray) -> Poses:
        """Poses given in `source`, in `target`; NaN at times at which that is unknown.

        BagError where no chain joins the frames.
        """
        up, down = self._chain(target, source)
        for frame in up:
            poses = self._edge(frame, times_s) @ poses
        for frame in reversed(down):
            poses = self._edge(frame, times_s).inverse @ poses
        return poses

    def _chain(self, target: str, source: str) -> tuple[list[str], list[str]]:
        """Frames from the source, and from the target, up to the one above both."""
        up, down = list(self._ancestry(source)), list(self._ancestry(target))
        shared = next((frame for frame in up if frame in down), None)
        if shared is None:
            known = self.frames
            unknown = next((name for name in (target, source) if name not in known), None)
            fix = hint(unknown, known) if unknown else "record what joins them too"
            raise BagError(
                f"frame {source!r} must be joined with {target!r} by /tf, it is not; {fix}"
            )
        return up[: up.index(shared)], down[: down.index(shared)]

    def _ancestry(self, frame: str) -> Iterator[str]:
        seen: set[str] = set()
        while frame not in seen:
            seen.add(frame)
            yield frame
            frame = self._parents.get(frame, frame)

    def _rows(self, child: str) -> FloatArray:
        return np.array(self._samples[child]).reshape(-1, _COLUMNS)

    def _edge(self, child: str, times_s: FloatArray) -> Poses:
        rows = self._rows(child)
        if child in self._static:
            last = Poses.of_numbers(rows[-1:, 2:])
            return Poses(np.repeat(last.position_m, len(times_s), axis=0), last.rotation[0])
        rows = rows[np.unique(rows[:, 1], return_index=True)[1]]
        stamp_s, known = rows[:, 1], Poses.of_numbers(rows[:, 2:])
        columns = [np.interp(times_s, stamp_s, each) for each in known.position_m.T]
        position_m = np.stack(columns, axis=1)
        beyond_s = np.maximum(stamp_s[0] - times_s, times_s - stamp_s[-1])
        position_m[beyond_s > _LONGEST_REACH_S] = np.nan
        if len(rows) == 1:
            return Poses(position_m, known.rotation[0])
        turning = Slerp(stamp_s, known.rotation)
        return Poses(position_m, turning(np.clip(times_s, stamp_s[0], stamp_s[-1])))


class RecordedTransforms(TransformTree):
    """The tree of a recorded topic of transforms and the `_static` one beside it.

    known: topics of the recording; those of other types are left.
    """

    def __init__(self, known: Mapping[str, Topic], topic: str = "/tf") -> None:
        super().__init__()
        self._topic = topic
        self._stores = {
            name: (known[name].type_name, store_of(known[name]))
            for name in (topic, f"{topic}_static")
            if name in known and known[name].type_name in TF_TYPES
        }

    @property
    def topics(self) -> frozenset[str]:
        """Those to take messages of."""
        return frozenset(self._stores)

    def take(self, message: RawMessage) -> bool:
        """Add the transforms of a message; False where it is of another topic."""
        if message.topic not in self._stores:
            return False
        static = message.topic != self._topic
        for each in transforms(message.data, *self._stores[message.topic]):
            self.add(each, log_time_ns=message.log_time_ns, static=static)
        return True
