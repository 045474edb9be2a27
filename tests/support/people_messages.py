"""The same people as messages of each standard type."""

import numpy as np
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from serd_bag.formats.rosbag2.message_types import ADDED, MessageType

CLOUD = "sensor_msgs/msg/PointCloud2"
PEOPLE = "people_msgs/msg/People"
TRACKED = "spencer_tracking_msgs/msg/TrackedPersons"
DETECTIONS = "vision_msgs/msg/Detection3DArray"
#: Detections before vision_msgs 4, by ROS distribution.
_OLD_DETECTION = (
    "std_msgs/Header header\nvision_msgs/ObjectHypothesisWithPose[] results\n"
    "vision_msgs/BoundingBox3D bbox\nsensor_msgs/PointCloud2 source_cloud\n"
)
_OLDER = {
    "foxy": {
        "vision_msgs/msg/ObjectHypothesisWithPose": (
            "string id\nfloat64 score\ngeometry_msgs/PoseWithCovariance pose\n"
        ),
        "vision_msgs/msg/Detection3D": f"{_OLD_DETECTION}bool is_tracking\nstring tracking_id\n",
    },
    "noetic": {
        "vision_msgs/msg/ObjectHypothesisWithPose": (
            "int64 id\nfloat64 score\ngeometry_msgs/PoseWithCovariance pose\n"
        ),
        "vision_msgs/msg/Detection3D": _OLD_DETECTION,
    },
}


class PeopleMessages:
    """Encodes people of (N, 2) positions and velocities; layout: of an older vision_msgs."""

    def __init__(self, layout=""):
        self.layout = layout
        self.store = get_typestore(Stores.ROS2_JAZZY)
        for name in ADDED:
            text = _OLDER.get(layout, {}).get(name, ADDED[name])
            self.store.register(get_types_from_msg(text, name))

    def kind(self, name):
        """The type with its whole definition, as a recorder of a robot that has it writes it."""
        text, _ = self.store.generate_msgdef(name, ros_version=2)
        return MessageType(name, text, "")

    def message(
        self, name, time_s, position_m, velocity_mps, *,
        frame="map", classes="person", tracked=True,
    ):  # fmt: skip
        """A message object of rosbags; tracked: whether detections have ids."""
        people = list(enumerate(zip(position_m, velocity_mps, strict=True)))
        header = self._header(time_s, frame)
        if name == CLOUD:
            return self._cloud(header, position_m, velocity_mps)
        if name == PEOPLE:
            kind = "people_msgs/msg/Person"
            rows = [
                self._make(kind, f"p{n}", self._point(at), self._point(by), 1.0, [], [])
                for n, (at, by) in people
            ]
        elif name == TRACKED:
            rows = [self._tracked(n, at, by) for n, (at, by) in people]
        else:
            rows = [
                self._detection(header, f"p{n}" if tracked else "", at, classes)
                for n, (at, _) in people
            ]
        return self._make(name, header, rows)

    def encode(self, name, *values, **look):
        """CDR bytes."""
        return bytes(self.store.serialize_cdr(self.message(name, *values, **look), name))

    def _make(self, name, *values):
        return self.store.types[name](*values)

    def _header(self, time_s, frame):
        stamp = self._make("builtin_interfaces/msg/Time", *divmod(round(time_s * 1e9), 10**9))
        return self._make("std_msgs/msg/Header", stamp, frame)

    def _point(self, place):
        return self._make("geometry_msgs/msg/Point", *map(float, place), 0.0)

    def _pose(self, place):
        level = self._make("geometry_msgs/msg/Quaternion", 0.0, 0.0, 0.0, 1.0)
        pose = self._make("geometry_msgs/msg/Pose", self._point(place), level)
        return self._make("geometry_msgs/msg/PoseWithCovariance", pose, np.zeros(36))

    def _vector(self, values):
        return self._make("geometry_msgs/msg/Vector3", *map(float, values), 0.0)

    def _tracked(self, number, place, velocity):
        twist = self._make(
            "geometry_msgs/msg/Twist", self._vector(velocity), self._vector((0.0, 0.0))
        )
        twist = self._make("geometry_msgs/msg/TwistWithCovariance", twist, np.zeros(36))
        age = self._make("builtin_interfaces/msg/Duration", 0, 0)
        kind = "spencer_tracking_msgs/msg/TrackedPerson"
        return self._make(kind, number, False, True, number, age, self._pose(place), twist)

    def _detection(self, header, name, place, classes):
        pose = self._pose(place)
        hypothesis = (
            (classes, 0.9)
            if self.layout
            else (self._make("vision_msgs/msg/ObjectHypothesis", classes, 0.9),)
        )
        result = self._make("vision_msgs/msg/ObjectHypothesisWithPose", *hypothesis, pose)
        box = self._make("vision_msgs/msg/BoundingBox3D", pose.pose, self._vector((0.5, 0.5)))
        none = np.zeros((0, 2))
        last = {
            "": lambda: (name,),
            "foxy": lambda: (self._cloud(header, none, none), True, name),
            "noetic": lambda: (self._cloud(header, none, none),),
        }[self.layout]()
        return self._make("vision_msgs/msg/Detection3D", header, [result], box, *last)

    def _cloud(self, header, position_m, velocity_mps):
        rows = np.hstack([position_m, velocity_mps]).astype("<f4")
        field = self.store.types["sensor_msgs/msg/PointField"]
        names = ("x", "y", "vx", "vy")
        fields = [field(name, 4 * index, 7, 1) for index, name in enumerate(names)]
        data = np.frombuffer(rows.tobytes(), dtype=np.uint8)
        return self._make(
            CLOUD, header, 1, len(rows), fields, False, 16, 16 * len(rows), data, True
        )
