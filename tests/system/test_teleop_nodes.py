"""The joystick and the mux over ROS: after an emergency stop the stick must return to neutral."""

import pytest
from geometry_msgs.msg import Twist
from sensor_msgs.msg import Joy
from std_msgs.msg import Bool

from serd_cli.processes.node_commands import stack_processes
from serd_ros.endpoints import qos
from serd_ros.graph.graph import find_stack


@pytest.mark.ros
def test_after_the_release_of_the_e_stop_the_stick_must_return_to_neutral(nodes, probe, ros_env):
    part = find_stack("teleop").model_copy(update={"nodes": ("teleop_joy", "teleop_mux")})
    for each in stack_processes(part, {}, ros_env):
        nodes.start(list(each.command), each.name, forked=False)
    by_joy, received, engaged = [], [], []
    subscribe = probe.node.create_subscription
    subscribe(Twist, "cmd_vel_raw", lambda m: received.append(m.linear.x), qos.COMMAND)
    subscribe(Twist, "cmd_vel_joy", by_joy.append, qos.COMMAND)
    subscribe(Bool, "e_stop_engaged", lambda m: engaged.append(m.data), qos.LATCHED)
    e_stop = probe.node.create_publisher(Bool, "e_stop", qos.COMMAND)
    publisher = probe.node.create_publisher(Joy, "joy", qos.COMMAND)
    probe.spin_until(
        lambda: publisher.get_subscription_count() and e_stop.get_subscription_count() and engaged
    )

    def push(deflection):
        publisher.publish(Joy(axes=[0.0, deflection, 0.0], buttons=[0, 0, 0, 0, 1, 0]))
        return received[-1] if received else 0.0

    probe.spin_until(lambda: push(0.0) == 0.0 and by_joy)
    # Neutral by turns: the mux may have met the joystick only after the first ones.
    probe.spin_until(lambda: (push(0.0), push(1.0)) and pytest.approx(0.6) in received[-20:])
    for state in (True, False):
        e_stop.publish(Bool(data=state))
        probe.spin_until(lambda state=state: push(1.0) == 0.0 and engaged[-1] == state)
    received.clear()
    probe.spin_until(lambda: push(1.0) == 0.0 and len(received) > 20)
    assert set(received) == {0.0}
    by_joy.clear()  # more than may wait: of several messages a busy node takes the last alone
    probe.spin_until(lambda: push(0.0) == 0.0 and len(by_joy) > 20)
    probe.spin_until(lambda: push(1.0) > 0.0)
