"""The same people as messages of each standard type."""

import numpy as np
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from serd_bag.formats.rosbag2.message_types import added_types
from serd_bag.topic import MessageType
from support.bag_messages import filled

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
#: What a cloud of nobody has.
_CLOUD = {
    "height": 1,
    "fields": [
        {"name": name, "offset": 4 * index, "datatype": 7, "count": 1}
        for index, name in enumerate(("x", "y", "vx", "vy"))
    ],
    "point_step": 16,
    "is_dense": True,
}


class PeopleMessages:
    """Encodes people of (N, 2) positions and velocities; layout: of an older vision_msgs."""

    def __init__(self, layout=""):
        self.layout = layout
        self.store = get_typestore(Stores.ROS2_JAZZY)
        for name, known in added_types().items():
            text = _OLDER.get(layout, {}).get(name, known)
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
        sec, nanosec = divmod(round(time_s * 1e9), 10**9)
        header = {"stamp": {"sec": sec, "nanosec": nanosec}, "frame_id": frame}
        places, speeds = ([dict(zip("xy", map(float, row), strict=True)) for row in rows]
                          for rows in (position_m, velocity_mps))  # fmt: skip
        poses = [{"pose": {"position": place, "orientation": {"w": 1.0}}} for place in places]
        if name == CLOUD:
            rows = np.hstack([position_m, velocity_mps]).astype("<f4")
            values = _CLOUD | {"width": len(rows), "row_step": 16 * len(rows)}
            values["data"] = np.frombuffer(rows.tobytes(), dtype=np.uint8)
        elif name == PEOPLE:
            people = enumerate(zip(places, speeds, strict=True))
            values = {"people": [
                {"name": f"p{n}", "position": at, "velocity": by, "reliability": 1.0}
                for n, (at, by) in people
            ]}  # fmt: skip
        elif name == TRACKED:
            numbers = ({"track_id": n, "detection_id": n} for n in range(len(poses)))
            values = {"tracks": [
                number | {"is_matched": True, "pose": pose, "twist": {"twist": {"linear": by}}}
                for number, pose, by in zip(numbers, poses, speeds, strict=True)
            ]}  # fmt: skip
        else:
            seen = {"score": 0.9, "id": classes, "hypothesis": {"class_id": classes, "score": 0.9}}
            cloud = _CLOUD | {"header": header}
            names = [f"p{n}" if tracked else "" for n in range(len(poses))]
            values = {"detections": [
                {"header": header, "results": [seen | {"pose": pose}], "source_cloud": cloud,
                 "bbox": {"center": pose["pose"], "size": {"x": 0.5, "y": 0.5}},
                 "id": each, "tracking_id": each, "is_tracking": True}
                for each, pose in zip(names, poses, strict=True)
            ]}  # fmt: skip
        return filled(self.store, name, {"header": header, **values})

    def encode(self, name, *values, **look):
        """CDR bytes."""
        return bytes(self.store.serialize_cdr(self.message(name, *values, **look), name))
