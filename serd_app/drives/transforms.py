"""Places frames in each other by recorded /tf and /tf_static.

Each moving transform is interpolated at the time asked for (positions linearly, rotations along the
shortest arc), and unknown more than a second before the first one or after the last.
"""

from array import array
from collections.abc import Mapping
from itertools import pairwise

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from serd_app.drives.frame_graph import FrameGraph, matrices_of, plain_name
from serd_bag.errors import BagError
from serd_bag.messages.fields import store_of
from serd_bag.messages.plain import Transform, transforms
from serd_bag.nearest import hint
from serd_bag.topic import RawMessage, Topic
from serd_core.arrays import FloatArray

TF_TYPES = ("tf2_msgs/msg/TFMessage", "tf/msg/tfMessage")
_LONGEST_REACH_S = 1.0
_COLUMNS = 9
#: From which on a transform moves (m, or parts of a quaternion), and travels.
_STILL, _TRAVEL_M = 1e-3, 0.2


class TransformTree(FrameGraph):
    """Collects transforms; BagError where nothing joins the frames that are asked for."""

    def __init__(self) -> None:
        super().__init__()
        #: Log time, stamp (s), and the numbers of each transform of a frame.
        self._samples: dict[str, array[float]] = {}
        self._static: set[str] = set()

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

    def carried(self) -> list[str]:
        """The lowest frames that travel: bodies, as wheels and lidars only turn on them."""
        travelling = {
            child
            for child in self._parents.keys() - self._static
            if np.ptp(self._rows(child)[:, 2:5], axis=0).max() >= _TRAVEL_M
        }
        above = {parent for child in travelling for parent in self.chain(child)[1:]}
        return sorted(travelling - above)

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


class RecordedTransforms(TransformTree):
    """The tree of a recorded topic of transforms and the `_static` one beside it.

    known: topics of the recording, of which others are left; topics: those to take messages of.
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
