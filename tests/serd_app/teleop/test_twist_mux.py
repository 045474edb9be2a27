"""The multiplexer: priorities, dead-man timeouts, locks, limits and the e-stop latch."""

import math
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from serd_app.teleop.twist_mux import (
    MuxLock,
    MuxSettings,
    MuxTopic,
    TwistMux,
    VelocityLimits,
    load_mux,
)
from serd_bag.errors import FileError
from serd_sim.world.command import STOP, Command

UNLIMITED = VelocityLimits(1e6, -1e6, 1e6, 1e9, 1e9)
ROBOT = VelocityLimits(1.2, -0.3, 3.5, 2.5, 12.0)
SLOW, FAST = Command(0.2, 0.1), Command(0.9, -0.4)
TOPICS = {
    "planner": MuxTopic(topic="cmd_vel_planner", timeout=0.5, priority=10),
    "keys": MuxTopic(topic="cmd_vel_teleop", timeout=0.5, priority=90),
}
SETTINGS = MuxSettings(
    topics=TOPICS, locks={"gone": MuxLock(topic="gone", timeout=0.5, priority=50)}
)


def mux_of(limits=UNLIMITED, **lock):
    """A mux with these limits, without a lock unless the fields of one are given."""
    locks = {"lock": MuxLock(topic="lock", **lock)} if lock else {}
    return TwistMux(MuxSettings(topics=TOPICS, locks=locks), limits)


def test_a_lock_masks_lower_priorities_only_and_engages_after_its_timeout_and_not_at_it():
    mux = TwistMux(SETTINGS, UNLIMITED)
    mux.receive("planner", SLOW, 1.0)
    assert (mux.step(1.0).locked_by, mux.step(1.0).command) == (("gone",), STOP)
    mux.receive_lock("gone", False, 1.0)
    engaged = {now_s: mux.engaged_locks(now_s) for now_s in (0.9, 1.0, 1.5, 1.5001)}
    assert engaged == {0.9: ("gone",), 1.0: (), 1.5: (), 1.5001: ("gone",)}
    assert mux.step(1.1).command == SLOW
    mux.receive("planner", SLOW, 1.6)
    assert mux.step(1.6).command == STOP
    mux.receive("keys", FAST, 1.6)
    assert mux.step(1.65).active == "keys"
    mux.receive_lock("gone", True, 1.65)
    mux.receive("planner", SLOW, 2.3)
    assert mux.step(2.3).command == STOP


def test_a_lock_without_timeout_keeps_its_value_and_lets_inputs_of_its_own_priority_pass():
    for priority, active in ((90, "keys"), (91, "")):
        mux = mux_of(timeout=0.0, priority=priority)
        mux.receive("keys", FAST, 1.0)
        assert mux.step(1.0).active == "keys"
        mux.receive_lock("lock", True, 1.0)
        for name in ("planner", "keys"):
            mux.receive(name, FAST, 100.0)
        assert mux.step(100.0).active == active
        mux.receive_lock("lock", False, 100.0)
        assert mux.step(100.1).active == "keys"


@pytest.mark.parametrize("between", [STOP, None])
def test_after_the_release_an_input_counts_once_it_has_sent_a_stop_or_fallen_silent(between):
    mux = mux_of()
    mux.receive("keys", FAST, 1.0)
    mux.set_e_stop(True)
    mux.step(1.0)
    mux.set_e_stop(False)
    for now_s in (1.1, 1.5, 1.9, 11.0):
        mux.receive("keys", FAST, now_s)
        output = mux.step(now_s)
        assert (output.command, output.held) == (STOP, ("keys",))
    if between is not None:
        mux.receive("keys", between, now_s)
    else:
        now_s += 0.6
        assert mux.step(now_s).held == ()
    mux.receive("keys", FAST, now_s)
    assert mux.step(now_s + 0.02).command == FAST


def test_a_command_that_is_not_finite_is_a_counted_stop_and_a_clock_that_goes_backwards_stops():
    mux = mux_of()
    mux.receive("planner", SLOW, 1.0)
    mux.receive("keys", Command(math.nan, 0.0), 1.0)
    output = mux.step(1.0)
    assert (output.active, output.command) == ("keys", STOP)
    assert mux.n_rejected == {"planner": 0, "keys": 1}
    mux.receive("keys", FAST, 10.0)
    assert mux.step(9.0).command == STOP


