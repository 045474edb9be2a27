"""Starts episodes: waits for the graph, has the world reset and publishes the marks.

Nothing sleeps: a timer looks whether the required nodes subscribe to all they need, so that neither
the recorder nor the planner misses the beginning of an episode.
"""

from collections.abc import Callable, Sequence
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.task import Future
from std_srvs.srv import Trigger

from serd_app.drives.drive import END, EpisodeMark
from serd_app.errors import TeleopError
from serd_app.teleop.session import EpisodeEvent, EpisodeTally, Session
from serd_bag.errors import FileError
from serd_files.yaml_config import yaml_model
from serd_ros.convert.diagnostics import from_episode_message, to_episode_message
from serd_ros.endpoints import qos, topics
from serd_ros.graph.graph import WORLD_TOPICS, Readiness, several_worlds
from serd_ros.process.serd_node import Endpoints
from serd_sim.episodes.episode import EpisodeStart
from serd_sim.scenario.scenario import Scenario
from serd_sim.world.observation import Observation

_LOOK_AGAIN_S = 0.05
#: The middleware loses the response of a server that has not found its client's reader yet.
_ASK_AGAIN_S = 30.0


class EpisodeStarter:
    """on_ready: called when an episode may begin; on_start: with each episode that the world
    begins; on_wait: with what is missing, when it changes. needs_reset: whether the world is reset;
    world_topics: those that must not have several publishers. lack: what is missing beside the
    graph, empty for nothing.
    """

    def __init__(
        self,
        endpoints: Endpoints,
        required_nodes: Sequence[str],
        *,
        on_ready: Callable[[], None],
        on_start: Callable[[EpisodeStart], None],
        on_wait: Callable[[str], None],
        needs_reset: bool = True,
        world_topics: Sequence[str] = WORLD_TOPICS,
        lack: Callable[[], str] = lambda: "",
    ) -> None:
        self.episode: EpisodeStart | None = None
        node = self._node = endpoints.node
        self._needs_reset, self._world_topics, self._lack = needs_reset, world_topics, lack
        self._on_ready, self._on_start, self._on_wait = on_ready, on_start, on_wait
        self._readiness = Readiness(node, required_nodes, node.wall_s())
        self._reset = endpoints.client(Trigger, topics.RESET)
        self._waited_for = ""
        #: The reset that is not answered yet, and when it was requested.
        self._asked: Future | None = None
        self._asked_wall_s = 0.0
        self._marks = endpoints.publisher(DiagnosticArray, topics.EPISODE, qos.STATE)
        look = self._continue_when_ready
        self._look = endpoints.every(_LOOK_AGAIN_S, look, autostart=False)
        self._take_reply = endpoints.guarded(topics.RESET, self._on_reply)

    @property
    def waiting(self) -> bool:
        """Whether something is missing."""
        return self._asked is None and not self._look.is_canceled()

    def wait(self) -> None:
        """Look until all that an episode needs is there, then call `on_ready`."""
        self._waited_for = ""
        self._look_again()

    def reset_world(self) -> None:
        """Request an episode of the world; wait while it refuses, repeat without an answer."""
        self._asked_wall_s = self._node.wall_s()
        self._asked = self._reset.call_async(Trigger.Request())
        self._asked.add_done_callback(self._take_reply)
        self._look.reset()

    def begin(self, episode: EpisodeStart) -> None:
        """An episode begins."""
        self.episode, self._waited_for = episode, ""
        self._on_start(episode)

    def mark(
        self, event: str, time_s: float, driver: str, *, outcome: str = "", reason: str = ""
    ) -> None:
        """Publish the start or the end of the episode that began last."""
        assert self.episode is not None
        number, seed, area = self.episode.episode, self.episode.seed, self.episode.start_area
        mark = EpisodeMark(event, time_s, number, driver, seed, area, outcome, reason)
        self._marks.publish(to_episode_message(mark))

    def _continue_when_ready(self) -> None:
        if self._asked is not None:
            if self._node.wall_s() - self._asked_wall_s < _ASK_AGAIN_S:
                return
            self._wait_again(f"an answer to reset, for {_ASK_AGAIN_S:g} s")
        several = several_worlds(self._node, self._world_topics)
        missing = several or self._lack() or self._readiness.missing(self._node.wall_s())
        if not missing and self._needs_reset and not self._reset.service_is_ready():
            missing = "the reset service"
        if missing:
            self._report(missing)
        else:
            self._look.cancel()
            self._on_ready()

    def _on_reply(self, future: Future) -> None:
        if self._asked is None or future is not self._asked:
            return
        reply = future.result()
        self._asked = None
        self._look.cancel()
        if not reply.success:
            self._wait_again(reply.message)
            return
        try:
            start = yaml_model(reply.message, EpisodeStart, name="response of reset")
        except FileError as error:
            self._wait_again(str(error))
            return
        self.begin(start)

    def _wait_again(self, reason: str) -> None:
        self._report(reason)
        self._look_again()

    def _look_again(self) -> None:
        self._asked = None
        self._look.reset()

    def _report(self, missing: str) -> None:
        if missing != self._waited_for:
            self._waited_for = missing
            self._on_wait(missing)


