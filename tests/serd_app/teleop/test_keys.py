"""Keys of a terminal: names, velocities as teleop_twist_keyboard has them, and the raw terminal."""

import os
import pty
import termios

import pytest
from hypothesis import given
from hypothesis import strategies as st

from serd_app.errors import TeleopError
from serd_app.teleop.keyboard import KeyPresses, VelocityKeys
from serd_app.teleop.terminal import KeyNames, RawTerminal
from serd_sim.world.command import STOP, Command
from support.waiting import wait_until


def test_bytes_become_names():
    assert KeyNames().feed(b"i \r\t\x1b[A\x1bOBd") == [
        "i", "space", "enter", "tab", "up", "down", "d",
    ]  # fmt: skip


def test_an_arrow_that_comes_in_pieces_is_one_key():
    names = KeyNames()
    assert names.feed(b"\x1b") == []
    assert names.feed(b"[") == []
    assert names.feed(b"C") == ["right"]


def test_escape_alone_is_a_key_once_nothing_follows():
    names = KeyNames()
    assert names.feed(b"\x1b") == []
    assert names.feed(b"") == ["escape"]
    assert names.feed(b"") == []


def test_sequences_of_other_keys_are_passed_over():
    assert KeyNames().feed(b"\x1b[1;5A\x1b[3~s") == ["s"]


@given(st.binary(max_size=40))
def test_any_bytes_end_in_names_and_nothing_is_kept_for_ever(data):
    names = KeyNames()
    names.feed(data)
    names.feed(b"")
    assert names.feed(b"k") == ["k"]


@pytest.mark.parametrize(
    ("key", "linear", "angular"),
    [
        ("i", 0.5, 0.0), ("o", 0.5, -1.0), ("j", 0.0, 1.0), ("l", 0.0, -1.0), ("u", 0.5, 1.0),
        (",", -0.5, 0.0), (".", -0.5, 1.0), ("m", -0.5, -1.0), ("k", 0.0, 0.0), ("y", 0.0, 0.0),
    ],
)  # fmt: skip
def test_keys_drive_as_in_teleop_twist_keyboard(key, linear, angular):
    keys = VelocityKeys(0.5, 1.0, 0.5)
    keys.press(key, 3.0)
    assert keys.command(3.2) == Command(linear, angular)


def test_a_key_drives_by_the_present_speeds_from_the_moment_it_is_pressed():
    keys = VelocityKeys(0.5, 2.0, 0.5)
    keys.press("u", 3.0)
    assert keys.command(3.0) == Command(0.5, 2.0)
    keys.press("e", 3.1)
    assert keys.command(3.2) == Command(0.5, pytest.approx(2.2))


def test_a_key_counts_no_longer_when_the_clock_went_backwards():
    keys = VelocityKeys(0.5, 1.0, 0.5)
    keys.press("i", 3.0)
    assert [keys.command(2.9), keys.command(3.1)] == [STOP, None]


def test_a_key_without_repeat_ends_in_one_stop_and_then_silence():
    keys = VelocityKeys(0.5, 1.0, 0.5)
    assert keys.command(0.0) is None
    keys.press("i", 3.0)
    assert keys.command(3.5) == Command(0.5, 0.0)
    assert keys.command(3.51) == STOP
    assert keys.command(3.6) is None


def test_speeds_change_by_a_tenth_and_do_not_move_the_robot():
    keys = VelocityKeys(0.5, 1.0, 0.5)
    for key in "qwx":
        keys.press(key, 0.0)
    assert (keys.speed_mps, keys.turn_radps) == pytest.approx((0.5 * 1.1 * 1.1 * 0.9, 1.1))
    assert keys.command(0.1) is None


def test_a_key_that_repeats_through_a_stop_counts_after_it_was_released():
    presses = KeyPresses()
    assert presses.admit(3.0)
    presses.require_release()
    repeats_s = [3.66 + 0.04 * count for count in range(100)]
    assert not any(presses.admit(now_s) for now_s in repeats_s)
    assert presses.admit(repeats_s[-1] + 0.8)
    assert presses.admit(repeats_s[-1] + 0.84)


def test_a_pause_of_exactly_the_delay_of_key_repeat_is_no_release():
    presses = KeyPresses()
    assert presses.admit(0.0)
    presses.require_release()
    assert not presses.admit(0.7)
    assert presses.admit(1.5)


def test_after_a_stop_without_keys_the_first_key_counts():
    presses = KeyPresses()
    presses.require_release()
    assert presses.admit(5.0)


def test_a_released_key_sends_nothing():
    keys = VelocityKeys(0.5, 1.0, 0.5)
    keys.press("i", 3.0)
    keys.release()
    assert keys.command(3.1) is None


@pytest.fixture
def terminal():
    """Both ends of a pseudo terminal: (the person's end, the device's name)."""
    person, device = pty.openpty()
    yield person, os.ttyname(device)
    os.close(person)
    os.close(device)


def settings_of(device):
    fd = os.open(device, os.O_RDONLY | os.O_NOCTTY)
    try:
        return termios.tcgetattr(fd)
    finally:
        os.close(fd)


def test_the_terminal_gives_keys_at_once_and_is_put_back_as_it_was(terminal):
    person, device = terminal
    before = settings_of(device)
    raw = RawTerminal(device)
    assert settings_of(device) != before
    assert raw.read() == b""
    os.write(person, b"i\x1b[A")
    typed = bytearray()

    def read():
        typed.extend(raw.read())
        return len(typed) >= 4

    wait_until(read)
    assert typed == b"i\x1b[A"
    raw.close()
    raw.close()
    assert settings_of(device) == before


def test_a_terminal_is_put_back_when_its_user_fails(terminal):
    _, device = terminal
    before = settings_of(device)
    with pytest.raises(ZeroDivisionError), RawTerminal(device):
        raise ZeroDivisionError
    assert settings_of(device) == before


def test_a_terminal_that_went_away_reads_as_none():
    person, device = pty.openpty()
    raw = RawTerminal(os.ttyname(device))
    os.close(device)
    os.close(person)
    assert raw.read() is None
    raw.close()


@pytest.mark.parametrize("device", ["/dev/null", "/nowhere/tty"])
def test_what_is_no_terminal_is_refused_with_the_fix(device):
    with pytest.raises(TeleopError, match=f"got {device} .*; start it in a terminal window"):
        RawTerminal(device)
