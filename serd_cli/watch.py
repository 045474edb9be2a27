"""A recording on the page that watches: played, paused and moved through on a time line.

Bag time is that of the log times. No node is started: the messages go to the page's view directly.
"""

import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.serialization import deserialize_message

from serd_app.drives.episode_spans import END, START, marks_of
from serd_app.navigation.overlay import overlay_of
from serd_app.navigation.strategy import load_strategy
from serd_app.teleop.page.requests import PageRequest, Replay
from serd_app.teleop.page.server import PageServer
from serd_app.teleop.page.view import overlay_message
from serd_bag.errors import BagError
from serd_bag.playback import Excerpt, Playback
from serd_bag.reader import BagReader
from serd_bag.topic import CDR, RawMessage, topics_named
from serd_cli.errors import UsageError
from serd_ros.convert.frames import Frames
from serd_ros.endpoints import topics
from serd_ros.endpoints.topic_types import topic_type
from serd_ros.episodes.page_view import WatchView
from serd_ros.errors import MessageError
from serd_ros.graph.graph import full_namespace
from serd_sim.scenario.scenario import Scenario

#: Before the time that is gone to, messages of this span (s) give what is shown there, beside all
#: those of the topics that have few.
_BEFORE_S = 1.0
_SPARSE = (topics.EPISODE, topics.INTENT, topics.WAYPOINT)
_PERIOD_S = 0.05
_DAMAGED: type[Exception] = rclpy_implementation.RMWError


