"""A goal by action with a deadline: python goal_by_action.py X_M Y_M DEADLINE_S.

Asks the strategy of the stack `goto` or `robot` how likely the robot is at the goal in time, sends
the goal where that is likely enough, and cancels it at the deadline. Needs nav2_msgs and serd_msgs
(`make interfaces`).
"""

import sys

import rclpy
from action_msgs.msg import GoalStatus
from geometry_msgs.msg import PoseStamped
from nav2_msgs.action import NavigateToPose
from rclpy.action import ActionClient
from serd_msgs.srv import ForecastArrival

LIKELY = 0.5


def drive(x_m: float, y_m: float, deadline_s: float) -> str:
    """Send the goal, wait for its end at most until the deadline, and return what came of it."""
    node = rclpy.create_node("courier")
    goal = PoseStamped()
    goal.header.frame_id = "map"
    goal.pose.position.x, goal.pose.position.y, goal.pose.orientation.w = x_m, y_m, 1.0

    def answer(future, timeout_s=None):
        rclpy.spin_until_future_complete(node, future, timeout_sec=timeout_s)
        return future.result() if future.done() else None

    forecasts = node.create_client(ForecastArrival, "forecast_arrival")
    forecasts.wait_for_service()
    request = ForecastArrival.Request(goal=goal, deadline=deadline_s)
    while not (asked := answer(forecasts.call_async(request))).success:
        print("no forecast yet:", asked.message)
        rclpy.spin_once(node, timeout_sec=0.5)
    print(f"in time with probability {asked.forecast.probability:.2f}", flush=True)
    if asked.forecast.probability < LIKELY:
        return "not sent: too unlikely"

    client = ActionClient(node, NavigateToPose, "navigate_to_pose")
    client.wait_for_server()
    handle = answer(client.send_goal_async(NavigateToPose.Goal(pose=goal)))
    if not handle.accepted:
        return "rejected; the strategy names the reason in its log"
    end = answer(handle.get_result_async(), deadline_s)
    if end is None:
        answer(handle.cancel_goal_async())
        return "cancelled: too late"
    return "arrived" if end.status == GoalStatus.STATUS_SUCCEEDED else "given up"


if __name__ == "__main__":
    rclpy.init()
    print(drive(*map(float, sys.argv[1:4])))
