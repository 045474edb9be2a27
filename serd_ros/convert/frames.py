"""Where frames were in each other in the last seconds, as /tf and /tf_static give it (REP 105).

As in tf2, transforms are interpolated between their stamps and not extrapolated: without a time,
frames are placed at the newest one that all transforms of the chain have reached. A transform that
is older than `LONGEST_S` beside the newest one of its chain is stale: what published it has
stopped. A frame that is in two others within that time is in neither.
"""

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np

from serd_app.drives.transforms import FrameGraph, plain_name, planar
from serd_bag.messages.plain import Transform
from serd_core.arrays import FloatArray
from serd_ros.endpoints import topics
from serd_ros.errors import MessageError
from serd_sim.safety.motion import compose
from serd_sim.world.observation import Pose

LONGEST_S = 3.0
#: How long (s) transforms are kept.
MEMORY_S = 10.0
#: A stamp that falls back by more than this (s) begins anew.
_RESTART_S = 0.5
Message = TypeVar("Message")
_LEAST_UPRIGHT = 0.9
_MOST_WAITING = 20
#: From the middle of the earth to a map it is 6.4e6 m.
_FARTHEST_M = 1e7


@dataclass(frozen=True, eq=False)
class Placement:
    """Where a frame is in another; stamp_ns: when, None where nothing between them moves."""

    matrix: FloatArray
    stamp_ns: int | None

    @property
    def pose(self) -> Pose:
        """x, y and heading, seen from above."""
        x_m, y_m, yaw_rad = planar(self.matrix[None])[0].tolist()
        return x_m, y_m, yaw_rad


class NotYetError(MessageError):
    """Transforms have not reached the time at which a frame is wanted."""


