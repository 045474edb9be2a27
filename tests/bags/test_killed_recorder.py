"""SIGKILL while recording costs at most half a second of data."""

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


@pytest.mark.slow
def test_a_killed_recorder_loses_less_than_half_a_second(tmp_path):
    rng = np.random.default_rng(20)
    for number in range(5):
        command = [sys.executable, "-c", _RECORD, str(tmp_path / str(number))]
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
            waited = None
            for _ in range(rng.integers(15, 45)):
                assert process.stdout.readline() == "written\n"
                waited = waited or ProcessorWait()
            waited_s = waited.total_s
            process.kill()
            killed_ns = time.time_ns()
        reader = BagReader(tmp_path / str(number), tolerant=True)
        times_ns = [message.log_time_ns for message in reader.messages()]
        assert reader.damage
        assert np.all(np.diff(times_ns) >= 0)
        assert (killed_ns - times_ns[-1]) * 1e-9 - waited_s < 0.5
