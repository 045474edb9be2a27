"""Frames that transforms place in each other (REP 105): those of nodes, and of recorded /tf.

A frame is in one other frame, its parent. The placement of a frame in another one is the product of
the transforms from both up to the frame above them. Each recorded moving transform is interpolated
at the time asked for (positions linearly, rotations along the shortest arc), and unknown more than
a second before the first one or after the last.
"""

from array import array
from collections.abc import Callable, Iterable, Mapping
from functools import reduce
from itertools import pairwise

import numpy as np

from serd_bag.errors import BagError
from serd_bag.messages.fields import store_of
from serd_bag.messages.plain import Transform, transforms
from serd_bag.nearest import hint
from serd_bag.topic import RawMessage, Topic
from serd_core.arrays import FloatArray

TF_TYPES = ("tf2_msgs/msg/TFMessage", "tf/msg/tfMessage")
_LONGEST_REACH_S = 1.0
_COLUMNS = 9
#: From which on a transform moves (m, or parts of a quaternion).
_STILL = 1e-3


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


class RecordedTransforms(FrameGraph):
    """The frames of a recorded topic of transforms and the `_static` one beside it.

    known: topics of the recording, of which others are left; topics: those to take messages of.
    BagError where nothing joins the frames that are asked for.
    """

    def __init__(self, known: Mapping[str, Topic], topic: str = "/tf") -> None:
        super().__init__()
        self._topic = topic
        self._stores = {
            name: (known[name].type_name, store_of(known[name]))
            for name in (topic, f"{topic}_static")
            if name in known and known[name].type_name in TF_TYPES
        }
        self.topics = frozenset(self._stores)
        #: Log time, stamp (s), and the numbers of each transform of a frame.
        self._samples: dict[str, array[float]] = {}
        self._static: set[str] = set()

    def take(self, message: RawMessage) -> bool:
        """Add the transforms of a message; False where it is of another topic."""
        if message.topic not in self._stores:
            return False
        static = message.topic != self._topic
        for transform in transforms(message.data, *self._stores[message.topic]):
            self.add(transform, log_time_ns=message.log_time_ns, static=static)
        return True

    def add(self, transform: Transform, *, log_time_ns: int = 0, static: bool) -> None:
        """Take a transform, unless it is not finite. A frame has one parent at a time, that of
        the latest transform."""
        child, parent = plain_name(transform.child), plain_name(transform.header.frame)
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
        return self.chain(frame)[-1]

    def frame_that_corrects(self, frame: str) -> str:
        """The topmost of the ancestors in which a frame moves, as a map in which a localisation
        moves the frame of odometry; empty where none does."""
        moving = [parent for child, parent in pairwise(self.chain(frame)) if self._moves(child)]
        return moving[-1] if moving else ""

    def _moves(self, child: str) -> bool:
        rows = self._rows(child)[:, 2:]
        return child not in self._static and bool(np.ptp(rows, axis=0).max() > _STILL)

    def times(self, target: str, frame: str) -> FloatArray:
        """(N, 2) log times and stamps (s) of the transform between the frames that has most of
        them, in the order of arrival; BagError where nothing moves between them."""
        up, down = self._joined(target, frame)
        moving = [self._rows(child) for child in (*up, *down) if child not in self._static]
        if not moving:
            raise BagError(
                f"frame {frame!r} must move in {target!r}, /tf_static holds it still;"
                f" name another frame of {', '.join(self.names)}"
            )
        return max(moving, key=len)[:, :2]

    def placements(self, target: str, frame: str, times_s: FloatArray) -> FloatArray:
        """(N, 4, 4) of a frame in the target; NaN at times at which that is unknown.

        BagError where no chain joins the frames.
        """
        found = self.placement(
            *self._joined(target, frame), lambda child: self._transforms(child, times_s)
        )
        return np.broadcast_to(found, (len(times_s), 4, 4))

    def _joined(self, target: str, frame: str) -> tuple[list[str], list[str]]:
        found = self.between(frame, target)
        if found is None:
            known = self.names
            unknown = next((name for name in (target, frame) if name not in known), None)
            fix = hint(unknown, known) if unknown else "record what joins them too"
            raise BagError(
                f"frame {frame!r} must be joined with {target!r} by /tf, it is not; {fix}"
            )
        return found

    def _rows(self, child: str) -> FloatArray:
        return np.array(self._samples[child]).reshape(-1, _COLUMNS)

    def _transforms(self, child: str, times_s: FloatArray) -> FloatArray:
        from scipy.spatial.transform import Rotation, Slerp  # nodes need none of it

        rows = self._rows(child)
        if child in self._static:
            return matrices_of(rows[-1:, 2:])
        rows = rows[np.unique(rows[:, 1], return_index=True)[1]]
        stamp_s, known = rows[:, 1], matrices_of(rows[:, 2:])
        if len(rows) > 1:
            turning = Slerp(stamp_s, Rotation.from_matrix(known[:, :3, :3]))
            turned = turning(np.clip(times_s, stamp_s[0], stamp_s[-1])).as_matrix()
        else:
            turned = known[:, :3, :3]
        found = np.tile(np.eye(4), (len(times_s), 1, 1))
        found[:, :3, :3] = turned
        columns = [np.interp(times_s, stamp_s, column) for column in known[:, :3, 3].T]
        found[:, :3, 3] = np.stack(columns, axis=1)
        beyond_s = np.maximum(stamp_s[0] - times_s, times_s - stamp_s[-1])
        found[beyond_s > _LONGEST_REACH_S] = np.nan
        return found
