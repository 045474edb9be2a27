"""The strategy node at work: goals and models that change, refusals, giving up, kills."""

import pytest
from geometry_msgs.msg import PoseStamped
from std_msgs.msg import String
from visualization_msgs.msg import MarkerArray

from serd_app.journeys.navigate import drive
from serd_app.navigation.navigator import ArrivalRow
from serd_app.navigation.settings import DriveSettings, NavigationSettings
from serd_bag.formats.rosbag2.message_types import rosbags_types
from serd_core.grid.navigation import MODEL_NAMES
from serd_files.table import load_episodes, read_rows
from serd_ros.convert.motion import from_pose
from serd_ros.endpoints import qos
from serd_ros.endpoints.topic_types import TYPES
from support.waiting import PATIENCE_S
from tests.conftest import model_row

pytestmark = [pytest.mark.ros, pytest.mark.slow]
EAST_END = (12.0, 18.0)
UNMOVED = tuple(model_row(name, (1.0, 0.0, 0.0, 0.0, 0.0)) for name in MODEL_NAMES)


class Watch:
    """Takes what the strategy publishes, and the robot's pose."""

    def __init__(self, probe):
        self.probe, self.spin_until, self.send_goal = probe, probe.spin_until, probe.send_goal
        self.y_m, self.health, self.texts = 0.0, probe.health(), []
        probe.subscribe(MarkerArray, "markers/arrival", self.texts.append, qos.LATCHED)
        probe.subscribe(PoseStamped, "robot_pose", self._take_pose)
        self.situation, kind = "", TYPES["decision"].message
        probe.node.create_subscription(kind, "decision", self._take_decision, qos.LATCHED, raw=True)

    def reported(self, words):
        return any(words in each.message for each in self.health if each.name == "strategy")

    def _take_decision(self, data):
        message = rosbags_types().deserialize_cdr(data, TYPES["decision"].name)
        self.situation = message.situation

    def _take_pose(self, message):
        self.y_m = from_pose(message.pose)[1]


@pytest.fixture
def watch(probe):
    return Watch(probe)


def arrivals(tmp_path):
    path = tmp_path / "arrivals.csv"
    return read_rows(path, ArrivalRow) if path.is_file() else ()


def row_of_a_goal_during_an_episode(watch, folder):
    """Send a goal while the robot is under way; again where it came too late for this episode."""
    for _ in range(5):
        watch.send_goal(*EAST_END)
        n_rows = len(arrivals(folder))
        watch.spin_until(lambda: watch.y_m < 4.0)
        watch.spin_until(lambda: watch.y_m > 8.0)
        watch.send_goal(1.5, 4.5)

        def rows_of_the_goal(n_rows=n_rows):
            return [row for row in arrivals(folder)[n_rows:] if row.goal_y_m == 4.5]

        watch.spin_until(rows_of_the_goal)
        row = rows_of_the_goal()[0]
        if row.start_y_m >= 6.0:
            return row
    pytest.fail("five goals came too late for the episode that was running")


def test_goals_and_models_change_during_a_drive_and_rows_survive_a_kill_of_the_strategy(
    nodes, watch, save_model_of, quick_hallway, tmp_path
):
    given = {"hallway_sim__people": 0, "seed": 4, "episodes": 1000, "model": str(save_model_of())}
    nodes.start_stack("navigate", scenario=quick_hallway, strategy__output=str(tmp_path), **given)
    spin_until = watch.spin_until
    spin_until(lambda: watch.y_m > 6.0)
    watch.send_goal(9.0, 3.0)
    spin_until(lambda: watch.reported("refused: goal must be in a walkable cell"))
    turned = row_of_a_goal_during_an_episode(watch, tmp_path)
    assert turned.outcome == "arrived"
    assert watch.texts[-1].markers[0].text

    nodes.kill("strategy")
    kept = arrivals(tmp_path)
    nodes.restart("strategy")
    spin_until(lambda: len(arrivals(tmp_path)) > len(kept))
    assert arrivals(tmp_path)[: len(kept)] == kept

    # The model file is overwritten with a model whose policy avoids the goal.
    save_model_of(reward_weights={"goal": -5.0, "social_norm": 1.0})
    spin_until(lambda: "driving the way of least expected time" in watch.situation)
    n_rows = len(arrivals(tmp_path))
    spin_until(lambda: len(arrivals(tmp_path)) > n_rows + 1)
    assert arrivals(tmp_path)[-1].outcome == "arrived"
    assert "cells the way of least expected time is taken instead" in nodes.log_of("strategy")
    assert "read again: planned" in nodes.log_of("strategy")

    # Nothing leads to the goal where robots are learned never to move.
    save_model_of(outcome_models=UNMOVED)
    spin_until(lambda: watch.situation == "in a trap")
    assert "cells are traps" in nodes.log_of("strategy")

    # A learner in the same graph publishes a model whose policy arrives.
    better = save_model_of(name="better.yaml")
    models = watch.probe.node.create_publisher(String, "model", qos.LATCHED)
    models.publish(String(data="format: serd-model"))
    spin_until(lambda: watch.reported("refused: model of the learner: "))
    models.publish(String(data=better.read_text()))
    spin_until(lambda: any(row.model == "model of the learner" for row in arrivals(tmp_path)))


def test_a_transferred_model_drives_to_a_goal_alike_in_process_and_through_ros(
    nodes, save_model_of, tmp_path
):
    drives = {"scenario": "crossing", "goal": "18.5, 8.5", "seed": 21, "episodes": 2}
    settings = DriveSettings(model=str(save_model_of("corridor")), transfer=True, **drives)
    given = settings.model_dump(include=set(NavigationSettings.model_fields))
    stack = nodes.start_stack("navigate", **given, strategy__output=str(tmp_path / "ros"))
    here = drive(settings, tmp_path / "here", lambda _: None)
    assert stack["strategy"].wait(PATIENCE_S) == 0, nodes.log_of("strategy")
    there = load_episodes(tmp_path / "ros/episodes.csv")
    for one, other in zip(here, there, strict=True):
        assert one.arrived
        for name in ("time_of_arrival_s", "distance_m", "person_on_robot"):
            assert getattr(one, name) == getattr(other, name)
    assert arrivals(tmp_path / "ros") == arrivals(tmp_path / "here")
