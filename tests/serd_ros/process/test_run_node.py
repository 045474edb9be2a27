"""A node that is told to stop ends between two callbacks, whenever that is."""

import os
import signal

import pytest

from serd_ros.process.run_node import _ToldToStop


class Finishing:
    """The part of a node that matters here."""

    finished = False

    def finish(self) -> None:
        self.finished = True


@pytest.fixture(params=[signal.SIGINT, signal.SIGTERM])
def number(request):
    before = {each: signal.getsignal(each) for each in (signal.SIGINT, signal.SIGTERM)}
    yield request.param
    for each, handler in before.items():
        signal.signal(each, handler)


def test_told_while_it_is_being_made_a_node_ends_once_it_is(number):
    told, node = _ToldToStop(), Finishing()
    os.kill(os.getpid(), number)
    assert not node.finished
    told.finishes(node)
    assert node.finished


def test_told_later_it_ends_and_a_second_signal_interrupts(number):
    told, node = _ToldToStop(), Finishing()
    told.finishes(node)
    assert not node.finished
    os.kill(os.getpid(), number)
    assert node.finished
    with pytest.raises(KeyboardInterrupt):
        os.kill(os.getpid(), number)
