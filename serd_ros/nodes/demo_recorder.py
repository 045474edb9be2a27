"""demo_recorder: writes topics as they come into a rosbag2 MCAP bag, as a ROS 2 node.

The log time of a message is its own stamp, so that a bag of a world that ran many times faster than
real time plays back in the time of that world; a message without a stamp gets the newest one.
"""

import sys
from itertools import count
from pathlib import Path

from std_srvs.srv import Trigger

from bags.writer import BagWriter
from serd_ros import topics
from serd_ros.bag_topics import bag_qos, cdr_stamp_ns
from serd_ros.configs import DemoRecorderConfig
from serd_ros.convert.diagnostics import ERROR
from serd_ros.errors import NodeError
from serd_ros.run_node import run_node
from serd_ros.serd_node import SerdNode
from serd_ros.topic_types import TopicType, topic_type
from storage.errors import FileError

_FLUSH_PERIOD_S = 0.25
_REPORT_PERIOD_S = 1.0


class DemoRecorderNode(SerdNode[DemoRecorderConfig]):
    """Subscribes raw, writes, flushes; `start_recording` and `stop_recording` open and close."""

    def __init__(self) -> None:
        super().__init__("demo_recorder", DemoRecorderConfig)
        self._writer: BagWriter | None = None
        self._newest_ns = 0
        self._kinds: dict[str, TopicType] = {}
        for topic in self.config.topics:
            self._listen(topic)
        self.create_service(Trigger, topics.START_RECORDING, self._on_start)
        self.create_service(Trigger, topics.STOP_RECORDING, self._on_stop)
        self.create_timer(_FLUSH_PERIOD_S, self._flush, clock=self.wall_clock)
        self.create_timer(_REPORT_PERIOD_S, self._report, clock=self.wall_clock)
        if self.config.record_at_start:
            self._start()

    def close(self) -> None:
        """Finish the bag."""
        if self._writer is not None:
            self._writer.close()
            # Not the logger: its topic is gone once the process has been told to stop.
            said = f"{self._writer.n_messages} messages in {self._writer.directory}"
            print(f"demo_recorder: {said}", file=sys.stderr, flush=True)
            self._writer = None

    def _listen(self, topic: str) -> None:
        kind = topic_type(topic, stamped_cmd_vel=self.config.stamped_cmd_vel)
        name = self.resolve_topic_name(topic)
        self._kinds[name] = kind
        self.create_subscription(
            kind.message, topic, lambda data: self._take(name, kind, data), kind.qos, raw=True
        )

    def _take(self, name: str, kind: TopicType, data: bytes) -> None:
        if self._writer is None:
            return
        stamp_ns = cdr_stamp_ns(data) if kind.stamped else self._newest_ns
        self._newest_ns = max(self._newest_ns, stamp_ns)
        try:
            self._writer.write(name, data, stamp_ns)
        except FileError as error:
            self._give_up(error)

    def _flush(self) -> None:
        if self._writer is not None:
            try:
                self._writer.flush_if_due()
            except FileError as error:
                self._give_up(error)

    def _give_up(self, error: FileError) -> None:
        """Keep what is written, say so on diagnostics and end."""
        writer, self._writer = self._writer, None
        if writer is not None:
            writer.abandon()
        self.report(self._newest_ns * 1e-9, {"recording": False}, level=ERROR, message=str(error))
        raise NodeError(str(error)) from error

    def _start(self) -> None:
        self._writer = BagWriter(self._free_folder(), flush_period_s=_FLUSH_PERIOD_S)
        for name, kind in self._kinds.items():
            self._writer.add_topic(name, kind.name, (bag_qos(kind.qos),))

    def _free_folder(self) -> Path:
        """`output`, or `output-2`, ... for later recordings of this process."""
        output = Path(self.config.output)
        names = (output.with_name(f"{output.name}-{number}") for number in count(2))
        if not output.exists() or not any(output.iterdir()):
            return output
        if self._newest_ns == 0:
            raise NodeError(f"output {output} exists and is not empty; choose another folder")
        return next(name for name in names if not name.exists())

    def _on_start(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        response.success = self._writer is None
        if self._writer is None:
            self._start()
        assert self._writer is not None
        response.message = f"recording into {self._writer.directory}"
        return response

    def _on_stop(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        response.success = self._writer is not None
        response.message = "stopped" if self._writer is not None else "nothing is being recorded"
        self.close()
        return response

    def _report(self) -> None:
        if self._writer is not None:
            counts = {name.strip("/"): number for name, number in self._writer.counts.items()}
            self.report(self._newest_ns * 1e-9, {"recording": True, **counts})


def main() -> int:
    """Entry point of `ros2 run serd_ros demo_recorder`."""
    return run_node(DemoRecorderNode)


if __name__ == "__main__":
    sys.exit(main())
