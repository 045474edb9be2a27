"""The newest transforms between frames, as /tf and /tf_static give them (REP 105).

A transform that is older than `LONGEST_S` beside the newest one of its chain is stale: what
published it has stopped. A frame that is in two others within that time is in neither.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import reduce
from typing import Any, TypeVar

import numpy as np

from serd_bag.messages.plain import Transform
from serd_core.arrays import FloatArray
from serd_ros.endpoints import topics
from serd_ros.errors import MessageError
from serd_sim.robot.urdf import matrix_of
from serd_sim.safety.motion import compose
from serd_sim.world.observation import Pose

LONGEST_S = 3.0
Message = TypeVar("Message")
_LEAST_UPRIGHT = 0.9
#: From the middle of the earth to a map it is 6.4e6 m.
_FARTHEST_M = 1e7


@dataclass(frozen=True, eq=False)
class Placement:
    """Where a frame is in another; stamp_ns: of the moving transform next to it, None if none."""

    matrix: FloatArray
    stamp_ns: int | None

    @property
    def pose(self) -> Pose:
        """x, y and heading, seen from above."""
        at = self.matrix
        return float(at[0, 3]), float(at[1, 3]), float(np.arctan2(at[1, 0], at[0, 0]))


class Frames:
    """Takes transforms and places frames in each other; MessageError where nothing joins them.

    prefix: before the frames `base_link` and `odom` of this robot outside its nodes, as
    robot_state_publisher's frame_prefix.
    """

    def __init__(self, prefix: str = "") -> None:
        self.prefix = prefix
        self._edges: dict[str, tuple[str, FloatArray, int | None]] = {}
        #: By frame: another one that it was in, and the stamps of both at that time.
        self._others: dict[str, tuple[str, int, int]] = {}

    @property
    def names(self) -> tuple[str, ...]:
        """All frames that occur."""
        parents = (parent for parent, _, _ in self._edges.values())
        return tuple(sorted({*self._edges, *parents}))

    def take(self, transform: Transform, *, static: bool) -> None:
        """Keep a transform in place of the one before; MessageError where it is none."""
        moved, turned = transform.placed[:3], transform.placed[3:]
        length = math.hypot(*turned)
        parent, child = self.own(transform.header.frame), self.own(transform.child)
        if parent == child:
            raise MessageError(
                "transforms must be between two frames", repr(child), "correct what publishes it"
            )
        # Not so for NaN either.
        if not (math.hypot(*moved) <= _FARTHEST_M and abs(length - 1) < 0.01):
            raise MessageError(
                f"transforms must be finite, of at most {_FARTHEST_M:g} m, with a unit quaternion",
                f"{transform.placed} of {transform.child!r}",
                "correct what publishes it",
            )
        matrix = np.eye(4)
        x, y, z, w = turned
        matrix[:3, :3] = matrix_of((x / length, y / length, z / length, w / length))
        matrix[:3, 3] = moved
        stamp_ns = None if static else transform.header.stamp_ns
        self._note_other_parent(child, parent, stamp_ns)
        self._edges[child] = parent, matrix, stamp_ns
        self._break_loop(child, stamp_ns)

    def _note_other_parent(self, child: str, parent: str, stamp_ns: int | None) -> None:
        """Note that a frame was in another one; a static transform has the time of the moving."""
        other, _, then_ns = self._edges.get(child, (parent, None, None))
        times_ns = [each for each in (then_ns, stamp_ns) if each is not None]
        if other != parent and times_ns:
            self._others[child] = other, times_ns[0], times_ns[-1]

    def _break_loop(self, frame: str, stamp_ns: int | None) -> None:
        """Discard transforms that have stopped of a loop that the newest one closes."""
        if stamp_ns is None:
            return
        for child in self._loop_of(self._chain(frame)):
            other_ns = self._edges[child][2]
            if other_ns is not None and abs(stamp_ns - other_ns) * 1e-9 > LONGEST_S:
                del self._edges[child]

    def prefixed(self, message: Message) -> Message:
        """The message to be published, with the prefix before the robot's frames."""
        if self.prefix:
            _rename(message, lambda name: self.prefix * (name in topics.OWN_FRAMES) + name)
        return message

    def remove_prefix(self, message: Any) -> None:
        """Take the prefix away from the frames of a message that was received."""
        _rename(message, lambda name: name.removeprefix(self.prefix))

    def own(self, frame: str) -> str:
        """The name by which nodes know a frame: without slash and prefix."""
        return plain_name(frame).removeprefix(self.prefix)

    def place(
        self, frame: str, target: str, *, level: bool = True, field: str = "frame_id"
    ) -> Placement:
        """The frame in the target; level: whether it must be level there; field: that names it."""
        up, down = self._ancestry(self.own(frame)), self._ancestry(self.own(target))
        shared = next((each for each in up if each in down), None)
        if shared is None:
            self._require_one_parent([*up, *down])  # the other parent may join them
            raise MessageError(
                f"{field} must be {target!r} or joined with it by /tf",
                f"{frame!r}; frames of /tf: {', '.join(self.names) or 'none'}",
                f"publish the transform from {target!r} to {frame!r}" if frame else f"set {field}",
            )
        up, down = up[: up.index(shared)], down[: down.index(shared)]
        self._require_one_parent([*up, *down])
        self._require_fresh([*up, *down])
        matrix = np.linalg.inv(self._product(down)) @ self._product(up)
        if level and matrix[2, 2] < _LEAST_UPRIGHT:
            turned = matrix[2, 2] < -_LEAST_UPRIGHT
            raise MessageError(
                f"{field} must be of a frame that is level in {target!r}",
                f"{frame!r}, whose z axis points {'down' if turned else 'elsewhere'}",
                "let the driver reverse the angles (often 'inverted'), and turn the z axis of its"
                " frame up"
                if turned
                else "publish in a level frame",
            )
        stamps = [stamp for child in (*up, *down) if (stamp := self._edges[child][2]) is not None]
        return Placement(matrix, stamps[0] if stamps else None)

    def pose_in(self, target: str, frame: str, pose: Pose) -> Pose:
        """A pose given in `frame`, in the target; the same numbers where the frames are one."""
        if frame == target:
            return pose
        return compose(self.place(frame, target).pose, pose)

    def _require_one_parent(self, chain: list[str]) -> None:
        """A frame may move to another parent, but is not in both in turn."""
        for child in chain:
            if child not in self._others:
                continue
            other, then_ns, changed_ns = self._others[child]
            parent, _, stamp_ns = self._edges[child]
            had_stopped = abs(changed_ns - then_ns) * 1e-9 > LONGEST_S
            is_over = stamp_ns is not None and abs(stamp_ns - changed_ns) * 1e-9 > LONGEST_S
            if not (had_stopped or is_over):
                raise MessageError(
                    "a frame of /tf must have one parent",
                    f"{child!r} in {other!r} and in {parent!r}",
                    "end what publishes one of them",
                )

    def _require_fresh(self, chain: list[str]) -> None:
        stamps = {child: stamp for child in chain if (stamp := self._edges[child][2]) is not None}
        if not stamps:
            return
        oldest = min(stamps, key=lambda child: stamps[child])
        age_s = (max(stamps.values()) - stamps[oldest]) * 1e-9
        if age_s > LONGEST_S:
            raise MessageError(
                f"transforms of /tf must be at most {LONGEST_S:g} s apart",
                f"{self._edges[oldest][0]!r} to {oldest!r}, {age_s:.1f} s older than others",
                "look at what publishes it",
            )

    def _product(self, chain: list[str]) -> FloatArray:
        return reduce(lambda matrix, child: self._edges[child][1] @ matrix, chain, np.eye(4))

    def _ancestry(self, frame: str) -> list[str]:
        found = self._chain(frame)
        if loop := self._loop_of(found):
            raise MessageError(
                "transforms of /tf must form no loop",
                " in ".join(map(repr, [*loop, loop[0]])),
                "end what publishes one of them",
            )
        return found

    def _chain(self, frame: str) -> list[str]:
        """A frame and those that it is in, each once."""
        found = [frame]
        while found[-1] in self._edges and (parent := self._edges[found[-1]][0]) not in found:
            found.append(parent)
        return found

    def _loop_of(self, chain: list[str]) -> list[str]:
        """The frames at the end of a chain that are in each other; empty if there are none."""
        last = self._edges.get(chain[-1])
        return [] if last is None else chain[chain.index(last[0]) :]


#: Where no transform is known.
NO_FRAMES = Frames()


def _rename(message: Any, new_name: Callable[[str], str]) -> None:
    """Rename the frames of a message, and of its transforms."""
    for each in (message, *getattr(message, "transforms", ())):
        if hasattr(each, "header"):
            each.header.frame_id = new_name(each.header.frame_id)
        if hasattr(each, "child_frame_id"):
            each.child_frame_id = new_name(each.child_frame_id)


def plain_name(frame: str) -> str:
    """A frame without the leading slash of ROS 1."""
    return frame.lstrip("/")
