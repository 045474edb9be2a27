"""A stand-in for an action server of Nav2, whose types have no wheels.

Goals are plain values, and the server answers by rclpy's own futures.
"""

from types import SimpleNamespace

import pytest
from rclpy.task import Future

from serd_ros.nodes import nav2_bridge


class Handle:
    """A goal at the server."""

    def __init__(self, accepted):
        self.accepted, self.canceled, self.result = accepted, False, Future()

    def get_result_async(self):
        return self.result

    def cancel_goal_async(self):
        self.canceled = True

    def end(self, status, error_code=0):
        answer = SimpleNamespace(status=status, result=SimpleNamespace(error_code=error_code))
        answered(self.result, answer)


class Nav2Server:
    """Takes goals and answers on request."""

    def __init__(self):
        self.ready, self.goals, self.answers = True, [], []

    def server_is_ready(self):
        return self.ready

    def send_goal_async(self, goal):
        self.goals.append(goal)
        self.answers.append(Future())
        return self.answers[-1]

    def answer(self, accepted=True):
        handle = Handle(accepted)
        answered(self.answers[-1], handle)
        return handle


def answered(future, value):
    """Set a future's result and run its callbacks, as a spinning node would."""
    callbacks, future._callbacks = future._callbacks, []
    future.set_result(value)
    for callback in callbacks:
        callback(future)


@pytest.fixture
def nav2_server(monkeypatch):
    """The server of every node nav2_bridge that this process starts."""
    server = Nav2Server()
    action = SimpleNamespace(Goal=SimpleNamespace)
    monkeypatch.setattr(nav2_bridge, "ros_type", lambda *_: action)
    monkeypatch.setattr(nav2_bridge, "ActionClient", lambda *_: server)
    return server
