"""demo_recorder: writes topics as they come into a rosbag2 MCAP bag, as a ROS 2 node.

The log time of a message is when it was received, its publish time when it was published. Where
`use_sim_time` is true, or /clock has a publisher when the first message of a recording comes, both
are simulated time instead (`bags/serd_bag/messages/times.py`).
"""

import re
import sys
import time
from collections.abc import Iterable
from functools import partial
from itertools import count
from pathlib import Path

from std_srvs.srv import Trigger

from serd_bag.errors import BagError
from serd_bag.formats.rosbag2.qos import QosProfile
from serd_bag.messages.plain import message_stamp_ns
from serd_bag.messages.times import RecordingClock
from serd_bag.recorder import BagRecorder, LastSeconds, RecorderSettings
from serd_files.settings import setting, setting_of
from serd_ros.convert.diagnostics import ERROR, OK, WARN
from serd_ros.convert.stamp import require_time
from serd_ros.endpoints import topics
from serd_ros.endpoints.followed_topic import FollowedTopic, Received
from serd_ros.endpoints.qos import bag_qos, is_latched
from serd_ros.endpoints.topic_types import TopicType, named_topic
from serd_ros.errors import MessageError, NodeError
from serd_ros.process.serd_node import Activate, Activity, Endpoints, SerdNode
from serd_ros.settings import ManagedConfig, StackConfig

_POLL_PERIOD_S = 0.1
_REPORT_PERIOD_S = 1.0
#: At its end it takes messages until no more come, at most for the product of these.
_LAST_LOOKS, _LOOK_AGAIN_S = 20, 0.05
_RECORDED = (
    topics.CLOCK, topics.ODOM, topics.ROBOT_POSE, topics.SCAN, topics.PEDESTRIANS, topics.MAP,
    topics.CMD_VEL, topics.INTENT, topics.WAYPOINT, topics.EPISODE,
)  # fmt: skip


#: What no name of a topic has.
_EXPRESSION = re.compile(r"[^\w/:~{}]")
Expression = re.Pattern[str]


class DemoRecorderConfig(ManagedConfig):
    """Parameters of demo_recorder."""

    output: str = setting("recording", "folder of the bag; must not exist", min_length=1)
    topics: tuple[str, ...] = setting(
        _RECORDED,
        'topics of this stack, or any other as "/imu:sensor_msgs/msg/Imu" (in quotes), which is'
        " recorded from its first publisher on, with the quality of service of its publishers; or"
        ' regular expressions of whole names, as "/.*" for all topics',
        min_length=1,
    )
    without: tuple[str, ...] = setting(
        ("",), "regular expressions of whole names that none of the other expressions adds"
    )
    stamped_cmd_vel: bool = setting_of(StackConfig, "stamped_cmd_vel")
    record_at_start: bool = setting(True, "record at once, without start_recording")
    minimum_free_mb: float = setting(100.0, "end when less disk is free", unit="MB", ge=0)
    snapshot_s: float = setting(
        0.0,
        "keep messages so long in memory, recorded or not, for save_snapshot; 0: none",
        unit="s",
        ge=0,
    )
    snapshot_mb: float = setting(100.0, "memory for these, at most", unit="MB", gt=0)


def _compiled(expressions: Iterable[str]) -> list[Expression]:
    try:
        return [re.compile(each) for each in expressions]
    except re.error as error:
        rule = f"topics must be names or regular expressions, got {error.pattern!r} ({error})"
        raise NodeError(f"{rule}; correct it") from None


def _described(topic: FollowedTopic) -> tuple[str, str, tuple[QosProfile, ...]]:
    """Name, type and quality of service."""
    return topic.name, topic.kind.name, tuple(dict.fromkeys(map(bag_qos, topic.offered)))


class DemoRecorderNode(SerdNode[DemoRecorderConfig]):
    """Records while it is active."""

    config_class = DemoRecorderConfig

    def __init__(self, kind: str) -> None:
        #: The bags of this process.
        self._bags: list[Path] = []
        super().__init__(kind)

    def configure(self) -> Activate:
        """Look up the types of the topics, by their full names."""
        kinds: dict[str, TopicType] = {}
        expressions = [text for text in self.config.topics if _EXPRESSION.search(text)]
        for text in self.config.topics:
            if text in expressions:
                continue
            topic, kind = named_topic(text, stamped_cmd_vel=self.config.stamped_cmd_vel)
            name = self.resolve_topic_name(topic)
            if name in kinds:
                rule = f"topics must name each topic once, got {name} twice"
                raise NodeError(f"{rule}; leave one out")
            kinds[name] = kind
        chosen = _compiled(expressions), _compiled(self.config.without)
        return partial(Recording, kinds, chosen, self._bags)


