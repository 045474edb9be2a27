"""Quality of service per topic.

In lock-step nothing may be lost, so the state topics are reliable and deep: a recorder on a busy
machine may lag behind a world that runs many times faster than real time.
"""

from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

STATE_DEPTH = 2000
COMMAND_DEPTH = 10

STATE = QoSProfile(
    history=HistoryPolicy.KEEP_LAST,
    depth=STATE_DEPTH,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.VOLATILE,
)
COMMAND = QoSProfile(
    history=HistoryPolicy.KEEP_LAST,
    depth=COMMAND_DEPTH,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.VOLATILE,
)
CLOCK = QoSProfile(
    history=HistoryPolicy.KEEP_LAST,
    depth=1,
    reliability=ReliabilityPolicy.BEST_EFFORT,
    durability=DurabilityPolicy.VOLATILE,
)
#: What lidars publish with; hears reliable publishers too.
SENSOR = QoSProfile(
    history=HistoryPolicy.KEEP_LAST,
    depth=COMMAND_DEPTH,
    reliability=ReliabilityPolicy.BEST_EFFORT,
    durability=DurabilityPolicy.VOLATILE,
)
TF = QoSProfile(
    history=HistoryPolicy.KEEP_LAST,
    depth=100,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.VOLATILE,
)
LATCHED = QoSProfile(
    history=HistoryPolicy.KEEP_LAST,
    depth=1,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
)
#: For who must not miss a message: a reader that is full refuses more, and a sender that waits for
#: acknowledgements, as bag_replay does, waits for it. (With KEEP_LAST it would drop the oldest.)
LOSSLESS = QoSProfile(
    history=HistoryPolicy.KEEP_ALL,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.VOLATILE,
)
