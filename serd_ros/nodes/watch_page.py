"""watch_page: shows any running stack on a web page and drives nothing, as a ROS 2 node."""

import math
from collections.abc import Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from functools import partial
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from std_msgs.msg import String

from serd_app.drives.drive import START, EpisodeMark
from serd_app.teleop.page.server import PageAccess, PageServer, read_token
from serd_app.teleop.page.view import (
    overlay_of,
    point,
    watched_scene_of,
    world_state,
)
from serd_app.teleop.session import EpisodeTally
from serd_core.grid.grid import Grid
from serd_files.model_file import ModelFile
from serd_files.yaml_config import yaml_model
from serd_ros.convert import motion
from serd_ros.convert.diagnostics import from_episode_message, from_learner_report, values_of
from serd_ros.convert.sensors import from_people_message, from_scan
from serd_ros.convert.typed import from_guard_state
from serd_ros.endpoints import qos, topics
from serd_ros.endpoints.episodes import PersonEpisodes
from serd_ros.endpoints.topic_types import topic_type
from serd_ros.process.progress import report_address
from serd_ros.process.serd_node import Endpoints, SerdNode
from serd_ros.settings import WatchPageConfig
from serd_sim.drivers.strategy import load_strategy
from serd_sim.scenario.grid import grid_of
from serd_sim.scenario.scenario import Scenario, load_scenario
from serd_sim.world.observation import NO_PEOPLE, Observation, Pose
from serd_sim.world.waypoint import Waypoint, waypoint_of_intent

_PERIOD_S = 0.05


class WatchPageNode(SerdNode[WatchPageConfig]):
    """Sends what the topics have to all open pages, twenty times a second."""

    config_class = WatchPageConfig

    def __init__(self, kind: str) -> None:
        super().__init__(kind)
        scenario = load_scenario(self.config.scenario)
        self._view = WatchView(scenario)
        self._view.subscribe(self.endpoints)
        scene = watched_scene_of(scenario, self._view.grid)
        self._server = serve_page(self, scene, scenario)
        self.endpoints.every(_PERIOD_S, self._show)

    def _show(self) -> None:
        self._server.take()  # a page that only watches has nothing to request
        self._server.show(self._view.watched_state(self.wall_s()))


_SHOWN, _TYPED = ("teleop_mux", "demo_recorder"), (topics.GUARD_STATE,)
_STALE_S = 1.0
_NAME = "model of the learner"


class PageView:
    """Composes the state from the messages of topics."""

    #: The topics that are shown.
    topics: ClassVar[tuple[str, ...]] = (
        topics.SCAN, topics.INTENT, topics.WAYPOINT, topics.DIAGNOSTICS, topics.GUARD_STATE,
    )  # fmt: skip

    def __init__(self, scenario: Scenario) -> None:
        self.grid: Grid = grid_of(scenario)
        self._scenario = scenario
        self._observation: Observation | None = None
        self._shown: Observation | None = None
        self._seen_wall_s = -math.inf
        self._ranges: NDArray[np.float32] | None = None
        self._waypoint: Waypoint | None = None
        self._health: dict[str, dict[str, str]] = {}
        self.guard: dict[str, str] | None = None
        self._next_start: tuple[float, float] | None = None

    def subscribe(self, endpoints: Endpoints) -> None:
        """Take the messages that a node receives on the topics."""
        for topic in self.topics:
            kind, take = topic_type(topic, stamped_cmd_vel=False), partial(self.take, topic)
            subscribe = endpoints.subscribe_raw if topic in _TYPED else endpoints.subscribe
            subscribe(kind.message, topic, take, kind.qos)

    def take(self, topic: str, message: Any) -> None:
        """Take a message of one of the topics; MessageError where it breaks a rule."""
        if topic == topics.SCAN:
            _, self._ranges = from_scan(message, self._scenario.lidar)
        elif topic == topics.INTENT:
            _, action = motion.from_intent(message)
            if self._observation is not None:
                self._waypoint = waypoint_of_intent(self._scenario.cells, self._observation, action)
        elif topic == topics.WAYPOINT:
            _, self._waypoint, _ = motion.from_waypoint_message(message)
        elif topic == topics.GUARD_STATE:
            self.guard = from_guard_state(message)
        elif topic == topics.DIAGNOSTICS:
            for name in _SHOWN:
                if (values := values_of(message, name)) is not None:
                    self._health[name] = values
            if "converged" in (values_of(message, "learner") or {}):  # a fit has ended
                self._next_start = from_learner_report(message)

    def state(
        self, observation: Observation | None, episode: Mapping[str, Any], wall_s: float
    ) -> dict[str, Any]:
        """Everything the page needs to draw itself."""
        self._observation = observation
        if observation is not self._shown:
            self._shown, self._seen_wall_s = observation, wall_s
        ranges, self._ranges = self._ranges, None
        world = None if observation is None else world_state(observation, ranges)
        return {
            "type": "state",
            "world": world,
            "is_stale": observation is None or wall_s - self._seen_wall_s > _STALE_S,
            "waypoint": point(self._waypoint),
            "episode": episode,
            "mux": self._health.get("teleop_mux"),
            "guard": self.guard,
            "recorder": self._health.get("demo_recorder"),
            "next_start": self._next_start,
        }

    def clear(self) -> None:
        """Discard what was received before a jump of the clock."""
        self._ranges, self._waypoint = None, None


