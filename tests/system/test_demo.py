"""`serd demo` as a user runs it: interrupted, resumed, with a killed node, finished."""

import json
import os
import re
import signal
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

import pytest
from rosbags.highlevel import AnyReader

from serd_bag.reader import BagReader
from serd_cli.demo import report
from serd_cli.main import main
from serd_files.episode_table import load_episodes
from support.changed_scenario import changed_scenario
from support.waiting import PATIENCE_S, descendants_of, wait_until

SERD = str(Path(sys.executable).with_name("serd"))
SMALL = ["--demonstrations", "2", "--episodes", "1", "--seed", "5"]
#: So that an episode takes a moment, and yet is not over before it is interrupted.
NEAR = {
    "train: [[0, 0], [2, 0], [2, 3], [0, 3]]": "train: [[0, 8], [2, 8], [2, 11], [0, 11]]",
    "count: 24": "count: 6",
    "warm_up_s: 10.0": "warm_up_s: 1.0",
}
#: Where many episodes follow, each may take less.
QUICK = {"control_period_s: 0.05": "control_period_s: 0.1", "drive: physical": "drive: kinematic"}
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


def near(folder, further=()):
    """File of the hallway with the changes of NEAR and further ones."""
    return str(changed_scenario(folder, "hallway", NEAR | dict(further)))


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


def test_an_interrupted_demo_leaves_a_readable_bag_and_is_resumed_to_its_report(
    tmp_path, monkeypatch, capsys
):
    run = tmp_path / "demo_output/run-1"
    demo = Demo(tmp_path, *SMALL, "--scenario", near(tmp_path))
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

    # The same command does nothing again but the page, which is drawn already.
    monkeypatch.setattr(report, "write_report", lambda _, folder: folder / "report.html")
    monkeypatch.setattr(sys, "argv", ["serd", "demo", "--resume", str(run), "--json"])
    with pytest.raises(SystemExit, match="0"):
        main()
    summary = json.loads(capsys.readouterr().out)
    assert (summary["n_arrived"], summary["report"]) == (1, str(run / "report.html"))
    # Whole phases, which the node that drives knows only parts of.
    assert summary["wall_s"]["navigate"] > row.wall_s
    factor = summary["real_time_factor"]["navigate"]
    assert factor == row.duration_s / summary["wall_s"]["navigate"]


def nodes_of(demo):
    """Process ids of the nodes that a demo has started, by their names."""
    found = {}
    for pid in descendants_of(demo.process.pid):
        with suppress(OSError):
            words = Path(f"/proc/{pid}/cmdline").read_text().split("\0")
            if "--ros-args" in words:
                found[Path(words[words.index("--ros-args") - 1]).name] = pid
    return found


@pytest.mark.parametrize("name", ["hallway_sim", "scripted_expert"])
def test_a_killed_node_ends_the_demo_with_its_name(tmp_path, name):
    run = tmp_path / "demo_output/run-1"
    demo = Demo(tmp_path, "--demonstrations", "50", "--scenario", near(tmp_path, QUICK))
    demo.wait_for((run / "demonstrations/episodes.csv").exists)
    os.kill(nodes_of(demo)[name], signal.SIGKILL)
    code, log = demo.wait()
    assert code == 1
    assert f"{name} was killed by signal 9" in log
    assert processes_of(tmp_path) == {}


def test_a_killed_demo_leaves_no_node_behind(tmp_path):
    run = tmp_path / "demo_output/run-1"
    demo = Demo(tmp_path, "--demonstrations", "50", "--scenario", near(tmp_path, QUICK))
    demo.wait_for((run / "demonstrations/episodes.csv").exists)
    demo.process.kill()
    demo.process.wait()
    wait_until(lambda: not processes_of(tmp_path), seen=lambda: processes_of(tmp_path))
    # Where the machine was too busy for the recorder to close it, it is whole up to its last chunk.
    assert BagReader(run / "bag", tolerant=True).topics
