"""SIGKILL while recording costs at most half a second of data."""

import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from bags.reader import BagReader

_RECORD = """
import sys, time
from bags.writer import BagWriter
writer = BagWriter(sys.argv[1], flush_period_s=0.25)
for topic in range(20):
    writer.add_topic(f"/topic_{topic}", "geometry_msgs/msg/PoseStamped")
print("recording", flush=True)
while True:
    for topic in range(20):
        writer.write(f"/topic_{topic}", bytes(96), time.time_ns())
    writer.flush_if_due()
    time.sleep(0.02)
"""


def recorded_until_killed(folder, after_s):
    """(log times of what is left, when it was killed), ns."""
    process = subprocess.Popen(
        [sys.executable, "-c", _RECORD, str(folder)], stdout=subprocess.PIPE, text=True
    )
    with process:
        assert process.stdout.readline() == "recording\n"
        time.sleep(after_s)
        process.send_signal(signal.SIGKILL)
        killed_ns = time.time_ns()
    reader = BagReader(folder, tolerant=True)
    times_ns = [message.log_time_ns for message in reader.messages()]
    assert reader.damage
    return times_ns, killed_ns


@pytest.mark.slow
def test_a_killed_recorder_loses_less_than_half_a_second(tmp_path):
    rng = np.random.default_rng(20)
    for number, after_s in enumerate(rng.uniform(0.6, 1.2, size=20)):
        times_ns, killed_ns = recorded_until_killed(tmp_path / str(number), after_s)
        assert (killed_ns - max(times_ns)) * 1e-9 < 0.5
        assert np.all(np.diff(times_ns) >= 0)
