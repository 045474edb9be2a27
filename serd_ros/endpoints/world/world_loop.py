"""What advances the world: lock-step on stamped commands, or a timer in real time.

In lock-step the world waits for the TwistStamped whose stamp is that of its last tick, so a seed
gives one trajectory whatever the speed of the machine. Messages can be lost while endpoints are
still being matched, so a tick that stays unanswered is sent again; receivers answer a known stamp
with the same message. A robot in its goal stands and is not waited for.
"""

from collections.abc import Callable

from geometry_msgs.msg import Twist, TwistStamped

from serd_ros.convert.command import from_any_twist, from_twist_stamped
from serd_ros.convert.stamp import stamp_ns, to_stamp
from serd_ros.endpoints import qos, topics
from serd_ros.endpoints.commands import follow_commands
from serd_ros.endpoints.endpoints import Endpoints
from serd_sim.world.command import CommandGuard
from serd_sim.world.world import HallwayWorld

_RESEND_AFTER_S = 0.5
#: More (s) between two looks at the silence is none: this process had no processor and could take
#: no command.
_LONGEST_TURN_S = 2.0


class LockstepLoop:
    """One step per stamped command, unless it is paused.

    publish: sends the present tick. timeout_s: without an answer, after which the node ends.
    """

    def __init__(
        self,
        endpoints: Endpoints,
        world: HallwayWorld,
        publish: Callable[[], None],
        timeout_s: float,
    ) -> None:
        self._node, self._world = endpoints.node, world
        self._publish, self._timeout_s = publish, timeout_s
        self.paused = self._begun = False
        self._awaited_ns: int | None = None
        self._sent_wall_s = self._watched_wall_s = self._node.wall_s()
        #: How long the command was awaited since the begin of the tick.
        self._silent_s = 0.0
        endpoints.subscribe(TwistStamped, topics.CMD_VEL, self._on_command, qos.COMMAND)
        endpoints.every(_RESEND_AFTER_S / 2, self._watch)

    def begin(self) -> None:
        """Publish the first observation of the episode and wait for its command."""
        self._begun = True
        self._begin_tick()

    def look(self) -> None:
        """Go on from a goal that is none any more."""
        if self._begun and self._awaited_ns is None and not self._world.in_goal:
            self._begin_tick()

    def _on_command(self, message: TwistStamped) -> None:
        time_ns, command = from_twist_stamped(message)
        if self.paused or time_ns != self._awaited_ns:
            return
        self._world.step(command)
        self._begin_tick()

    def _begin_tick(self) -> None:
        stamp = stamp_ns(to_stamp(self._world.time_s))
        self._awaited_ns = None if self._world.in_goal else stamp
        self._silent_s = 0.0
        self._send()

    def _send(self) -> None:
        self._sent_wall_s = self._node.wall_s()
        self._publish()

    def _watch(self) -> None:
        """Send an unanswered tick again; give up after a long time without an answer."""
        now_s = self._node.wall_s()
        turn_s, self._watched_wall_s = now_s - self._watched_wall_s, now_s
        if self.paused or self._awaited_ns is None:
            return
        self._silent_s += turn_s if turn_s <= _LONGEST_TURN_S else 0.0
        if self._silent_s > self._timeout_s:
            self._node.fail(
                f"no command for the tick at {self._world.time_s:.2f} s arrived on"
                f" {self._node.resolve_topic_name(topics.CMD_VEL)} within "
                f"lockstep_timeout_s = {self._timeout_s:g} s; start "
                "local_planner and a driver with lockstep:=true, or run with lockstep:=false"
            )
        elif now_s - self._sent_wall_s > _RESEND_AFTER_S:
            self._send()


class LiveLoop:
    """One step per control period of (scaled) real time, with a dead-man's switch, unless paused.

    publish: sends the present tick. timeout_s: without a command, after which the robot stops.
    """

    def __init__(
        self,
        endpoints: Endpoints,
        world: HallwayWorld,
        publish: Callable[[], None],
        timeout_s: float,
        *,
        stamped: bool,
        real_time_factor: float,
    ) -> None:
        self._world, self._publish = world, publish
        self._guard = CommandGuard(timeout_s)
        self.paused = self._running = False
        follow_commands(endpoints, topics.CMD_VEL, self._take, stamped=stamped)
        endpoints.every(world.scenario.control_period_s / real_time_factor, self._step)

    def begin(self) -> None:
        """Publish the first observation; the timer continues from here."""
        self._running = True
        self._publish()

    def look(self) -> None:
        """Nothing to do: a live world waits for no robot."""

    def _take(self, message: Twist | TwistStamped, age_s: float) -> None:
        """Let a command reach the guard."""
        self._guard.receive(from_any_twist(message), self._world.time_s - age_s)

    def _step(self) -> None:
        if self.paused or not self._running:
            return
        self._world.step(self._guard.current(self._world.time_s))
        self._publish()