class Recording(Activity):
    """Subscribes raw and records into `output`, `output-2`, ...; services begin and end a bag."""

    def __init__(
        self,
        kinds: dict[str, TopicType],
        chosen: tuple[list[Expression], list[Expression]],
        bags: list[Path],
        endpoints: Endpoints,
    ) -> None:
        self._endpoints, (self._wanted, self._left_out) = endpoints, chosen
        self._node, self._config, self._bags = endpoints.node, endpoints.node.config, bags
        self._clock_topic = self._node.resolve_topic_name(topics.CLOCK)
        self._recording_clock: RecordingClock | None = None
        self._topics = {
            name: FollowedTopic(endpoints, name, kind, self._take) for name, kind in kinds.items()
        }
        self._recorder: BagRecorder | None = None
        self._last: LastSeconds | None = None
        if self._config.snapshot_s:
            most_bytes = round(self._config.snapshot_mb * 1e6)
            self._last = LastSeconds(self._config.snapshot_s, most_bytes)
        endpoints.serve(Trigger, topics.START_RECORDING, self._on_start)
        endpoints.serve(Trigger, topics.STOP_RECORDING, self._on_stop)
        for name, paused in ((topics.PAUSE_RECORDING, True), (topics.RESUME_RECORDING, False)):
            endpoints.serve(Trigger, name, partial(self._on_pause, paused=paused))
        endpoints.serve(Trigger, topics.SAVE_SNAPSHOT, self._on_snapshot)
        if self._config.record_at_start:
            self._start()
        endpoints.every(_POLL_PERIOD_S, self._poll)
        endpoints.every(_REPORT_PERIOD_S, self._report)

    def close(self) -> None:
        """Finish the bag, with all that has come in."""
        for _ in range(_LAST_LOOKS):
            recorded = self._record_what_waits()
            time.sleep(_LOOK_AGAIN_S)  # the middleware may still be receiving
            if not recorded and not self._record_what_waits():
                break
        self._finish_bag()

    def _record_what_waits(self) -> bool:
        """Whether anything did; in the order of receipt, as it would have been recorded."""
        waiting = [each for topic in self._topics.values() for each in topic.waiting()]
        for each in sorted(waiting, key=lambda each: each.received_ns):
            self._topics[each.topic].take(each)
        return bool(waiting)

    def _finish_bag(self) -> None:
        recorder, self._recorder = self._recorder, None
        if recorder is not None:
            status = recorder.close()
            # Not the logger: its topic is gone once the process has received a signal.
            summary = f"demo_recorder: {status.n_messages} messages in {recorder.directory}"
            print("; ".join([summary, *self._silences()]), file=sys.stderr, flush=True)

    def _silences(self) -> list[str]:
        return [topic.silence for topic in self._topics.values() if topic.silence]

    def _take(self, message: Received) -> None:
        name = message.topic
        try:
            stamp_ns = message_stamp_ns(message.data) if self._topics[name].stamped else 0
        except BagError as error:
            raise MessageError("message must begin with a stamp", error, "correct it") from None
        if name == self._clock_topic:
            require_time(stamp_ns)
        if self._recording_clock is None:
            self._recording_clock = RecordingClock(simulated=self._is_simulated(name))
        times_ns = self._recording_clock.times_ns(
            stamp_ns, message.received_ns, message.sent_ns, is_clock=name == self._clock_topic
        )
        if self._last is not None:
            lasting = any(map(is_latched, self._topics[name].offered))
            self._last.take(name, message.data, *times_ns, lasting=lasting)
        recorder = self._recorder
        if recorder is not None and not recorder.record(name, message.data, *times_ns):
            self._end_with_the_problem(recorder)

    def _is_simulated(self, first_topic: str) -> bool:
        """Whether there is a /clock; its publisher is known before any message of a world."""
        node, clock = self._node, self._clock_topic
        expected = bool(node.get_parameter("use_sim_time").value)
        return expected or first_topic == clock or node.count_publishers(clock) > 0

    def _poll(self) -> None:
        self._look_at([topic for topic in self._topics.values() if not topic.is_subscribed])
        if self._recorder is not None:
            self._recorder.poll()
            if not self._recorder.status.recording:
                self._end_with_the_problem(self._recorder)

    def _find(self) -> None:
        """Follow the topics that have come and match an expression."""
        if not self._wanted:
            return
        for name, types in self._node.get_topic_names_and_types():
            chosen, others = (
                any(each.fullmatch(name) for each in some)
                for some in (self._wanted, self._left_out)
            )
            if not chosen or others or name in self._topics or len(types) > 1:
                continue
            try:
                kind = TopicType(types[0])
                self._topics[name] = FollowedTopic(self._endpoints, name, kind, self._take)
            except (BagError, NodeError) as error:
                self._left_out.append(re.compile(re.escape(name)))
                self._node.get_logger().warning(f"{name} is not recorded: {error}")

    def _look_at(self, followed: Iterable[FollowedTopic]) -> None:
        for topic in followed:
            if topic.look() and self._recorder is not None:
                self._recorder.add_topic(*_described(topic))

    def _end_with_the_problem(self, recorder: BagRecorder) -> None:
        """The bag is kept and closed; the process ends, and with it the stack and the drive."""
        self._report()
        self._finish_bag()
        self._node.fail(recorder.status.problem)

    def _start(self) -> Path:
        """Begin a bag; where messages had no /clock before, there may be one now."""
        settings = RecorderSettings(min_free_bytes=round(self._config.minimum_free_mb * 1e6))
        output = folder = Path(self._config.output)
        numbers = count(2)
        while self._bags and folder.exists():
            folder = output.with_name(f"{output.name}-{next(numbers)}")
        self._recorder = BagRecorder(folder, settings=settings)
        self._bags.append(folder)
        if self._recording_clock is not None and not self._recording_clock.simulated:
            self._recording_clock = None
        for description in self._known_topics():
            self._recorder.add_topic(*description)
        return folder

    def _known_topics(self) -> list[tuple[str, str, tuple[QosProfile, ...]]]:
        return [_described(topic) for topic in self._topics.values() if topic.is_subscribed]

    def _on_start(self, _: Trigger.Request) -> str:
        if self._recorder is not None:
            raise NodeError(f"recording into {self._recorder.directory}")
        self._record_what_waits()
        return f"recording into {self._start()}"

    def _present(self) -> BagRecorder:
        """The recorder, once it has what came in before the call."""
        self._record_what_waits()
        if self._recorder is None:
            raise NodeError("nothing is being recorded")
        return self._recorder

    def _on_stop(self, _: Trigger.Request) -> str:
        recorder = self._present()
        self._finish_bag()
        if recorder.status.problem:
            raise NodeError(recorder.status.problem)
        return f"{recorder.status.n_messages} messages in {recorder.directory}"

    def _on_pause(self, _: Trigger.Request, *, paused: bool) -> str:
        recorder = self._present()
        recorder.paused = paused
        return f"{'paused' if paused else 'recording into'} {recorder.directory}"

    def _on_snapshot(self, _: Trigger.Request) -> str:
        if self._last is None:
            raise NodeError("snapshot_s must be above 0 to save snapshots, got 0; set it")
        self._record_what_waits()
        output = Path(self._config.output)
        names = (output.with_name(f"{output.name}-snapshot-{number}") for number in count(1))
        folder = next(name for name in names if not name.exists())
        return f"{self._last.save(folder, self._known_topics())} messages in {folder}"

    def _report(self) -> None:
        self._find()
        self._look_at(self._topics.values())
        if self._recorder is None:
            return
        status, silences = self._recorder.status, "; ".join(self._silences())
        values = {
            "recording": status.recording and not self._recorder.paused,
            "messages": status.n_messages,
            "lost": sum(topic.n_lost for topic in self._topics.values()),
            "episodes": status.episodes_ended - status.outcomes.get("discarded", 0),
            "bag_mb": status.size_bytes / 1e6,
            "free_mb": status.free_bytes / 1e6,
        }
        clock = self._recording_clock
        time_s = 0.0 if clock is None else clock.now_ns * 1e-9
        level = ERROR if not status.recording else WARN if silences else OK
        self._node.report(time_s, values, level=level, message=status.problem or silences)