class BagWatch:
    """What is readable of a bag, and the time of it that is shown.

    namespace: of the topics, "/" for topics without one; any where it is empty and each topic is
    in one only. frame_prefix: of the robot's frames. wall_s: any clock that never goes back.
    """

    def __init__(
        self,
        bag: Path,
        scenario: Scenario,
        rate: float = 1.0,
        *,
        namespace: str = "",
        frame_prefix: str = "",
    ) -> None:
        self._reader, self._scenario, self._rate = BagReader(bag, tolerant=True), scenario, rate
        self._frames = Frames(frame_prefix)
        before = f"{full_namespace(namespace)}/" if namespace else ""
        self._names = _shown_topics(self._reader, before)
        if topics.ROBOT_POSE not in self._names.values():
            raise UsageError(
                f"bag {bag} must hold {before}robot_pose as geometry_msgs/msg/PoseStamped, it holds"
                f" {', '.join(sorted(self._reader.topics)) or 'nothing'}; 'serd bag convert' copies"
                " a bag of ROS 1"
            )
        self._sparse: list[RawMessage] = []
        self._first_ns, self.duration_s = self._look_through()
        self.seek(0.0)

    @property
    def replay(self) -> dict[str, Any]:
        """What the page's time line is made of: its length, and episodes with their outcomes."""
        episodes: list[list[Any]] = []
        for message in self._sparse:
            if self._names[message.topic] != topics.EPISODE:
                continue
            at_s, marks = self._since_start_s(message), []
            with suppress(BagError):
                marks = marks_of(message.data)
            for mark in marks:
                if mark.event == START:
                    episodes.append([at_s, at_s, ""])
                elif mark.event == END and episodes:
                    episodes[-1][1:] = [at_s, mark.outcome]
        return {"duration_s": self.duration_s, "episodes": episodes}

    def seek(self, at_s: float) -> None:
        """Show this time, in seconds after the first message."""
        at_s = min(at_s, self.duration_s)
        self.view = WatchView(self._scenario)
        for message in self._sparse:
            if self._since_start_s(message) < at_s - _BEFORE_S:
                self._take(message)
        excerpt = Excerpt(frozenset(self._names), max(0.0, at_s - _BEFORE_S))
        later = self._after(excerpt.messages(self._reader), at_s)
        self._playback = Playback(later, rate=self._rate)

    def apply_request(self, request: PageRequest, wall_s: float) -> None:
        """Apply a request of the page; those of a driver have no effect."""
        if not isinstance(request, Replay):
            return
        if request.rate is not None:
            self._rate = request.rate
            self._playback.set_rate(wall_s, self._rate)
        if request.at_s is not None:
            was_paused = self._playback.paused
            self.seek(request.at_s)
            if was_paused:
                self._playback.pause(wall_s)
                if message := self._playback.step():
                    self._take(message)
        if request.playing is not None:
            (self._playback.resume if request.playing else self._playback.pause)(wall_s)

    def state(self, wall_s: float) -> dict[str, Any]:
        """What the page draws at a wall time."""
        for message in self._playback.due(wall_s):
            self._take(message)
        playback = self._playback
        at_s = (playback.bag_time_ns(wall_s) - self._first_ns) / 1e9
        replay = {
            "at_s": round(min(at_s, self.duration_s), 2),
            "rate": self._rate,
            "playing": not (playback.paused or playback.finished),
        }
        return {**self.view.watched_state(wall_s), "is_stale": False, "replay": replay}

    def _look_through(self) -> tuple[int, float]:
        """The first log time (ns) and the span (s); gathers sparse messages.

        An intent has the pose before it, from which the view derives its waypoint.
        """
        first_ns = last_ns = 0
        pose: RawMessage | None = None
        for message in self._reader.messages(self._names):
            first_ns = first_ns or message.log_time_ns
            last_ns = max(last_ns, message.log_time_ns)
            name = self._names[message.topic]
            if name == topics.ROBOT_POSE:
                pose = message
            elif name in _SPARSE:
                if name == topics.INTENT and pose is not None:
                    self._sparse.append(pose)
                self._sparse.append(message)
        return first_ns, (last_ns - first_ns) / 1e9

    def _after(self, messages: Iterator[RawMessage], at_s: float) -> Iterator[RawMessage]:
        """The messages from a time on; those before it go to the view."""
        for message in messages:
            if self._since_start_s(message) < at_s:
                self._take(message)
            else:
                yield message

    def _since_start_s(self, message: RawMessage) -> float:
        return (message.log_time_ns - self._first_ns) / 1e9

    def _take(self, message: RawMessage) -> None:
        name = self._names[message.topic]
        kind = topic_type(name, stamped_cmd_vel=False).message
        # A bad message is dropped, as nodes do.
        with suppress(MessageError, _DAMAGED):
            decoded = deserialize_message(message.data, kind)
            self._frames.remove_prefix(decoded)
            self.view.take(name, decoded)


def layers_of(model: Path, scenario: Scenario) -> dict[str, Any]:
    """What a page draws of a learned model: policy, arrival and dynamics toward the goal."""
    return overlay_message(overlay_of(load_strategy(str(model), scenario, "optimal")))


def serve_bag(watch: BagWatch, server: PageServer) -> None:
    """Show a bag until Ctrl-C."""
    while True:
        now_s = time.monotonic()
        for request in server.take():
            watch.apply_request(request, now_s)
        server.show(watch.state(now_s))
        time.sleep(_PERIOD_S)


def _shown_topics(reader: BagReader, before: str) -> dict[str, str]:
    """The names in WatchView of the topics that have their type in CDR, by full name.

    before: the names, the namespace in full with a slash at its end; any namespace where empty.
    """
    shown: dict[str, str] = {}
    for name in WatchView.topics:
        found = [
            full
            for full in topics_named(reader.topics, before + name)
            if reader.topics[full].encoding == CDR
            and reader.topics[full].type_name == topic_type(name, stamped_cmd_vel=False).name
        ]
        if len(found) > 1:
            raise UsageError(
                f"topic {name!r} must be one topic, the bag holds {', '.join(sorted(found))};"
                f" choose one, as by --namespace {min(found).removesuffix(name)}"
            )
        shown |= dict.fromkeys(found, name)
    return shown
