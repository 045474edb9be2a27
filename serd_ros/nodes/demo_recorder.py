"""demo_recorder: writes topics as they come into a rosbag2 MCAP bag, as a ROS 2 node.

The log time of a message is its own stamp, so that a bag of a world that ran many times faster than
real time plays back in the time of that world; a message without a stamp gets that of /clock, or
where there is none the newest one, and before any that of the system.
"""

import sys
import time
from collections.abc import Iterable
from itertools import count
from pathlib import Path

from std_srvs.srv import Trigger

from bags.errors import BagError
from bags.messages.plain import message_stamp_ns
from bags.recorder import BagRecorder, RecorderSettings
from serd_core.errors import SerdError
from serd_ros.convert.diagnostics import ERROR, OK, WARN
from serd_ros.endpoints import topics
from serd_ros.endpoints.followed_topic import FollowedTopic
from serd_ros.endpoints.qos import bag_qos
from serd_ros.endpoints.topic_types import named_topic
from serd_ros.errors import MessageError, NodeError
from serd_ros.graph.configs import DemoRecorderConfig
from serd_ros.process.run_node import run_node
from serd_ros.process.serd_node import SerdNode

_POLL_PERIOD_S = 0.1
_REPORT_PERIOD_S = 1.0
#: At its end it takes messages until no more come, at most for the product of these.
_LAST_LOOKS, _LOOK_AGAIN_S = 20, 0.05


class DemoRecorderNode(SerdNode[DemoRecorderConfig]):
    """Subscribes raw and records; `start_recording` and `stop_recording` open and close bags."""

    def __init__(self) -> None:
        super().__init__("demo_recorder", DemoRecorderConfig)
        self._recorder: BagRecorder | None = None
        self._now_ns = 0
        self._n_bags = 0
        self._topics: dict[str, FollowedTopic] = {}
        for topic in self.config.topics:
            self._follow(topic)
        self.create_service(Trigger, topics.START_RECORDING, self._on_start)
        self.create_service(Trigger, topics.STOP_RECORDING, self._on_stop)
        self.create_timer(_POLL_PERIOD_S, self._poll, clock=self.wall_clock)
        self.create_timer(_REPORT_PERIOD_S, self._report, clock=self.wall_clock)
        if self.config.record_at_start:
            self._start()

    def close(self) -> None:
        """Finish the bag, with all that has come in."""
        for _ in range(_LAST_LOOKS):
            recorded = self._record_what_waits()
            time.sleep(_LOOK_AGAIN_S)  # the middleware may still be receiving
            if not recorded and not self._record_what_waits():
                break
        self._finish_bag()

    def _record_what_waits(self) -> bool:
        """Whether anything did; in the order of time, as it would have been recorded."""
        waiting = [
            (self._log_time_ns(name, data), name, data)
            for name, topic in self._topics.items()
            for data in topic.waiting()
        ]
        for time_ns, name, data in sorted(waiting, key=lambda each: each[0]):
            self._record(name, data, time_ns)
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

    def _follow(self, text: str) -> None:
        topic, kind = named_topic(text, stamped_cmd_vel=self.config.stamped_cmd_vel)
        name = self.resolve_topic_name(topic)
        if name in self._topics:
            raise NodeError(f"topics must name each topic once, got {name} twice; leave one out")
        self._topics[name] = FollowedTopic(self, name, kind, self._take)

    def _take(self, name: str, data: bytes) -> None:
        self._record(name, data, self._log_time_ns(name, data))

    def _record(self, name: str, data: bytes, time_ns: int) -> None:
        if self._recorder is not None and not self._recorder.record(name, data, time_ns):
            self._end_with_the_problem(self._recorder)

    def _log_time_ns(self, name: str, data: bytes) -> int:
        """Follows /clock also where it falls back, because the world was started again."""
        try:
            stamp_ns = message_stamp_ns(data) if self._topics[name].stamped else 0
        except BagError as error:
            raise MessageError("message must begin with a stamp", error, "correct it") from None
        if stamp_ns <= 0:
            return self._now_ns or self._ros_time_ns()
        self._now_ns = stamp_ns if name == topics.CLOCK else max(self._now_ns, stamp_ns)
        return stamp_ns

    def _ros_time_ns(self) -> int:
        """Before any stamp: a /clock, also an expected one, begins at 0; else the system's time."""
        simulated = topics.CLOCK in self._topics or self.count_publishers(topics.CLOCK)
        return 0 if simulated else time.time_ns()

    def _poll(self) -> None:
        self._look_at([topic for topic in self._topics.values() if not topic.is_subscribed])
        if self._recorder is not None:
            self._recorder.poll()
            if not self._recorder.status.recording:
                self._end_with_the_problem(self._recorder)

    def _look_at(self, followed: Iterable[FollowedTopic]) -> None:
        for topic in followed:
            if topic.look():
                self._declare(topic)

    def _declare(self, topic: FollowedTopic) -> None:
        if self._recorder is not None and topic.is_subscribed:
            offered = tuple(dict.fromkeys(map(bag_qos, topic.offered)))
            self._recorder.add_topic(topic.name, topic.kind.name, offered)

    def _end_with_the_problem(self, recorder: BagRecorder) -> None:
        """The bag is kept and closed; the process ends, and with it the stack and the drive."""
        self._report()
        self._finish_bag()
        self.fail(recorder.status.problem)

    def _start(self) -> None:
        settings = RecorderSettings(
            min_free_bytes=round(self.config.minimum_free_mb * 1e6),
            max_file_bytes=round(self.config.maximum_file_mb * 1e6) or None,
            compression=self.config.compression,
        )
        self._recorder = BagRecorder(self._free_folder(), settings=settings)
        self._n_bags += 1
        for topic in self._topics.values():
            self._declare(topic)

    def _free_folder(self) -> Path:
        """`output`, or `output-2`, ... for later recordings of this process."""
        output = Path(self.config.output)
        names = (output.with_name(f"{output.name}-{number}") for number in count(2))
        if not output.exists() or not self._n_bags:
            return output
        return next(name for name in names if not name.exists())

    def _on_start(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        response.success = self._recorder is None
        try:
            if self._recorder is None:
                self._start()
        except SerdError as error:
            response.success, response.message = False, str(error)
            return response
        assert self._recorder is not None
        response.message = f"recording into {self._recorder.directory}"
        return response

    def _on_stop(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        """What came in before the call is in the bag, in whatever order it is looked at."""
        recorder = self._recorder
        if recorder is None:
            response.success, response.message = False, "nothing is being recorded"
            return response
        self._record_what_waits()
        self._finish_bag()
        status = recorder.status
        response.success = not status.problem
        response.message = status.problem or f"{status.n_messages} messages in {recorder.directory}"
        return response

    def _report(self) -> None:
        self._look_at(self._topics.values())
        if self._recorder is None:
            return
        status, silences = self._recorder.status, "; ".join(self._silences())
        self.report(
            self._now_ns * 1e-9,
            {
                "recording": status.recording,
                "messages": status.n_messages,
                "episodes": status.episodes_ended,
                "bag_mb": status.size_bytes / 1e6,
                "free_mb": status.free_bytes / 1e6,
            },
            level=ERROR if not status.recording else WARN if silences else OK,
            message=status.problem or silences,
        )


def main() -> int:
    """Entry point of `ros2 run serd_ros demo_recorder`."""
    return run_node(DemoRecorderNode)


if __name__ == "__main__":
    sys.exit(main())
