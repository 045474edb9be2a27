"""Joystick to velocity as teleop_twist_joy does it."""

import re

import pytest

from serd_app.teleop.joy_mapping import JoyDriver, JoyMapping, load_joy_mapping
from serd_bag.errors import FileError
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


def driver_of(mapping=MAPPING):
    """Its axes have been neutral."""
    driver = JoyDriver(mapping)
    assert driver.command([0.0, 0.0], [0, 0, 0]) in (None, STOP)
    return driver


def test_without_the_enable_button_nothing_is_sent():
    assert JoyDriver(MAPPING).command([1.0, 1.0], [1, 0, 0]) is None


def test_axes_are_scaled_while_enabled_and_letting_go_sends_one_stop():
    driver = driver_of()
    assert driver.command([0.5, 1.0], [0, 1, 0]) == Command(0.5, 1.0)
    assert driver.command([0.5, 1.0], [0, 0, 0]) == STOP
    assert driver.command([0.5, 1.0], [0, 0, 0]) is None


CAR = {"inverted_reverse": True}


@pytest.mark.parametrize(
    ("changes", "axes", "buttons", "command"),
    [
        ({}, [-0.5, 1.0], [0, 0, 1], Command(1.5, -2.0)),  # turbo
        ({}, [1.0, -1.0], [0, 1], Command(-0.5, 2.0)),
        (CAR, [1.0, -1.0], [0, 1], Command(-0.5, -2.0)),
        (CAR, [1.0, 0.0], [0, 1], Command(0.0, 2.0)),
        (CAR, [1.0, 0.2], [0, 1], Command(0.1, 2.0)),
        ({"require_enable_button": False}, [0.0, 1.0], [], Command(0.5, 0.0)),
        ({"enable_button": 0}, [0.0, 1.0], [1, 0, 0], Command(0.5, 0.0)),
        ({"enable_button": 0}, [0.0, 1.0], [0, 1, 0], None),
    ],
)
def test_each_key_of_the_mapping_has_its_effect(changes, axes, buttons, command):
    assert driver_of(MAPPING.model_copy(update=changes)).command(axes, buttons) == command


def test_axes_and_buttons_that_are_missing_count_as_zero():
    assert JoyDriver(MAPPING).command([], [0, 1]) == STOP
    assert JoyDriver(MAPPING).command([1.0, 1.0], []) is None


@pytest.mark.parametrize("stop", [JoyDriver.require_neutral, lambda driver: driver.command([], [])])
def test_after_an_e_stop_or_a_lost_joystick_the_axes_must_return_to_neutral(stop):
    driver = driver_of()
    assert driver.command([0.0, 1.0], [0, 1, 0]) == Command(0.5, 0.0)
    stop(driver)
    for _ in range(3):
        assert driver.command([0.0, 1.0], [0, 1, 0]) == STOP
    assert driver.command([0.0, 1.0], [0, 0, 0]) == STOP
    assert driver.command([0.0, 1.0], [0, 1, 0]) == STOP  # the button alone is not enough
    driver.command([0.05, -0.05], [0, 1, 0])
    assert driver.command([0.0, 1.0], [0, 1, 0]) == Command(0.5, 0.0)


def test_a_message_that_lacks_one_mapped_axis_stops_as_one_without_axes():
    driver = driver_of()
    assert driver.command([0.0], [0, 1, 0]) == STOP
    assert driver.command([0.0, 1.0], [0, 1, 0]) == STOP


@pytest.mark.parametrize("axis", [0, 1])
def test_an_axis_is_neutral_up_to_a_tenth_of_its_deflection(axis):
    driver = JoyDriver(MAPPING)
    for beyond in (0.1001, -0.1001):
        driver.command([beyond if index == axis else 0.0 for index in (0, 1)], [0, 1, 0])
        assert driver.command([0.0, 1.0], [0, 1, 0]) == STOP
    driver.command([0.1, -0.1], [0, 1, 0])
    assert driver.command([0.0, 1.0], [0, 1, 0]) == Command(0.5, 0.0)


def test_axes_that_are_deflected_at_the_start_do_not_drive():
    assert JoyDriver(MAPPING).command([0.0, 1.0], [0, 1, 0]) == STOP


def test_the_built_in_mapping_needs_an_enable_button():
    mapping = load_joy_mapping()
    assert mapping.require_enable_button
    assert mapping.enable_button != mapping.enable_turbo_button


def test_a_file_of_teleop_twist_joy_is_understood(tmp_path):
    file = tmp_path / "xbox.yaml"
    file.write_text(
        "teleop_twist_joy_node:\n  ros__parameters:\n    axis_linear:\n      x: 1\n"
        "    scale_linear:\n      x: 0.7\n    axis_angular:\n      yaw: 0\n"
        "    scale_angular:\n      yaw: 0.4\n    enable_button: 6\n"
    )
    assert load_joy_mapping(file).enable_button == 6


def test_a_wrong_name_in_the_file_is_refused_by_name(tmp_path):
    file = tmp_path / "joy.yaml"
    file.write_text("axis_linear: {x: 1}\nscale_linear: {x: 1.0}\naxis_angluar: {yaw: 0}\n")
    with pytest.raises(FileError, match=rf"^{re.escape(str(file))}\b.*axis_ang"):
        load_joy_mapping(file)


def test_the_override_of_the_guard_is_a_button_of_its_own():
    assert load_joy_mapping().guard_override_button == 6
    driver = JoyDriver(MAPPING.model_copy(update={"guard_override_button": 3}))
    assert driver.overrides([0, 0, 0, 1])
    assert not driver.overrides([1, 1, 1, 0])
    assert not JoyDriver(MAPPING).overrides([1, 1, 1, 1])
