"""Goals as Nav2's clients send them: the action, a plan with times and forecasts for planners."""

import importlib.util
import math

import pytest
from action_msgs.msg import GoalStatus
from diagnostic_msgs.msg import DiagnosticArray
from nav_msgs.srv import GetPlan
from rclpy.action import ActionClient

from serd_ros.convert.motion import from_pose, to_pose_stamped
from serd_ros.convert.stamp import stamp_ns
from support.waiting import wait_until

pytestmark = [
    pytest.mark.ros,
    pytest.mark.slow,
    pytest.mark.skipif(
        importlib.util.find_spec("nav2_msgs") is None
        or importlib.util.find_spec("serd_msgs") is None,
        reason="nav2_msgs and serd_msgs are not installed; run make interfaces",
    ),
]


class Client:
    """Sends goals and takes their ends, as nav2_simple_commander does."""

    def __init__(self, probe, name="navigate_to_pose"):
        from nav2_msgs.action import NavigateToPose

        self.probe, self.kind, self.feedback = probe, NavigateToPose, []
        self.client = ActionClient(probe.node, NavigateToPose, name)

    def send(self, x_m, y_m, yaw_rad=0.0):
        """A goal that is accepted, and its result as a future."""
        handle = self.ask(x_m, y_m, yaw_rad)
        assert handle.accepted
        return handle, handle.get_result_async()

    def ask(self, x_m, y_m, yaw_rad=0.0):
        """The server's answer to a goal."""
        self.probe.spin_until(self.client.server_is_ready)
        goal = self.kind.Goal(pose=to_pose_stamped((x_m, y_m, yaw_rad), 0.0))
        sent = self.client.send_goal_async(goal, lambda each: self.feedback.append(each.feedback))
        self.probe.spin_until(sent.done)
        return sent.result()

    def result(self, future, seen):
        self.probe.spin_until(future.done, seen=seen)
        return future.result().status, future.result().result.error_code


@pytest.fixture
def model(save_model_of):
    return save_model_of()


@pytest.fixture
def late_text(model):
    """That of the model, whose file is not there yet."""
    text = model.read_text()
    model.unlink()
    return text


@pytest.fixture
def driving(nodes, probe, start_robot, model):
    """The client of a robot that drives by stack `robot`, and the logs of both."""
    start_robot()
    nodes.start_stack("robot", model=str(model), strategy__patience_decisions=0)

    def logs():
        return "\n".join(nodes.log_of(name) for name in ("strategy", "standin_robot"))

    yield Client(probe), logs
    assert "internal error" not in nodes.log_of("strategy")


