"""A silent or broken commander stops the robot."""

import math

from serd_sim.world.command import STOP, Command, CommandGuard

DRIVE = Command(0.5, 0.1)


def test_nothing_received_means_stop():
    assert CommandGuard().current(3.0) == STOP


def test_a_fresh_command_passes_and_an_old_one_becomes_a_stop_after_half_a_second():
    guard = CommandGuard()
    guard.receive(DRIVE, 10.0)
    assert guard.current(10.5) == DRIVE
    assert guard.current(10.55) == STOP
    assert guard.is_stale(10.55)


def test_a_command_that_is_not_finite_is_a_stop_and_is_counted():
    guard = CommandGuard()
    guard.receive(DRIVE, 1.0)
    guard.receive(Command(math.nan, 0.0), 1.05)
    assert guard.current(1.05) == STOP
    assert guard.n_rejected == 1


def test_a_clock_that_went_backwards_means_stop():
    guard = CommandGuard()
    guard.receive(DRIVE, 10.0)
    assert guard.current(9.0) == STOP
