"""Starts episodes: waits for the graph, has the world reset and publishes the marks.

Nothing sleeps: a timer looks whether the required nodes subscribe to all they need, so that neither
the recorder nor the planner misses the beginning of an episode.
"""

from collections.abc import Callable, Sequence

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.task import Future
from std_srvs.srv import Trigger

from serd_app.drives.episode_spans import EpisodeMark
from serd_bag.errors import FileError
from serd_files.yaml_config import yaml_model
from serd_ros.convert.diagnostics import to_episode_message
from serd_ros.endpoints import qos, topics
from serd_ros.endpoints.endpoints import Endpoints
from serd_ros.endpoints.world.worlds import WORLD_TOPICS, several_worlds
from serd_ros.graph.readiness import Readiness
from serd_sim.episodes.episode import EpisodeStart

_LOOK_AGAIN_S = 0.05
#: The middleware loses the response of a server that has not found its client's reader yet.
_ASK_AGAIN_S = 30.0


class EpisodeStarter:
    """on_ready: called when an episode may begin; on_start: with each episode that the world
    begins; on_wait: with what is missing, when it changes. needs_reset: whether the world is reset;
    world_topics: those that must not have several publishers.
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
    ) -> None:
        self.episode: EpisodeStart | None = None
        node = self._node = endpoints.node
        self._needs_reset, self._world_topics = needs_reset, world_topics
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
        """Whether it waits for the graph."""
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
        missing = several or self._readiness.missing(self._node.wall_s())
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
