"""What advances the world: lock-step on stamped commands, or a timer in real time.

In lock-step the world waits for the TwistStamped whose stamp is that of its last tick, so a seed
gives one trajectory whatever the speed of the machine. Messages can be lost while endpoints are
still being matched, so a tick that stays unanswered is sent again; receivers answer a
known stamp with the same message. An episode that has reached the goal does not advance until the
next reset.
"""

from typing import Protocol

from geometry_msgs.msg import Twist, TwistStamped

from serd_ros.convert.command import from_twist, from_twist_stamped
from serd_ros.convert.stamp import stamp_ns, to_stamp
from serd_ros.endpoints import qos, topics
from serd_ros.endpoints.world_publisher import WorldPublisher
from serd_ros.graph.configs import HallwaySimConfig
from serd_ros.process.serd_node import SerdNode
from sim.world.command import Command, CommandGuard
from sim.world.world import HallwayWorld

_RESEND_AFTER_S = 0.5


class WorldLoop(Protocol):
    """Advances the world between resets."""

    paused: bool

    def begin(self) -> None:
        """A new episode has just been reset."""
        ...

    def goal_moved(self) -> None:
        """The world has another goal area now."""
        ...


class LockstepLoop:
    """One step per stamped command."""

    def __init__(
        self, node: SerdNode[HallwaySimConfig], world: HallwayWorld, publisher: WorldPublisher
    ) -> None:
        self.paused = False
        self._node, self._world, self._publisher = node, world, publisher
        self._awaited_ns: int | None = None
        self._stands_in_goal = False
        self._sent_wall_s = self._answered_wall_s = node.wall_s()
        node.create_subscription(TwistStamped, topics.CMD_VEL, self._on_command, qos.COMMAND)
        node.create_timer(_RESEND_AFTER_S / 2, self._watch, clock=node.wall_clock)

    def begin(self) -> None:
        """Publish the first observation of the episode and wait for its command."""
        self._answered_wall_s = self._node.wall_s()
        self._publish()

    def goal_moved(self) -> None:
        """Go on from a goal that is none any more."""
        if self._stands_in_goal and not self._world.in_goal:
            self._publish()

    def _on_command(self, message: TwistStamped) -> None:
        time_ns, command = from_twist_stamped(message)
        if self.paused or time_ns != self._awaited_ns:
            return
        self._answered_wall_s = self._node.wall_s()
        self._world.step(command)
        self._publish()

    def _publish(self) -> None:
        over = self._world.in_goal
        self._stands_in_goal = over
        self._awaited_ns = None if over else stamp_ns(to_stamp(self._world.time_s))
        self._sent_wall_s = self._node.wall_s()
        self._publisher.publish()

    def _watch(self) -> None:
        """Send an unanswered tick again; give up after a long time without an answer."""
        now_s = self._node.wall_s()
        if self._awaited_ns is None or self.paused:
            return
        if now_s - self._answered_wall_s > self._node.config.lockstep_timeout_s:
            self._node.fail(
                f"no command for the tick at {self._world.time_s:.2f} s arrived within "
                f"lockstep_timeout_s = {self._node.config.lockstep_timeout_s:g} s; start "
                "local_planner and a driver with lockstep:=true, or run with lockstep:=false"
            )
        elif now_s - self._sent_wall_s > _RESEND_AFTER_S:
            self._publish()


class LiveLoop:
    """One step per control period of (scaled) real time, with a dead-man's switch."""

    def __init__(
        self, node: SerdNode[HallwaySimConfig], world: HallwayWorld, publisher: WorldPublisher
    ) -> None:
        self.paused = False
        self._node, self._world, self._publisher = node, world, publisher
        self._guard = CommandGuard(node.config.command_timeout_s)
        self._running = False
        if node.config.stamped_cmd_vel:
            node.create_subscription(
                TwistStamped,
                topics.CMD_VEL,
                lambda m: self._take(from_twist_stamped(m)[1]),
                qos.COMMAND,
            )
        else:
            node.create_subscription(
                Twist, topics.CMD_VEL, lambda m: self._take(from_twist(m)), qos.COMMAND
            )
        period_s = world.scenario.control_period_s / node.config.real_time_factor
        node.create_timer(period_s, self._step, clock=node.wall_clock)

    def begin(self) -> None:
        """Publish the first observation; the timer continues from here."""
        self._running = True
        self._publisher.publish()

    def goal_moved(self) -> None:
        """Nothing to do: a live world does not stop at the goal."""

    def _take(self, command: Command) -> None:
        self._guard.receive(command, self._world.time_s)

    def _step(self) -> None:
        if self.paused or not self._running:
            return
        self._world.step(self._guard.current(self._world.time_s))
        self._publisher.publish()
