"""`serd demo` as a user runs it: interrupted, resumed, finished."""

import json
import os
import re
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from rosbags.highlevel import AnyReader

from serd_files.table import load_episodes
from support.changed_scenario import changed_scenario
from support.waiting import PATIENCE_S, wait_until

SERD = str(Path(sys.executable).with_name("serd"))
SMALL = ["--demonstrations", "2", "--episodes", "1", "--seed", "5"]
#: So that an episode takes a moment, and yet is not over before it is interrupted.
NEAR = {
    "train: [[0, 0], [2, 0], [2, 3], [0, 3]]": "train: [[0, 8], [2, 8], [2, 11], [0, 11]]",
    "count: 24": "count: 6",
    "warm_up_s: 10.0": "warm_up_s: 1.0",
}
pytestmark = [pytest.mark.ros, pytest.mark.slow]


class Demo:
    """A demo in a separate process."""

    def __init__(self, folder, *arguments):
        self._log = folder / "demo.log"
        with self._log.open("wb") as log:
            self.process = subprocess.Popen(
                [SERD, "demo", *arguments], cwd=folder, stdout=log, stderr=subprocess.STDOUT
            )

    def wait(self):
        code = self.process.wait(2 * PATIENCE_S)  # resumed, it learns and drives
        return code, self._log.read_text()

    def wait_for(self, condition):
        def running_and_condition():
            assert self.process.poll() is None, self._log.read_text()
            return condition()

        wait_until(running_and_condition, seen=self._log.read_text)


def processes_of(folder):
    """Ids and command lines of all processes that work in this folder."""
    found = {}
    for entry in Path("/proc").glob("[0-9]*"):
        try:
            words = (entry / "cmdline").read_text().split("\0")
        except OSError:
            continue
        if any(str(folder) in word for word in words) and int(entry.name) != os.getpid():
            found[int(entry.name)] = " ".join(words)
    return found


def shared_memory_of(pids):
    """DDS segments these processes have mapped; /dev/shm itself also shows those of others."""
    maps = (Path(f"/proc/{pid}/maps").read_text() for pid in pids)
    return {line for text in maps for line in text.splitlines() if "/dev/shm/fast" in line}


def test_an_interrupted_demo_leaves_a_readable_bag_and_is_resumed_to_its_report(tmp_path):
    run = tmp_path / "demo_output/run-1"
    demo = Demo(tmp_path, *SMALL, "--scenario", str(changed_scenario(tmp_path, "hallway", NEAR)))
    demo.wait_for((run / "demonstrations/episodes.csv").exists)
    nodes = processes_of(tmp_path)
    assert len(nodes) >= 2
    assert shared_memory_of(nodes) == set()
    demo.process.send_signal(signal.SIGINT)
    code, log = demo.wait()
    assert code == 130
    assert f"serd demo --resume {run}" in log
    assert "2 demonstrations and 1 episode through ROS 2" in log
    assert "watch the drives at http://127.0.0.1:" in log
    assert processes_of(tmp_path) == {}
    with AnyReader([run / "bag"]) as reader:
        assert reader.message_count > 1000

    code, log = Demo(tmp_path, "--resume", str(run)).wait()
    assert code == 0, log
    assert processes_of(tmp_path) == {}
    assert log.splitlines()[-1] == f"report: {run / 'report.html'}"
    (row,) = load_episodes(run / "navigation/episodes.csv")
    assert row.outcome == "arrived"
    page = (run / "report.html").read_text()
    assert len(re.findall(r"<figure", page)) >= 6
    for name in ("bag/metadata.yaml", "bag.partial-1/metadata.yaml", "model.yaml", "decisions.csv"):
        assert (run / name).is_file(), name
    assert json.loads((run / "foxglove.json").read_text())["configById"]
    assert 'href="foxglove.json"' in page
