"""What advances the world: lock-step on stamped commands, or a timer in real time.

In lock-step the world waits for the TwistStamped of each robot whose stamp is that of its last
tick, so a seed gives one trajectory whatever the speed of the machine. Messages can be lost while
endpoints are still being matched, so a tick that stays unanswered is sent again; receivers answer a
known stamp with the same message. A robot in its goal stands and is not waited for; with other
robots in the world, one stands from a decision on that its driver does not take, since it has asked
for the next episode or has ended. The middleware takes a process that stands still for 20 s for one
that has ended, so a robot drives on when its driver is there again.
"""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from functools import partial

from geometry_msgs.msg import Twist, TwistStamped

from serd_ros.convert.command import from_any_twist, from_twist_stamped
from serd_ros.convert.stamp import stamp_ns, to_stamp
from serd_ros.endpoints import qos, topics
from serd_ros.endpoints.command_topic import follow_commands
from serd_ros.endpoints.world.simulated_robot import SimulatedRobot
from serd_ros.endpoints.world.world_publisher import ClockPublisher
from serd_ros.graph.configs import HallwaySimConfig
from serd_ros.process.serd_node import SerdNode
from sim.world.command import STOP, Command, CommandGuard
from sim.world.shared_world import SharedWorld
from sim.world.waypoint import is_decision_tick

_RESEND_AFTER_S = 0.5
#: More (s) between two looks at the silence is none: this process had no processor and could take
#: no command.
_LONGEST_TURN_S = 2.0


class WorldLoop(ABC):
    """Advances the world between resets."""

    def __init__(
        self,
        node: SerdNode[HallwaySimConfig],
        clock: ClockPublisher,
        world: SharedWorld,
        robots: Sequence[SimulatedRobot],
    ) -> None:
        self.paused = False
        self.world, self.robots, self._node, self._clock = world, tuple(robots), node, clock
        self.start()

    @abstractmethod
    def start(self) -> None:
        """Take commands from now on."""

    @abstractmethod
    def begin(self) -> None:
        """A new episode has just been reset."""

    @abstractmethod
    def look(self) -> None:
        """A robot has another goal area, or its driver asked for an episode or is there again."""

    def publish(self) -> None:
        """Send the present tick: the clock, then what each robot observes."""
        self._clock.publish(self.world.time_s)
        for robot in self.robots:
            robot.publisher.publish()


class LockstepLoop(WorldLoop):
    """One step per stamped command of each robot."""

    def start(self) -> None:
        """Wait for the first episode."""
        self._begun = False
        self._awaited_ns: int | None = None
        #: Those that move in this control period, with their commands so far.
        self._commands: dict[SimulatedRobot, Command | None] = {}
        self._standing: set[SimulatedRobot] = set()
        self._sent_wall_s = self._watched_wall_s = self._node.wall_s()
        #: How long commands were awaited since the last one or the begin of the tick.
        self._silent_s = 0.0
        for robot in self.robots:
            robot.node.create_subscription(
                TwistStamped, topics.CMD_VEL, partial(self._on_command, robot), qos.COMMAND
            )
        self._node.create_timer(_RESEND_AFTER_S / 2, self._watch)

    def begin(self) -> None:
        """Publish the first observation of the episode and wait for its commands."""
        self._begun = True
        self._standing.clear()
        self._begin_tick()

    def look(self) -> None:
        """Go on from a goal that is none any more, without a robot that drives no more, or with one
        that drives again."""
        if self._awaited_ns is not None:
            self._step_when_answered()
        elif self._begun:
            self._wake_driven()
            if self._moving():
                self._begin_tick()

    def _on_command(self, robot: SimulatedRobot, message: TwistStamped) -> None:
        time_ns, command = from_twist_stamped(message)
        # A known command, of a tick that was sent again, is no answer that another robot owes.
        is_new = self._commands.get(robot, command) is None
        if self.paused or time_ns != self._awaited_ns or not is_new:
            return
        self._silent_s = 0.0
        self._commands[robot] = command
        self._step_when_answered()

    def _wake_driven(self) -> None:
        self._standing = {each for each in self._standing if not each.is_driven}

    def _moving(self) -> list[SimulatedRobot]:
        return [
            each for each in self.robots if each not in self._standing and not each.world.in_goal
        ]

    def _step_when_answered(self) -> None:
        """Make the step once each moving robot has its command, or will get none."""
        self._leave_out_undriven()
        if self.paused or not all(self._commands.values()):
            return
        if self._commands:
            self.world.step([self._commands.get(each) or STOP for each in self.robots])
        self._begin_tick()

    def _leave_out_undriven(self) -> None:
        """At a decision, robots without one whose drivers take no more stand from now on."""
        world = self.robots[0].world
        if len(self.robots) == 1 or not is_decision_tick(world.observation, world.scenario):
            return
        for robot in [each for each, command in self._commands.items() if command is None]:
            if not robot.is_driven:
                self._standing.add(robot)
                del self._commands[robot]

    def _begin_tick(self) -> None:
        self._wake_driven()
        self._commands = dict.fromkeys(self._moving())
        stamp = stamp_ns(to_stamp(self.world.time_s))
        self._awaited_ns = stamp if self._commands else None
        self._silent_s = 0.0
        self._send()

    def _send(self) -> None:
        self._sent_wall_s = self._node.wall_s()
        self.publish()

    def _watch(self) -> None:
        """Send an unanswered tick again; give up after a long time without an answer."""
        now_s = self._node.wall_s()
        turn_s, self._watched_wall_s = now_s - self._watched_wall_s, now_s
        if self.paused:
            return
        if self._awaited_ns is None:
            self.look()
            return
        self._silent_s += turn_s if turn_s <= _LONGEST_TURN_S else 0.0
        if self._silent_s > self._node.config.lockstep_timeout_s:
            silent = [each.command_topic for each, sent in self._commands.items() if sent is None]
            self._node.fail(
                f"no command for the tick at {self.world.time_s:.2f} s arrived on"
                f" {', '.join(silent)} within "
                f"lockstep_timeout_s = {self._node.config.lockstep_timeout_s:g} s; start "
                "local_planner and a driver with lockstep:=true, or run with lockstep:=false"
            )
        elif now_s - self._sent_wall_s > _RESEND_AFTER_S:
            self._send()
            self._step_when_answered()


class LiveLoop(WorldLoop):
    """One step per control period of (scaled) real time, with a dead-man's switch."""

    def start(self) -> None:
        """Run the timer, which advances the world once an episode has begun."""
        self._guards = [CommandGuard(each.node.config.command_timeout_s) for each in self.robots]
        self._running = False
        for robot, guard in zip(self.robots, self._guards, strict=True):
            self._follow(robot, guard)
        period_s = self.robots[0].world.scenario.control_period_s
        self._node.create_timer(period_s / self._node.config.real_time_factor, self._step)

    def begin(self) -> None:
        """Publish the first observation; the timer continues from here."""
        self._running = True
        self.publish()

    def look(self) -> None:
        """Nothing to do: a live world waits for no robot."""

    def _follow(self, robot: SimulatedRobot, guard: CommandGuard) -> None:
        """Let the commands of a robot reach its guard."""

        def take(message: Twist | TwistStamped, age_s: float) -> None:
            guard.receive(from_any_twist(message), self.world.time_s - age_s)

        kind = TwistStamped if robot.node.config.stamped_cmd_vel else Twist
        follow_commands(robot.node, kind, topics.CMD_VEL, take)

    def _step(self) -> None:
        if self.paused or not self._running:
            return
        self.world.step([guard.current(self.world.time_s) for guard in self._guards])
        self.publish()