class Frames(FrameGraph):
    """Takes transforms and places frames in each other; MessageError where nothing joins them.

    prefix: before the frames `base_link` and `odom` of this robot outside its nodes, as
    robot_state_publisher's frame_prefix. waiting: what is called after the next transform.
    """

    def __init__(self, prefix: str = "") -> None:
        super().__init__()
        self.prefix = prefix
        self.waiting: deque[Callable[[], None]] = deque(maxlen=_MOST_WAITING)
        #: By frame: another one that it was in, and the stamps of both at that time.
        self._others: dict[str, tuple[str, int, int]] = {}

    def take(self, transform: Transform, *, static: bool) -> None:
        """Keep a transform in place of the one before; MessageError where it is none."""
        moved, turned = transform.placed[:3], transform.placed[3:]
        parent, child = self.own(transform.header.frame), self.own(transform.child)
        if parent == child:
            raise MessageError(
                "transforms must be between two frames", repr(child), "correct what publishes it"
            )
        # Not so for NaN either.
        if not (math.hypot(*moved) <= _FARTHEST_M and abs(math.hypot(*turned) - 1) < 0.01):
            raise MessageError(
                f"transforms must be finite, of at most {_FARTHEST_M:g} m, with a unit quaternion",
                f"{transform.placed} of {transform.child!r}",
                "correct what publishes it",
            )
        stamp_ns, moving = transform.header.stamp_ns, self._newest_ns(child)
        other = self._parents.get(child, parent)
        if other != parent and not (static and moving is None):
            # A static transform has the time of the moving one.
            then_ns = stamp_ns if moving is None else moving
            self._others[child] = other, then_ns, then_ns if static else stamp_ns
        if moving is not None and (moving - stamp_ns) * 1e-9 > _RESTART_S:
            del self._histories[child]
        history = self._history(child, parent, is_static=static)
        history.add(stamp_ns, transform.placed)
        if not static:
            history.forget_before(stamp_ns - round(MEMORY_S * 1e9))
            self._break_loop(child, stamp_ns)

    def _newest_ns(self, child: str) -> int | None:
        """The newest stamp of a transform that moves, else None."""
        history = self._histories.get(child)
        return None if history is None or history.is_static else history.newest_ns

    def _break_loop(self, frame: str, stamp_ns: int) -> None:
        """Discard transforms that have stopped of a loop that the newest one closes."""
        for child in self._loop_of(self.chain(frame)):
            other_ns = self._newest_ns(child)
            if other_ns is not None and abs(stamp_ns - other_ns) * 1e-9 > LONGEST_S:
                del self._parents[child], self._histories[child]

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
        self,
        frame: str,
        target: str,
        *,
        at_ns: int | None = None,
        level: bool = True,
        field: str = "frame_id",
    ) -> Placement:
        """The frame in the target. at_ns: when, the newest time without one; NotYetError where
        transforms have not reached it. level: whether it must be level there; field: that names it.
        """
        own, own_target = self.own(frame), self.own(target)
        self._require_no_loop(own, own_target)
        found = self.between(own, own_target)
        if found is None:
            # The other parent may join them.
            self._require_one_parent([*self.chain(own), *self.chain(own_target)])
            raise MessageError(
                f"{field} must be {target!r} or joined with it by /tf",
                f"{frame!r}; frames of /tf: {', '.join(self.names) or 'none'}",
                f"publish the transform from {target!r} to {frame!r}" if frame else f"set {field}",
            )
        chain = [*found[0], *found[1]]
        self._require_one_parent(chain)
        newest_ns = self._require_fresh(chain)
        time_ns = newest_ns if at_ns is None or newest_ns is None else at_ns
        if at_ns is not None:
            self._require_reached(chain, at_ns)
        matrix = np.eye(4)  # of a frame in itself
        if chain:
            at = np.array([time_ns or 0])
            matrix = self.placement(*found, lambda child: self._histories[child].at(at)[0])[0]
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
        return Placement(matrix, time_ns)

    def pose_in(self, target: str, frame: str, pose: Pose) -> Pose:
        """A pose given in `frame`, in the target; the same numbers where the frames are one."""
        if frame == target:
            return pose
        return compose(self.place(frame, target).pose, pose)

    def _require_one_parent(self, chain: list[str]) -> None:
        """A frame may move to another parent, but is not in both in turn."""
        for child in chain:
            if child not in self._others or child not in self._parents:
                continue
            other, then_ns, changed_ns = self._others[child]
            moving = self._newest_ns(child)
            stamp_ns = changed_ns if moving is None else moving
            had_stopped = abs(changed_ns - then_ns) * 1e-9 > LONGEST_S
            is_over = abs(stamp_ns - changed_ns) * 1e-9 > LONGEST_S
            if not (had_stopped or is_over):
                raise MessageError(
                    "a frame of /tf must have one parent",
                    f"{child!r} in {other!r} and in {self._parents[child]!r}",
                    "end what publishes one of them",
                )

    def _require_fresh(self, chain: list[str]) -> int | None:
        """The newest time that all transforms have reached, None where none moves."""
        stamps_ns = {child: stamp_ns for child in chain if (stamp_ns := self._newest_ns(child))}
        if not stamps_ns:
            return None
        oldest = min(stamps_ns, key=lambda child: stamps_ns[child])
        age_s = (max(stamps_ns.values()) - stamps_ns[oldest]) * 1e-9
        if age_s > LONGEST_S:
            raise MessageError(
                f"transforms of /tf must be at most {LONGEST_S:g} s apart",
                f"{self._parents[oldest]!r} to {oldest!r}, {age_s:.1f} s older than others",
                "look at what publishes it",
            )
        return stamps_ns[oldest]

    def _require_reached(self, chain: list[str], time_ns: int) -> None:
        """No transform is extrapolated to a time."""
        for child in chain:
            beyond_s = float(self._histories[child].at(np.array([time_ns]))[1][0])
            if beyond_s == 0.0:
                continue
            between = f"{self._parents[child]!r} to {child!r}"
            if beyond_s > 0.0:
                raise NotYetError(
                    "transforms of /tf must reach the stamp of a message",
                    f"{between}, {beyond_s:.3f} s older",
                    "look at what publishes it, and set the clocks of the machines",
                )
            raise MessageError(
                f"messages must be at most as old as /tf is kept ({MEMORY_S:g} s)",
                f"one {-beyond_s:.3f} s older than {between}",
                "look at its stamps, and at the clocks of the machines",
            )

    def _require_no_loop(self, *frames: str) -> None:
        for frame in frames:
            if loop := self._loop_of(self.chain(frame)):
                raise MessageError(
                    "transforms of /tf must form no loop",
                    " in ".join(map(repr, [*loop, loop[0]])),
                    "end what publishes one of them",
                )

    def _loop_of(self, chain: list[str]) -> list[str]:
        """The frames at the end of a chain that are in each other; empty if there are none."""
        last = self._parents.get(chain[-1])
        return [] if last is None else chain[chain.index(last) :]


#: Where no transform is known.
NO_FRAMES = Frames()


def _rename(message: Any, new_name: Callable[[str], str]) -> None:
    """Rename the frames of a message, and of its transforms."""
    for part in (message, *getattr(message, "transforms", ())):
        if hasattr(part, "header"):
            part.header.frame_id = new_name(part.header.frame_id)
        if hasattr(part, "child_frame_id"):
            part.child_frame_id = new_name(part.child_frame_id)
