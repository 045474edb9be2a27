"""Quality of service per topic.

No message may be lost in lock-step, so the state topics are reliable and deep: a recorder on a busy
machine may lag behind a world that runs many times faster than real time.
"""

from collections.abc import Iterable

from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

from serd_bag.formats.rosbag2.qos import QosProfile

STATE_DEPTH = 2000
COMMAND_DEPTH = 10


def _last(
    depth: int,
    *,
    reliable: bool = True,
    latched: bool = False,
    history: HistoryPolicy = HistoryPolicy.KEEP_LAST,
) -> QoSProfile:
    """Keeps the last messages; latched: for readers that come later too."""
    return QoSProfile(
        history=history,
        depth=depth,
        reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
    )


STATE = _last(STATE_DEPTH)
COMMAND = _last(COMMAND_DEPTH)
#: For readers of commands of which an older one must not wait behind a newer one.
NEWEST = _last(1)
CLOCK = _last(1, reliable=False)
#: What lidars publish with; it receives from reliable publishers too.
SENSOR = _last(COMMAND_DEPTH, reliable=False)
TF = _last(100)
LATCHED = _last(1, latched=True)
#: For readers that must not miss a message: a full one accepts no more, and a publisher that waits
#: for acknowledgements, as bag_replay does, waits for it. (With KEEP_LAST it drops the oldest.)
LOSSLESS = _last(0, history=HistoryPolicy.KEEP_ALL)


def is_reliable(profile: QoSProfile) -> bool:
    """Whether lost messages are sent again."""
    return bool(profile.reliability == ReliabilityPolicy.RELIABLE)


def is_latched(profile: QoSProfile) -> bool:
    """Whether subscribers that come later receive earlier messages."""
    return bool(profile.durability == DurabilityPolicy.TRANSIENT_LOCAL)


def bag_qos(profile: QoSProfile) -> QosProfile:
    """The profile as bags store it."""
    # DDS does not transmit the history of other processes.
    is_known = profile.history == HistoryPolicy.KEEP_LAST
    return QosProfile(
        reliability="reliable" if is_reliable(profile) else "best_effort",
        durability="transient_local" if is_latched(profile) else "volatile",
        history="keep_last" if is_known else "unknown",
        depth=int(profile.depth),
    )


def recording_qos(profile: QoSProfile) -> QoSProfile:
    """Profile of a recorder: as offered, and deep enough to lag behind for a while."""
    depth = max(profile.depth, STATE_DEPTH)
    return _last(depth, reliable=is_reliable(profile), latched=is_latched(profile))


def replay_qos(recorded: QosProfile) -> QoSProfile:
    """Profile of a replay: as recorded, and deep enough for bursts of reliable messages."""
    latched = recorded.durability == "transient_local"
    depth = recorded.depth if latched else max(recorded.depth, STATE_DEPTH)
    return _last(depth, reliable=recorded.reliability == "reliable", latched=latched)


def common_qos(offered: Iterable[QoSProfile]) -> QoSProfile:
    """The strictest profile that matches every one of the publishers."""
    profiles = tuple(offered)
    reliable, latched = all(map(is_reliable, profiles)), all(map(is_latched, profiles))
    return _last(STATE_DEPTH, reliable=reliable, latched=latched)


def lossless(offered: Iterable[QoSProfile]) -> QoSProfile:
    """A profile that matches every one of the publishers and keeps all that is not taken yet."""
    common = common_qos(offered)
    keep_all, latched = HistoryPolicy.KEEP_ALL, is_latched(common)
    return _last(0, reliable=is_reliable(common), latched=latched, history=keep_all)


def less_demanding(requested: QoSProfile, offered: QoSProfile) -> QoSProfile:
    """The requested profile with no more than what is offered; itself where that is enough."""
    reliable = is_reliable(requested) and is_reliable(offered)
    latched = is_latched(requested) and is_latched(offered)
    if (reliable, latched) == (is_reliable(requested), is_latched(requested)):
        return requested
    depth, history = requested.depth, requested.history
    return _last(depth, reliable=reliable, latched=latched, history=history)
