"""bag_replay: plays a bag into its topics, as a ROS 2 node.

A learner, a recorder or a viewer subscribes as to the recorded world. Bag time is that of the log
times; a recorded /clock is played as any other topic. The log times of what was published follow on
`replayed`, by topic.
"""

import math
from collections import Counter, defaultdict
from collections.abc import Iterable

from rclpy.duration import Duration
from rclpy.publisher import Publisher

from serd_bag.formats.rosbag2.message_types import resolve_type_if_known
from serd_bag.formats.rosbag2.qos import profile_to_offer
from serd_bag.reader import BagReader
from serd_bag.topic import CDR, RawMessage, Topic, selected_topics
from serd_ros.convert.diagnostics import ERROR, OK
from serd_ros.convert.typed import to_replayed
from serd_ros.endpoints import qos, topics
from serd_ros.endpoints.topic_types import TYPES, message_class
from serd_ros.errors import NodeError
from serd_ros.graph.graph import Readiness
from serd_ros.process.playback import Playback, excerpt
from serd_ros.process.serd_node import SerdNode
from serd_ros.settings import BagReplayConfig

_TURN_S = 0.005
_AT_ONCE = 200
_REPORT_PERIOD_S = 0.5
#: The longest wait (s) for a subscriber where no node is required.
_WAIT_S = 10.0
#: Who subscribes to what it finds published has done so when nobody else has for so long (s).
_SETTLED_S = 1.0
_CONFIRMED_WITHIN = Duration(seconds=10.0)
_UNCONFIRMED_AT_MOST = qos.STATE_DEPTH // 2


class BagReplayNode(SerdNode[BagReplayConfig]):
    """Waits for subscribers, then publishes every message at its time."""

    config_class = BagReplayConfig

    def __init__(self, kind: str) -> None:
        super().__init__(kind)
        config, endpoints, now_s = self.config, self.endpoints, self.wall_s()
        self._reader = BagReader(config.bag)
        kinds = self._reader.topics
        wanted = selected_topics(kinds, [name for name in config.topics if name])
        self._outlets = self._outlets_of([kinds[name] for name in wanted])
        self._n_unconfirmed = Counter[str]()
        replayed = TYPES[topics.REPLAYED]
        self._replayed = endpoints.publisher(replayed.message, topics.REPLAYED, qos.STATE)
        self._log_times: defaultdict[str, list[int]] = defaultdict(list)
        self._n_subscriptions, self._settling_since_s = 0, now_s
        self._n_sent = 0
        self._readiness = Readiness(self, config.required_nodes, now_s)
        self._waiting_until_s: float | None = now_s + _WAIT_S
        self._playback = self._from_the_beginning()
        self._turns = endpoints.every(_TURN_S, self._turn)
        endpoints.every(_REPORT_PERIOD_S, self._report_playback)

    def _outlets_of(self, known: Iterable[Topic]) -> dict[str, Publisher]:
        """By topic, for those that can be played."""
        found, skipped = dict[str, Publisher](), set[str]()
        for topic in known:
            message = message_class(resolve_type_if_known(topic.message_type))
            if message is not None and topic.encoding == CDR:
                profile = qos.replay_qos(profile_to_offer(topic.qos))
                found[topic.name] = self.endpoints.publisher(message, topic.name, profile)
                continue
            skipped.add(topic.type_name)
            text = f"{topic.name} is not played: {topic.type_name} is not in CDR or not installed"
            self.get_logger().warning(text)
        if not found:
            types = ", ".join(sorted(skipped)) or "nothing"
            raise NodeError(f"bag must hold a topic of messages in CDR, got {types}")
        return found

    def _publish(self, message: RawMessage) -> None:
        """Send it; at times wait for reliable readers, so that none is overrun."""
        topic = message.topic
        self._outlets[topic].publish(message.data)
        self._log_times[topic].append(message.log_time_ns)
        self._n_unconfirmed[topic] += 1
        if self._n_unconfirmed[topic] >= _UNCONFIRMED_AT_MOST:
            self._confirm(topic)

    def _confirm(self, topic: str) -> None:
        self._n_unconfirmed[topic] = 0
        publisher = self._outlets[topic]
        if qos.is_reliable(publisher.qos_profile):
            publisher.wait_for_all_acked(_CONFIRMED_WITHIN)

    def _from_the_beginning(self) -> Playback:
        config, played = self.config, frozenset(self._outlets)
        duration_s = config.duration_s or math.inf
        messages = excerpt(self._reader, played, config.start_s, duration_s)
        playback = Playback(messages, rate=config.rate)
        if playback.damage:
            raise NodeError(playback.damage)
        if playback.finished:
            raise NodeError(
                f"bag {config.bag} must hold a message to play, got none from"
                f" {config.start_s:g} s on; begin earlier, play longer or other topics"
            )
        return playback

    def _turn(self) -> None:
        if self._waiting_until_s is not None and not self._has_subscribers():
            return
        messages = self._playback.due(self.wall_s(), at_most=_AT_ONCE)
        for message in messages:
            self._publish(message)
        self._n_sent += len(messages)
        self._publish_log_times()
        if self._playback.finished:
            self._end()

    def _publish_log_times(self) -> None:
        if self._replayed.get_subscription_count():
            for topic, log_times_ns in self._log_times.items():
                self._replayed.publish(to_replayed(topic, log_times_ns))
        self._log_times.clear()

    def _has_settled(self, now_s: float) -> bool:
        """Whether the number of subscriptions has been the same for a while."""
        count = sum(each.get_subscription_count() for each in self._outlets.values())
        if count != self._n_subscriptions:
            self._n_subscriptions, self._settling_since_s = count, now_s
        return count > 0 and now_s - self._settling_since_s >= _SETTLED_S

    def _has_subscribers(self) -> bool:
        """Whether all required nodes subscribe, or without them any node, or the wait is over."""
        assert self._waiting_until_s is not None
        now_s = self.wall_s()
        missing = self._readiness.missing(now_s)
        required = any(self.config.required_nodes)
        settled, heard = self._has_settled(now_s), self._n_subscriptions > 0
        is_ready = not missing and (settled if required else heard)
        if is_ready or (not required and now_s >= self._waiting_until_s):
            self._waiting_until_s = None
            return True
        waited_for = missing or "a subscriber"
        self.get_logger().info(f"waiting for {waited_for}", throttle_duration_sec=2.0)
        return False

    def _report_playback(self) -> None:
        if self._waiting_until_s is not None:
            return
        playback = self._playback
        state = "finished" if playback.finished else "playing"
        time_s, damage = playback.bag_time_ns(self.wall_s()) * 1e-9, playback.damage
        values = {"messages": self._n_sent, "rate": self.config.rate, "bag": self.config.bag}
        self.report(time_s, values, level=ERROR if damage else OK, message=damage or state)

    def _end(self) -> None:
        """All sound messages have been played; a damaged bag ends the node with the damage."""
        damage = self._playback.damage
        if self.config.loop and not damage:
            self._playback = self._from_the_beginning()
            return
        self._turns.cancel()
        for topic in list(self._n_unconfirmed):
            self._confirm(topic)
        self._replayed.wait_for_all_acked(_CONFIRMED_WITHIN)
        self._report_playback()
        if damage:
            self.fail(damage)
            return
        self.get_logger().info(f"played {self._n_sent} messages of {self.config.bag}")
        if self.config.exit_when_done:
            self.finish(0)
