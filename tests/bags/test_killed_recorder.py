"""SIGKILL while recording costs at most half a second of data."""

import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from serd_bag.reader import BagReader
from support.waiting import ProcessorWait

_RECORD = """
import sys, time
from serd_bag.writer import BagWriter
writer = BagWriter(sys.argv[1], flush_period_s=0.25)
for topic in range(20):
    writer.add_topic(f"/topic_{topic}", "geometry_msgs/msg/PoseStamped")
while True:
    for topic in range(20):
        writer.write(f"/topic_{topic}", bytes(96), time.time_ns())
    writer.flush_if_due()
    print("written", flush=True)
    time.sleep(0.02)
"""


def recorder(folder):
    """A process that records 20 topics at 50 Hz and prints a line for each round."""
    command = [sys.executable, "-c", _RECORD, str(folder)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert process.stdout.readline() == "written\n"
    return process


def killed_at(process):
    """Kill it; when that was, ns."""
    process.send_signal(signal.SIGKILL)
    killed_ns = time.time_ns()
    with process:
        process.wait()
    return killed_ns


def lost_s(folder, killed_ns):
    """Time between the last message in the bag and the kill."""
    reader = BagReader(folder, tolerant=True)
    times_ns = [message.log_time_ns for message in reader.messages()]
    assert reader.damage
    assert np.all(np.diff(times_ns) >= 0)
    return (killed_ns - times_ns[-1]) * 1e-9


@pytest.mark.slow
def test_a_killed_recorder_loses_less_than_half_a_second(tmp_path):
    rng = np.random.default_rng(20)
    losses_s = []
    for number in range(20):
        process, waited = recorder(tmp_path / str(number)), ProcessorWait()
        for _ in range(rng.integers(15, 45)):
            assert process.stdout.readline() == "written\n"
        waited_s = waited.total_s
        losses_s.append(lost_s(tmp_path / str(number), killed_at(process)) - waited_s)
    assert len(losses_s) == 20
    assert max(losses_s) < 0.5