def test_a_goal_before_the_model_is_driven_to_its_pose_and_a_burst_plans_for_the_newest(
    late_text, driving, model, probe
):
    (client, logs), health = driving, probe.health()

    def waits_for(words):
        said = f"waiting for {words}"
        probe.spin_until(lambda: any(said in each.message for each in health), seen=logs)
        probe.spin_until(lambda: logs().count(said) == 1, seen=logs)

    waits_for(f"the model file {model}, or")
    assert not client.ask(9.0, 3.0).accepted  # no cell
    handle, cancelled = client.send(4.5, 2.5)
    handle.cancel_goal_async()
    assert client.result(cancelled, logs)[0] == GoalStatus.STATUS_CANCELED
    _, early = client.send(3.3, 3.6, math.pi / 2)
    model.write_text(late_text[: len(late_text) // 2])  # as while it is copied
    waits_for(f"a usable model, and looking again when the file changes: {model}, ")
    model.write_text(late_text)
    assert client.result(early, logs) == (GoalStatus.STATUS_SUCCEEDED, 0)
    place = from_pose(client.feedback[-1].current_pose.pose)
    assert math.dist(place[:2], (3.3, 3.6)) < 0.35
    assert abs(math.remainder(place[2] - math.pi / 2, math.tau)) < 0.6
    assert max(each.distance_remaining for each in client.feedback) > 1.0

    futures = [client.send(4.5, 2.5 + 0.001 * number)[1] for number in range(20)]
    ends = [client.result(each, logs)[0] for each in futures]
    assert ends == [GoalStatus.STATUS_ABORTED] * 19 + [GoalStatus.STATUS_SUCCEEDED]


def test_goals_are_refused_with_a_reason_cancelled_and_replaced(driving, probe, nodes):
    client, logs = driving
    wait_until(lambda: "waiting for a goal" in nodes.log_of("strategy"))
    said = []
    probe.subscribe(
        DiagnosticArray, "diagnostics", lambda each: said.append(each.status[0].message)
    )
    for goal, reason in (((9.0, 3.0), "goal must be in a walkable"), ((math.nan, 3.0), "position")):
        assert not client.ask(*goal).accepted
        stated = f"goal rejected: {reason}"
        assert stated in nodes.log_of("strategy")
        probe.spin_until(lambda text=stated: any(text in each for each in said), seen=logs)

    handle, far = client.send(3.5, 12.5)
    client.feedback.clear()
    probe.spin_until(
        lambda: any(each.estimated_time_remaining.sec > 0 for each in client.feedback), seen=logs
    )
    cancelled = handle.cancel_goal_async()
    probe.spin_until(cancelled.done, seen=logs)
    assert client.result(far, logs)[0] == GoalStatus.STATUS_CANCELED

    _, replaced = client.send(3.5, 12.5)
    probe.send_goal(3.5, 2.5)  # by the topic
    assert client.result(replaced, logs)[0] == GoalStatus.STATUS_ABORTED


def test_a_planner_gets_the_way_with_times_and_the_chance_of_a_deadline(driving, probe, nodes):
    from serd_msgs.msg import ArrivalForecast
    from serd_msgs.srv import ForecastArrival

    _, logs = driving
    wait_until(lambda: "waiting for a goal" in nodes.log_of("strategy"))

    def call(kind, name, **fields):
        service = probe.node.create_client(kind, name)
        probe.spin_until(service.service_is_ready)
        future = service.call_async(kind.Request(**fields))
        probe.spin_until(future.done, seen=logs)
        return future.result()

    start, goal = (to_pose_stamped((*place, 0.0), 0.0) for place in ((4.5, 1.5), (4.5, 9.5)))
    poses = call(GetPlan, "get_plan", start=start, goal=goal).plan.poses
    times_s = [stamp_ns(each.header.stamp) * 1e-9 for each in poses]
    assert len(poses) >= 9
    assert times_s == sorted(times_s)
    assert from_pose(poses[-1].pose)[:2] == pytest.approx((4.5, 9.5))

    forecast = {"start": start, "goal": goal, "deadline": 20.0, "shares": [0.1, 0.5, 0.9]}
    answers = []

    def answered():
        answers.append(call(ForecastArrival, "forecast_arrival", **forecast))
        return answers[-1].success

    wait_until(answered, seen=lambda: answers)
    found = answers[-1].forecast
    assert found.mean == pytest.approx(times_s[-1] - times_s[0], abs=0.2)
    assert sorted(found.quantiles) == list(found.quantiles)
    assert found.quantiles[0] < found.mean < found.quantiles[2] < 20.0
    assert 0.9 < found.probability < 1.0

    nowhere = call(GetPlan, "get_plan", start=start, goal=to_pose_stamped((9.0, 3.0, 0.0), 0.0))
    assert not nowhere.plan.poses
    refused = call(ForecastArrival, "forecast_arrival", **forecast | {"deadline": -1.0})
    assert (refused.success, refused.message.startswith("deadline must be")) == (False, True)

    published = []
    probe.subscribe(ArrivalForecast, "arrival", published.append)
    probe.send_goal(4.5, 2.5)
    probe.spin_until(lambda: published, seen=logs)
    assert (published[0].goal.x, published[0].goal.y) == (4.5, 2.5)
