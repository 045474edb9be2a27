"""Joystick to velocity as teleop_twist_joy does it; the direction that a person holds by keys."""

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from serd_app.teleop.joy_mapping import JoyDriver, JoyMapping, load_joy_mapping
from serd_app.teleop.session import DirectionChoice
from serd_bag.errors import FileError
from serd_core.grid.grid import Action
from serd_sim.drivers.catalogue import MOVES
from serd_sim.world.command import STOP, Command

MAPPING = JoyMapping.model_validate(
    {
        "axis_linear": {"x": 1},
        "scale_linear": {"x": 0.5},
        "scale_linear_turbo": {"x": 1.5},
        "axis_angular": {"yaw": 0},
        "scale_angular": {"yaw": 2.0},
        "scale_angular_turbo": {"yaw": 4.0},
        "enable_button": 1,
        "enable_turbo_button": 2,
    }
)
ENABLED, AHEAD = [0, 1, 0], Command(0.5, 0.0)
CAR = {"inverted_reverse": True}


def driver_of(mapping=MAPPING):
    """A driver whose axes have been neutral."""
    driver = JoyDriver(mapping)
    assert driver.command([0.0, 0.0], [0, 0, 0]) in (None, STOP)
    return driver


def test_axes_are_scaled_while_enabled_and_letting_go_sends_one_stop():
    assert JoyDriver(MAPPING).command([1.0, 1.0], [1, 0, 0]) is None
    driver = driver_of()
    assert driver.command([0.5, 1.0], ENABLED) == Command(0.5, 1.0)
    assert driver.command([0.5, 1.0], [0, 0, 0]) == STOP
    assert driver.command([0.5, 1.0], [0, 0, 0]) is None


@pytest.mark.parametrize(
    ("changes", "axes", "buttons", "command"),
    [
        ({}, [-0.5, 1.0], [0, 0, 1], Command(1.5, -2.0)),  # turbo
        ({}, [1.0, -1.0], [0, 1], Command(-0.5, 2.0)),
        ({}, [], [0, 1], STOP),
        ({}, [1.0, 1.0], [], None),
        (CAR, [1.0, -1.0], [0, 1], Command(-0.5, -2.0)),
        (CAR, [1.0, 0.0], [0, 1], Command(0.0, 2.0)),
        (CAR, [1.0, 0.2], [0, 1], Command(0.1, 2.0)),
        ({"require_enable_button": False}, [0.0, 1.0], [], AHEAD),
        ({"enable_button": 0}, [0.0, 1.0], [1, 0, 0], AHEAD),
        ({"enable_button": 0}, [0.0, 1.0], ENABLED, None),
    ],
)
def test_each_key_of_the_mapping_has_its_effect(changes, axes, buttons, command):
    assert driver_of(MAPPING.model_copy(update=changes)).command(axes, buttons) == command


@pytest.mark.parametrize(
    "stop", [JoyDriver.require_neutral, *(lambda driver, n=n: driver.command([0.0] * n, [])
                                          for n in (0, 1))]
)  # fmt: skip
def test_after_an_e_stop_or_a_lost_axis_the_axes_must_return_to_neutral(stop):
    driver = driver_of()
    assert driver.command([0.0, 1.0], ENABLED) == AHEAD
    stop(driver)
    assert driver.command([0.0, 1.0], ENABLED) == STOP
    assert driver.command([0.0, 1.0], [0, 0, 0]) == STOP
    assert driver.command([0.0, 1.0], ENABLED) == STOP  # the button alone is not enough
    driver.command([0.05, -0.05], ENABLED)
    assert driver.command([0.0, 1.0], ENABLED) == AHEAD


@pytest.mark.parametrize("axis", [0, 1])
def test_an_axis_is_neutral_up_to_a_tenth_of_its_deflection(axis):
    driver = JoyDriver(MAPPING)
    for beyond in (1.0, 0.1001, -0.1001):
        driver.command([beyond if index == axis else 0.0 for index in (0, 1)], ENABLED)
        assert driver.command([0.0, 1.0], ENABLED) == STOP
    driver.command([0.1, -0.1], ENABLED)
    assert driver.command([0.0, 1.0], ENABLED) == AHEAD


def test_the_override_of_the_guard_is_a_button_of_its_own():
    driver = JoyDriver(MAPPING.model_copy(update={"guard_override_button": 3}))
    assert driver.overrides([0, 0, 0, 1])
    assert not driver.overrides([1, 1, 1, 0])
    assert not JoyDriver(MAPPING).overrides([1, 1, 1, 1])


def test_the_built_in_mapping_and_a_file_of_teleop_twist_joy_are_read(tmp_path):
    builtin = load_joy_mapping()
    assert builtin.require_enable_button
    buttons = builtin.enable_button, builtin.enable_turbo_button, builtin.guard_override_button
    assert buttons == (4, 5, 6)
    file = tmp_path / "xbox.yaml"
    keys = "axis_linear: {x: 1}\nscale_linear: {x: 0.7}\naxis_angular: {yaw: 0}\n"
    rest = f"{keys}scale_angular: {{yaw: 0.4}}\nenable_button: 6\n".replace("\n", "\n    ")
    file.write_text(f"teleop_twist_joy_node:\n  ros__parameters:\n    {rest}\n")
    assert load_joy_mapping(file).enable_button == 6
    file.write_text(keys.replace("angular", "angluar"))
    with pytest.raises(FileError, match=rf"^{re.escape(str(file))}\b.*axis_ang"):
        load_joy_mapping(file)


@given(st.lists(st.sampled_from([*MOVES, None]), max_size=20))
def test_a_held_direction_counts_and_after_clear_only_once_a_key_is_pressed_anew(held):
    choice = DirectionChoice()
    assert choice.action == Action.WAIT
    for action in held:
        choice.hold(action)
        assert choice.action == (Action.WAIT if action is None else action)
    choice.clear()
    for action in (Action.NORTH, Action.EAST):
        choice.hold(action)
        assert choice.action == Action.WAIT
    choice.hold(None)
    choice.hold(Action.EAST)
    assert choice.action == Action.EAST
