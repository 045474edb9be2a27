"""The layouts for RViz and Foxglove show topics that the graph has, with their types."""

import json

import pytest
import yaml
from rclpy.qos import DurabilityPolicy

from serd_bag.formats.rosbag2.message_types import rosbags_types
from serd_ros.endpoints.topic_types import topic_type
from serd_ros.graph.graph import load_graph

RVIZ_TYPES = {
    "LaserScan": "sensor_msgs/msg/LaserScan",
    "Map": "nav_msgs/msg/OccupancyGrid",
    "MarkerArray": "visualization_msgs/msg/MarkerArray",
    "Path": "nav_msgs/msg/Path",
    "PointCloud2": "sensor_msgs/msg/PointCloud2",
    "Polygon": "geometry_msgs/msg/PolygonStamped",
    "Pose": "geometry_msgs/msg/PoseStamped",
    "SetGoal": "geometry_msgs/msg/PoseStamped",
}
#: A pose that is sent and not shown.
SENT = "goal_pose"
#: Its type, a String, has no display by itself.
DESCRIPTION = "robot_description"


def type_of(topic):
    return topic_type(topic, stamped_cmd_vel=False)


@pytest.fixture(scope="module")
def shown():
    """Published topics of the types that have a display, and the String that has one of its own."""
    published = {topic for node in load_graph().nodes.values() for topic in node.publishes}
    return {t for t in published if type_of(t).name in RVIZ_TYPES.values()} | {DESCRIPTION}


def test_rviz_shows_each_topic_by_the_display_of_its_type(root, shown):
    text = (root / "ros_ws/src/serd_ros/rviz/serd.rviz").read_text()
    manager, found = yaml.safe_load(text)["Visualization Manager"], []
    for each in (*manager["Displays"], *manager["Tools"]):
        shown_by = each["Class"].partition("/")[2]
        place = each.get("Description Topic" if shown_by == "RobotModel" else "Topic")
        if place is None:
            continue
        kind = type_of(place["Value"])
        assert kind.name == RVIZ_TYPES.get(shown_by, "std_msgs/msg/String")
        if place.get("Durability Policy") == "Transient Local":
            assert kind.qos.durability == DurabilityPolicy.TRANSIENT_LOCAL, place
        found.append(place["Value"])
    assert sorted(found) == sorted(shown | {SENT})
    assert any(each["Class"] == "rviz_default_plugins/TF" for each in manager["Displays"])


def test_foxglove_shows_the_same_topics_and_plots_fields_that_they_have(root, shown):
    layout = json.loads((root / "ros_ws/src/serd_ros/foxglove/serd.json").read_text())
    panels = layout["configById"]
    assert {topic.removeprefix("/") for topic in panels["3D!world"]["topics"]} == shown
    assert panels["3D!world"]["publish"]["poseTopic"] == f"/{SENT}"
    summary = panels["DiagnosticSummary!nodes"]["topicToRender"].removeprefix("/")
    assert type_of(summary).name == "diagnostic_msgs/msg/DiagnosticArray"
    for path in panels["Plot!speeds"]["paths"]:
        topic, *fields = path["value"].removeprefix("/").split(".")
        message = rosbags_types().types[type_of(topic).name]
        for field in fields:
            kinds = dict(rosbags_types().fielddefs[message.__msgtype__][1])
            assert field in kinds, path
            message = rosbags_types().types.get(kinds[field][1])
    assert panels_in(layout["layout"]) == set(panels)


def panels_in(part):
    """Names of the panels that a layout arranges."""
    if isinstance(part, str):
        return {part}
    return panels_in(part["first"]) | panels_in(part["second"])
