"""Frames that transforms place in each other (REP 105): those of nodes, and of recorded /tf.

A frame is in one other frame, its parent. The placement of a frame in another one is the product of
the transforms from both up to the frame above them. Each moving transform is interpolated at the
time asked for (positions linearly, rotations along the shortest arc), as tf2 does. Of recordings it
is unknown more than a second before the first one or after the last; nodes refuse to extrapolate.
"""

from array import array
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import reduce
from itertools import pairwise

import numpy as np

from serd_bag.errors import BagError
from serd_bag.formats.rosbag2.message_types import store_of
from serd_bag.messages.plain import Transform, transforms
from serd_bag.nearest import hint
from serd_bag.topic import RawMessage, Topic
from serd_core.arrays import FloatArray, IntArray

TF_TYPES = ("tf2_msgs/msg/TFMessage", "tf/msg/tfMessage")
_LONGEST_REACH_S = 1.0
_UNTURNED: FloatArray = np.array([0.0, 0.0, 0.0, 1.0])
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


class TransformHistory:
    """The transform of one frame in its parent over time, in the order of arrival.

    is_static: whether it holds at all times, with its newest numbers. newest_ns: newest stamp.
    """

    def __init__(self, *, is_static: bool) -> None:
        self.is_static, self.newest_ns = is_static, 0
        self._times_ns, self._numbers = array("q"), array("d")

    def add(self, stamp_ns: int, placed: Sequence[float], log_time_ns: int = 0) -> None:
        """Take x, y, z and the quaternion at a time."""
        self.newest_ns = max(self.newest_ns, stamp_ns)
        self._times_ns.extend((log_time_ns, stamp_ns))
        self._numbers.extend(placed)

    def forget_before(self, stamp_ns: int) -> None:
        """Drop what arrived before the first sample of this time, once that is half of all."""
        old = int(np.argmax(np.frombuffer(self._times_ns, dtype=np.int64)[1::2] >= stamp_ns))
        if 4 * old > len(self._times_ns):
            del self._times_ns[: 2 * old], self._numbers[: 7 * old]

    @property
    def times_ns(self) -> IntArray:
        """(N, 2) log times and stamps."""
        return np.array(self._times_ns, dtype=np.int64).reshape(-1, 2)

    @property
    def numbers(self) -> FloatArray:
        """(N, 7) x, y, z and quaternions."""
        return np.array(self._numbers, dtype=np.float64).reshape(-1, 7)

    def at(self, times_ns: IntArray) -> tuple[FloatArray, FloatArray]:
        """(T, 4, 4) at times (T,), the nearest one beyond the first and the last; and (T,) how long
        (s) before the first (below 0) or after the last that is."""
        if self.is_static:
            return matrices_of(self.numbers[-1:]), np.zeros(len(times_ns))
        # Views, which end with this call: an array of which there is one cannot grow.
        stamps_ns = np.frombuffer(self._times_ns, dtype=np.int64)[1::2]
        numbers = np.frombuffer(self._numbers).reshape(-1, 7)
        if (np.diff(stamps_ns) <= 0).any():
            stamps_ns, order = np.unique(stamps_ns, return_index=True)
            numbers = numbers[order]
        within_ns = np.clip(times_ns, stamps_ns[0], stamps_ns[-1])
        after = np.maximum(np.searchsorted(stamps_ns, within_ns), min(1, len(stamps_ns) - 1))
        before = np.maximum(after - 1, 0)
        span_ns = np.maximum(stamps_ns[after] - stamps_ns[before], 1)
        share = ((within_ns - stamps_ns[before]) / span_ns)[:, None]
        start, end = numbers[before], numbers[after]
        moved_m = start[:, :3] + share * (end[:, :3] - start[:, :3])
        rows = np.concatenate([moved_m, _turned(start[:, 3:], end[:, 3:], share)], axis=1)
        beyond_s: FloatArray = 1e-9 * np.array(times_ns - within_ns, dtype=np.float64)
        return matrices_of(rows), beyond_s


def _turned(start: FloatArray, end: FloatArray, share: FloatArray) -> FloatArray:
    """(N, 4) quaternions at shares (N, 1) of the shortest arcs between two (N, 4)."""
    start, end = (
        np.where(np.any(each, axis=1, keepdims=True), each, _UNTURNED) for each in (start, end)
    )
    start, end = (each / np.linalg.norm(each, axis=1)[:, None] for each in (start, end))
    cosine = np.sum(start * end, axis=1)[:, None]
    end = np.where(cosine < 0.0, -end, end)
    angle = np.arctan2(np.linalg.norm(end - start, axis=1), np.linalg.norm(end + start, axis=1))
    angle = 2.0 * angle[:, None]
    small = angle < 1e-6  # where the arc is its chord
    sine = np.sin(np.where(small, 1.0, angle))
    early = np.where(small, 1.0 - share, np.sin((1.0 - share) * angle) / sine)
    late = np.where(small, share, np.sin(share * angle) / sine)
    found: FloatArray = early * start + late * end
    return found


class FrameGraph:
    """Which frame is in which, and how over time."""

    def __init__(self) -> None:
        self._parents: dict[str, str] = {}
        self._histories: dict[str, TransformHistory] = {}

    @property
    def names(self) -> tuple[str, ...]:
        """All frames that occur."""
        return tuple(sorted(self._parents.keys() | set(self._parents.values())))

    def _history(self, child: str, parent: str, *, is_static: bool) -> TransformHistory:
        """Where to put a transform of a frame in its parent, which it has from now on."""
        history = self._histories.get(child)
        is_other = self._parents.get(child) != parent
        if history is None or is_other or history.is_static != is_static:
            history = self._histories[child] = TransformHistory(is_static=is_static)
            self._parents[child] = parent
        return history

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
        stamp_ns = transform.header.stamp_ns or log_time_ns
        self._history(child, parent, is_static=static).add(stamp_ns, transform.placed, log_time_ns)

    def root(self, frame: str) -> str:
        """The frame at the end of its chain of parents."""
        return self.chain(frame)[-1]

    def frame_that_corrects(self, frame: str) -> str:
        """The topmost of the ancestors in which a frame moves, as a map in which a localisation
        moves the frame of odometry; empty where none does."""
        moving = [parent for child, parent in pairwise(self.chain(frame)) if self._moves(child)]
        return moving[-1] if moving else ""

    def _moves(self, child: str) -> bool:
        history = self._histories[child]
        return not history.is_static and bool(np.ptp(history.numbers, axis=0).max() > _STILL)

    def times(self, target: str, frame: str) -> FloatArray:
        """(N, 2) log times and stamps (s) of the transform between the frames that has most of
        them, in the order of arrival; BagError where nothing moves between them."""
        up, down = self._joined(target, frame)
        moving = [
            self._histories[child].times_ns
            for child in (*up, *down)
            if not self._histories[child].is_static
        ]
        if not moving:
            raise BagError(
                f"frame {frame!r} must move in {target!r}, /tf_static holds it still;"
                f" name another frame of {', '.join(self.names)}"
            )
        return max(moving, key=len) / 1e9

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

    def _transforms(self, child: str, times_s: FloatArray) -> FloatArray:
        found, beyond_s = self._histories[child].at(np.rint(times_s * 1e9).astype(np.int64))
        if not self._histories[child].is_static:
            found[np.abs(beyond_s) > _LONGEST_REACH_S] = np.nan
        return found