def test_a_command_is_approached_at_the_acceleration_limit_and_a_stop_for_safety_is_at_once():
    mux = mux_of(ROBOT)
    mux.receive("keys", FAST, 0.04)  # from the zero of its clock, as from rest
    assert mux.step(0.04).command == Command(pytest.approx(2.5 * 0.04), pytest.approx(-0.4))
    mux, speeds_mps = mux_of(ROBOT), []
    for tick in range(12):
        mux.receive("keys", Command(5.0, 0.0), 1.0 + 0.05 * tick)
        speeds_mps.append(mux.step(1.0 + 0.05 * tick).command.linear_mps)
    gains = [after - before for before, after in pairwise(speeds_mps)]
    assert gains[:7] == pytest.approx([0.125] * 7)
    assert speeds_mps[-1] == 1.2
    mux.set_e_stop(True)
    assert mux.step(1.65).command == STOP


KINDS = ["planner", "keys", "lock", "unlock", "e_stop", "release", "step"]
speeds = st.floats(allow_nan=True, allow_infinity=True)
commands = st.builds(Command, speeds, speeds)
events = st.lists(st.tuples(st.sampled_from(KINDS), commands, st.floats(0.0, 0.4)), max_size=40)


@given(events)
def test_whatever_comes_the_output_is_finite_within_limits_and_reachable(happenings):
    mux, now_s, before, latched, stepped_s = TwistMux(SETTINGS, ROBOT), 0.0, STOP, False, 0.0
    last: dict[str, float] = {}
    sent: dict[str, Command] = {}
    held: set[str] = set()
    for kind, command, wait_s in happenings:
        now_s += wait_s
        if kind in TOPICS:
            mux.receive(kind, command, now_s)
            last[kind], sent[kind] = now_s, command if command.is_finite else STOP
        elif kind in ("lock", "unlock"):
            mux.receive_lock("gone", kind == "lock", now_s)
        elif kind in ("e_stop", "release"):
            latched = kind == "e_stop"
            mux.set_e_stop(latched)
        neutral = {
            name
            for name in TOPICS
            if sent.get(name, STOP) == STOP or now_s - last[name] > 0.5 + 1e-9
        }
        held = set(TOPICS) if latched else held - neutral
        output = mux.step(now_s)
        got = output.command
        assert got.is_finite
        assert -0.3 <= got.linear_mps <= 1.2
        assert abs(got.angular_radps) <= 3.5
        if output.active:
            reach_mps = 2.5 * min(now_s - stepped_s, 0.1) + 1e-9
            assert abs(got.linear_mps - before.linear_mps) <= reach_mps
            assert now_s - last[output.active] <= 0.5 + 1e-6
            assert not latched
            assert got == STOP or output.active not in held
            assert output.active == "keys" or not output.locked_by
        else:
            assert got == STOP
        before, stepped_s = got, now_s


def test_the_built_in_settings_let_a_driver_override_the_planner_and_lock_it_without_one():
    settings = load_mux()
    priority = {name: topic.priority for name, topic in settings.topics.items()}
    assert priority["planner"] < settings.locks["driver_gone"].priority < priority["keys"]
    assert priority["keys"] < priority["joystick"]


def test_a_file_of_twist_mux_is_understood_with_its_frame(tmp_path):
    file = tmp_path / "twist_mux.yaml"
    file.write_text(
        "twist_mux:\n  ros__parameters:\n    topics:\n      navigation:\n        stamped: true\n"
        "        topic   : nav_vel\n        timeout : 0.5\n        priority: 10\n"
        "    locks:\n      pause: {topic: pause, timeout: 0.0, priority: 100}\n"
    )
    settings = load_mux(file)
    assert settings.topics["navigation"].stamped
    assert settings.locks["pause"].timeout == 0.0


A = "topics: {a: {topic: x, timeout: 0.5, priority: 1}"


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("topics: {}", "topics must"),
        (f"{A}}}".replace("0.5", "0.0"), "timeout must be greater than 0"),
        (f"{A}}}".replace("0.5", "3.0"), "less than or equal to 0.5"),
        (
            f"{A}, b: {{topic: y, timeout: 0.5, priority: 1}}}}",
            "priority must differ between a and b, got 1 for both; change one",
        ),
        (
            f"{A}}}\nlocks: {{b: {{topic: x, timeout: 0.5, priority: 1}}}}",
            "topic must differ between a and b, got 'x' for both",
        ),
        (f"{A}}}".replace("priority", "priorty"), "priorty"),
    ],
)
def test_a_bad_file_names_the_key_and_the_rule(text, sentence, tmp_path):
    file = tmp_path / "mux.yaml"
    file.write_text(text)
    with pytest.raises(FileError, match=sentence):
        load_mux(file)
