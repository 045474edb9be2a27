"""A person's episodes over ROS: resets the world, publishes marks, counts those of everybody."""

from collections.abc import Callable, Sequence
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.task import Future
from std_srvs.srv import Trigger

from serd_ros.convert.episode_mark import EpisodeMark, from_episode_message, to_episode_message
from serd_ros.convert.reset_reply import ResetReply, from_reset_sentence
from serd_ros.endpoints import qos, topics
from serd_ros.graph.readiness import Readiness
from serd_ros.process.serd_node import SerdNode
from sim.scenario.scenario import Scenario
from sim.world.observation import Observation
from teleop.errors import TeleopError
from teleop.session import END, EpisodeEvent, EpisodeTally, Session

_LOOK_AGAIN_S = 0.05


class EpisodeControl:
    """tell: called with one sentence for the person about everything that happens."""

    def __init__(
        self,
        node: SerdNode[Any],
        scenario: Scenario,
        *,
        driver: str,
        timeout_s: float,
        required_nodes: Sequence[str],
        tell: Callable[[str], None],
    ) -> None:
        self.session = Session(scenario, timeout_s)
        self.tally = EpisodeTally()
        self.n_decisions = 0
        self.episode: ResetReply | None = None
        self._node, self._driver, self._tell = node, driver, tell
        self._readiness = Readiness(node, required_nodes, node.wall_s())
        self._waited_for = ""
        self._look = node.create_timer(
            _LOOK_AGAIN_S, self._begin_when_ready, clock=node.wall_clock, autostart=False
        )
        self._marks = node.create_publisher(DiagnosticArray, topics.EPISODE, qos.STATE)
        self._reset = node.create_client(Trigger, topics.RESET)
        node.create_subscription(DiagnosticArray, topics.EPISODE, self._on_mark, qos.STATE)

    @property
    def is_running(self) -> bool:
        """Whether an episode of this driver's is under way."""
        return self.session.phase == "running"

    @property
    def other_driver(self) -> str:
        """Who else has an episode under way, empty for nobody."""
        running = self.tally.running
        return running.driver if running is not None and not self._is_mine(running.number) else ""

    def start(self) -> None:
        """Begin as soon as everybody listens; TeleopError where an episode is running."""
        if self.other_driver:
            raise TeleopError(f"an episode of {self.other_driver} is running; end it there first")
        self.session.start()
        self._waited_for = ""
        self._look.reset()

    def save(self) -> None:
        """Keep the running episode as it is."""
        event = self.session.save()
        if event is not None:
            self._publish(event)

    def discard(self) -> None:
        """Throw the running or the last episode away."""
        self._publish(self.session.discard())

    def see(self, observation: Observation) -> None:
        """Follow the episode."""
        for event in self.session.observe(observation):
            self._publish(event)

    def _begin_when_ready(self) -> None:
        """Reset the world once nobody who records or drives would miss the beginning."""
        missing = self._readiness.missing(self._node.wall_s())
        if missing or not self._reset.service_is_ready():
            self._say_waiting(missing or "the world")
            return
        self._look.cancel()
        self._reset.call_async(Trigger.Request()).add_done_callback(self._on_reset)

    def _say_waiting(self, missing: str) -> None:
        if missing != self._waited_for:
            self._waited_for = missing
            self._tell(f"the episode waits for {missing}")

    def _on_reset(self, future: Future) -> None:
        reply = future.result()
        if not reply.success:
            self._say_waiting(reply.message)
            self._look.reset()
            return
        self.episode = from_reset_sentence(reply.message)
        self.n_decisions = 0
        self.session.world_reset(self.episode.start_s)

    def _publish(self, event: EpisodeEvent) -> None:
        assert self.episode is not None
        mark = EpisodeMark(
            event=event.event,
            time_s=event.time_s,
            episode=self.episode.episode,
            driver=self._driver,
            seed=self.episode.seed,
            start_area=self.episode.start_area,
            outcome=event.outcome,
        )
        self._marks.publish(to_episode_message(mark))

    def _on_mark(self, message: DiagnosticArray) -> None:
        mark = from_episode_message(message)
        self.tally.add(mark.event, mark.episode, mark.driver, mark.outcome)
        if mark.event == END:
            took = f" after {self.session.duration_s:.1f} s" if self._is_mine(mark.episode) else ""
            self._tell(f"episode {mark.episode} {mark.outcome}{took}; so far {self.tally}")
        else:
            self._tell(f"episode {mark.episode} of {mark.driver} has begun")

    def _is_mine(self, number: int) -> bool:
        return self.episode is not None and self.episode.episode == number