class PersonEpisodes:
    """Starts, ends and counts them. config: of teleop_page.

    notify: called with one sentence for the person about everything that happens.
    on_end: called when an episode of this driver ends or is discarded.
    """

    def __init__(
        self,
        endpoints: Endpoints,
        scenario: Scenario,
        config: Any,
        *,
        notify: Callable[[str], None],
        on_end: Callable[[], None],
    ) -> None:
        self._scenario, self._timeout_s, self._driver = scenario, config.timeout_s, config.driver
        self._notify, self._on_end = notify, on_end
        self.begin_session()
        self._starter = EpisodeStarter(
            endpoints, config.required_nodes, on_start=self._on_start,
            on_ready=lambda: self._starter.reset_world(),
            on_wait=lambda missing: notify(f"the episode waits for {missing}"),
        )  # fmt: skip
        endpoints.subscribe(DiagnosticArray, topics.EPISODE, self._on_mark, qos.STATE)

    @property
    def number(self) -> int | None:
        """The number of this driver's latest episode, None before the first."""
        return None if self._starter.episode is None else self._starter.episode.episode

    @property
    def is_running(self) -> bool:
        """Whether an episode of this driver is running."""
        return self.session.phase == "running"

    @property
    def other_driver(self) -> str:
        """The other driver whose episode is running, empty for none."""
        running = self.tally.running
        return running.driver if running is not None and running.episode != self.number else ""

    def start(self) -> None:
        """Start when all required nodes subscribe; TeleopError where an episode is running."""
        if self.other_driver:
            raise TeleopError(f"an episode of {self.other_driver} is running; end it there first")
        self.session.start()
        self._starter.wait()

    def begin_session(self) -> None:
        """Discard the episode and the counts; nothing is published."""
        self.session = Session(self._scenario, self._timeout_s)
        self.tally = EpisodeTally()
        self.n_decisions = 0

    def save(self) -> None:
        """End the running episode and keep it."""
        event = self.session.save()
        if event is not None:
            self._publish(event)

    def discard(self) -> None:
        """Discard the running or the last episode."""
        self._publish(self.session.discard())

    def see(self, observation: Observation) -> None:
        """Follow the episode."""
        for event in self.session.observe(observation):
            self._publish(event)

    def _on_start(self, episode: EpisodeStart) -> None:
        self.n_decisions = 0
        self.session.world_reset(episode.start_s)

    def _publish(self, event: EpisodeEvent) -> None:
        self._starter.mark(event.event, event.time_s, self._driver, outcome=event.outcome)
        if event.event == END:
            self._on_end()

    def _on_mark(self, message: DiagnosticArray) -> None:
        mark = from_episode_message(message)
        self.tally.add(mark)
        if mark.event == END:
            own = mark.episode == self.number
            took = f" after {self.session.duration_s:.1f} s" if own else ""
            late = " for it timed out (save keeps it)" if own and self.session.timed_out else ""
            self._notify(f"episode {mark.episode} {mark.outcome}{took}{late}; so far {self.tally}")
        else:
            self._notify(f"episode {mark.episode} of {mark.driver} has begun")
