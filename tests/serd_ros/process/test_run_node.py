"""A node ends between two callbacks after a signal, whenever the signal arrives."""

import os
import signal

import pytest

from serd_ros.process.run_node import _StopSignal


@pytest.fixture(params=[signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def number(request):
    before = {
        each: signal.getsignal(each) for each in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
    }
    yield request.param
    for each, handler in before.items():
        signal.signal(each, handler)


def test_the_first_signal_is_noted_and_the_second_interrupts(number):
    stop = _StopSignal()
    assert not stop.received
    os.kill(os.getpid(), number)
    assert stop.received
    with pytest.raises(KeyboardInterrupt):
        os.kill(os.getpid(), number)