class WatchView(PageView):
    """The state of a world that others drive, by the newest message of each topic."""

    topics: ClassVar[tuple[str, ...]] = (
        *PageView.topics, topics.ROBOT_POSE, topics.ODOM, topics.PEDESTRIANS, topics.EPISODE,
    )  # fmt: skip

    def __init__(self, scenario: Scenario) -> None:
        super().__init__(scenario)
        self._people, self._speeds = NO_PEOPLE, (0.0, 0.0)
        self._mark: EpisodeMark | None = None
        self._began_s = self._ended_s = 0.0
        self._tally = EpisodeTally()
        self._n_decisions = 0

    def take(self, topic: str, message: Any) -> None:
        """Take a message of one of the topics; MessageError where it breaks a rule."""
        super().take(topic, message)
        if topic == topics.ROBOT_POSE:
            self._observation = self._observed(*motion.from_pose_stamped(message))
        elif topic == topics.ODOM:
            _, _, self._speeds = motion.from_odometry(message)
        elif topic == topics.PEDESTRIANS:
            _, self._people = from_people_message(message)
        elif topic == topics.EPISODE:
            mark = self._mark = from_episode_message(message)
            self._tally.add(mark)
            if mark.event == START:
                self._began_s, self._n_decisions = mark.time_s, 0
            else:
                self._ended_s = mark.time_s
        elif topic == topics.INTENT:
            self._n_decisions += 1

    def watched_state(self, wall_s: float) -> dict[str, Any]:
        """What the page draws, without a driver."""
        state = self.state(self._observation, self._episode_values(), wall_s)
        return {**state, "page": 0, "there": False, "mode": "", "choice": "wait"}

    def _observed(self, time_ns: int, pose: Pose) -> Observation:
        time_s = time_ns * 1e-9
        return Observation(
            time_s=time_s,
            tick=round(time_s / self._scenario.control_period_s),
            pose=pose,
            speed_mps=self._speeds[0],
            yaw_rate_radps=self._speeds[1],
            people_position_m=self._people.position_m,
            people_velocity_mps=self._people.velocity_mps,
            people_id=self._people.identity,
        )

    def _episode_values(self) -> dict[str, Any]:
        mark, is_running = self._mark, self._tally.running is not None
        now_s = self._observation.time_s if self._observation is not None else self._began_s
        until_s = now_s if is_running else self._ended_s
        return {
            "phase": "idle" if mark is None else "running" if is_running else "ended",
            "number": None if mark is None else mark.episode,
            "outcome": "" if mark is None else mark.outcome,
            "duration_s": round(max(0.0, until_s - self._began_s), 1),
            "decisions": self._n_decisions,
            "other_driver": mark.driver if mark is not None and is_running else "",
            **_counts(self._tally),
        }


def episode_values(episodes: PersonEpisodes) -> dict[str, Any]:
    """The episode of the person at the page, and the counts of all."""
    session = episodes.session
    return {
        "phase": "starting" if session.is_starting else session.phase,
        "number": episodes.number,
        "outcome": session.outcome,
        "duration_s": round(session.duration_s, 1),
        "decisions": episodes.n_decisions,
        "other_driver": episodes.other_driver,
        **_counts(episodes.tally),
    }


def _counts(tally: EpisodeTally) -> dict[str, int]:
    return {"kept": tally.kept, "arrived": tally.arrived, "discarded": tally.discarded}


class LearnedOverlay:
    """The newest model of a learner as layers of the page, solved in a thread beside the node."""

    def __init__(self, endpoints: Endpoints, scenario: Scenario, server: PageServer) -> None:
        self._node, self._scenario, self._server = endpoints.node, scenario, server
        self._pool = ThreadPoolExecutor(max_workers=1, thread_name_prefix="overlay")
        self.newest: Future[None] | None = None
        endpoints.subscribe(String, topics.MODEL, self._take, qos.LATCHED)

    def close(self) -> None:
        """Wait for the model that is being solved."""
        self._pool.shutdown(cancel_futures=True)

    def _take(self, message: String) -> None:
        """Of models that wait only the newest is solved."""
        if self.newest is not None:
            self.newest.cancel()
        self.newest = self._pool.submit(self._show, message.data)

    def _show(self, text: str) -> None:
        try:
            file = yaml_model(text, ModelFile, name=_NAME)
            strategy = load_strategy(_NAME, self._scenario, "optimal", file=file)
            self._server.show_overlay(overlay_of(strategy))
        except Exception as error:
            self._node.get_logger().warning(f"no overlay: {error}")


def serve_page(node: SerdNode[Any], scene: Mapping[str, Any], scenario: Scenario) -> PageServer:
    """The server of a node's page with the layers of a learned model, closed with the node."""
    config = node.config
    access = PageAccess(config.address, read_token(config.token_file))
    server = PageServer(scene, access, config.port)
    overlay = LearnedOverlay(node.endpoints, scenario, server)
    node.at_end.callback(server.close)
    node.at_end.callback(overlay.close)
    report_address(server.url, node.get_logger().info)
    return server
