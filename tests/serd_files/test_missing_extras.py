"""`serd` without the extra `sim`: what a robot needs works, the rest says what to install."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

#: Refuses what the extras install, then runs a statement.
WITHOUT = """
import importlib.abc, sys

class Without(importlib.abc.MetaPathFinder):
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in {"imageio_ffmpeg", "matplotlib", "pybullet"}:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)

sys.meta_path.insert(0, Without())
"""


def run(statement, *words):
    program = f"{WITHOUT}sys.argv[1:] = {list(words)!r}\n{statement}"
    return subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, env=dict(os.environ)
    )


def test_what_runs_on_a_robot_needs_neither_simulator_nor_figures():
    modules = [
        f"serd_ros.nodes.{name}"
        for name in (
            "bags.bag_replay", "bags.demo_recorder", "guard", "learner", "local_planner",
            "nav2_bridge", "people_tracker", "scripted_expert", "strategy", "teleop.joy",
            "teleop.mux", "teleop.page", "watch_page",
        )
    ]  # fmt: skip
    ended = run("".join(f"import {each}\n" for each in modules))
    assert ended.returncode == 0, ended.stderr


@pytest.mark.parametrize(
    ("words", "library"),
    [
        (["scenario", "show", "hallway", "--output", "plan.png"], "matplotlib"),
        (["batch", "--scenario", "hallway", "--output", "runs.csv"], "pybullet"),
    ],
)
def test_a_command_says_which_extra_it_needs(words, library, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    ended = run("from serd_cli.main import main; sys.exit(main())", *words)
    assert ended.returncode == 2
    expected = f"serd: {library} is not installed; run: pip install 'serd[sim]'"
    assert expected in ended.stderr.replace("\n", " ")


@pytest.mark.ros
def test_the_simulators_node_says_which_extra_it_needs(ros_env):
    program = "from serd_ros.process.executable import run; run('hallway_sim')"
    ended = subprocess.run(
        [sys.executable, "-c", WITHOUT + program],
        capture_output=True,
        text=True,
        env=ros_env,
    )
    assert ended.returncode == 1
    assert "hallway_sim: pybullet is not installed; run: pip install 'serd[sim]'" in ended.stderr


def test_a_table_is_written_where_no_picture_can_be_drawn(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    rows = [f"{agent},{t / 2:.1f},{t / 2:.2f},1.0" for agent in range(3) for t in range(12)]
    Path("walk.csv").write_text("\n".join(["agent,time,x,y", *rows]) + "\n")
    ended = run("from serd_cli.main import main; sys.exit(main())", "demos", "walk.csv")
    assert ended.returncode == 0, ended.stderr
    assert "no picture is drawn: matplotlib is not installed" in ended.stderr.replace("\n", " ")
    assert Path("decisions.csv").exists()
    assert not Path("decisions.png").exists()
