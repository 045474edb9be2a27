"""teleop_mux: its topics and its service are the inputs of the mux."""

import math

import pytest
from geometry_msgs.msg import Twist, TwistStamped
from sensor_msgs.msg import Joy
from std_msgs.msg import Bool
from std_srvs.srv import SetBool

from serd_ros.convert.motion import to_twist, to_twist_stamped
from serd_sim.world.command import Command
from support.nodes_in_process import node_in_process


@pytest.fixture
def running():
    with node_in_process("teleop_mux") as found:
        yield found


def driven(running, n_periods=50, **speeds_mps):
    """The speed of the output after these inputs were published for a second."""
    for _ in range(n_periods):
        running.wait(0.02)
        for name, speed_mps in speeds_mps.items():
            running.receive(f"cmd_vel_{name}", to_twist(Command(speed_mps, 0.0)))
        running.call_timers()
    return running.sent["cmd_vel_raw"].linear.x


def test_the_highest_priority_drives_within_the_limits_and_silence_stops(running):
    assert driven(running) == 0.0
    running.receive("driver_gone", Bool(data=True))
    assert driven(running, planner=0.3) == 0.0
    running.receive("driver_gone", Bool(data=False))
    assert driven(running, n_periods=10, planner=0.3) == pytest.approx(0.3)
    assert driven(running, planner=0.2, teleop=0.4, joy=50.0) == pytest.approx(1.2)
    assert driven(running, joy=math.nan) == 0.0


def test_the_e_stop_holds_until_it_is_released_and_each_input_has_stopped(running):
    assert driven(running, teleop=0.5) == pytest.approx(0.5)
    running.receive("e_stop", Bool(data=True))
    assert running.sent["e_stop_engaged"].data
    assert driven(running, teleop=0.5) == 0.0
    response = running.call("set_e_stop", SetBool.Request(data=False))
    assert (response.success, response.message) == (True, "released")
    assert not running.sent["e_stop_engaged"].data
    for speed_mps, driven_mps in ((0.5, 0.0), (0.0, 0.0), (0.5, 0.5)):
        assert driven(running, teleop=speed_mps) == pytest.approx(driven_mps)
    running.call("set_e_stop", SetBool.Request(data=True))
    assert driven(running, teleop=0.5) == 0.0


def test_commands_have_stamps_where_the_file_sets_it(tmp_path):
    file = tmp_path / "mux.yaml"
    file.write_text("topics: {nav: {topic: nav_vel, timeout: 0.5, priority: 1, stamped: true}}\n")
    with node_in_process("teleop_mux", mux=str(file), stamped_cmd_vel=True) as running:
        for _ in range(10):
            running.wait(0.02)
            running.receive("nav_vel", to_twist_stamped(Command(0.25, 0.0), 0.0))
            running.call_timers()
        assert running.sent["cmd_vel_raw"].twist.linear.x == pytest.approx(0.25)
        (nav,) = [each for each in running.node.subscriptions if "nav_vel" in each.topic_name]
        assert (nav.msg_type, type(running.sent["cmd_vel_raw"])) == (TwistStamped, TwistStamped)
        assert Twist not in {each.msg_type for each in running.node.subscriptions}


def test_after_the_release_of_the_e_stop_the_stick_must_return_to_neutral():
    with node_in_process("teleop_joy") as joy:

        def pushed(deflection):
            joy.receive("joy", Joy(axes=[0.0, deflection, 0.0], buttons=[0, 0, 0, 0, 1, 0]))
            return joy.sent["cmd_vel_joy"].linear.x

        for _ in range(2):
            assert pushed(0.0) == 0.0
            assert pushed(1.0) == pytest.approx(0.6)
            for engaged in (True, False):
                joy.receive("e_stop_engaged", Bool(data=engaged))
                assert pushed(1.0) == 0.0
        joy.assert_alive()
