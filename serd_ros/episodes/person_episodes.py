"""Episodes of a person: resets the world, publishes marks, counts the episodes of all drivers."""

from collections.abc import Callable
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray

from serd_app.drives.episode_spans import END
from serd_app.errors import TeleopError
from serd_app.teleop.session import EpisodeEvent, EpisodeTally, Session
from serd_ros.convert.diagnostics import from_episode_message
from serd_ros.endpoints import qos, topics
from serd_ros.endpoints.endpoints import Endpoints
from serd_ros.episodes.starter import EpisodeStarter
from serd_sim.episodes.episode import EpisodeStart
from serd_sim.scenario.scenario import Scenario
from serd_sim.world.observation import Observation


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
