"""`serd` without the extra `sim`: what a robot needs works, the rest says what to install."""

import subprocess
import sys

import pytest

#: Refuses what the extras install, then runs a statement.
WITHOUT = """
import importlib.abc, sys

class Without(importlib.abc.MetaPathFinder):
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in {"matplotlib", "pybullet"}:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)

sys.meta_path.insert(0, Without())
"""


SERD = "from serd_cli.main import main; sys.exit(main())"


def run(statement, *words, **options):
    program = f"{WITHOUT}sys.argv[1:] = {list(words)!r}\n{statement}"
    return subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, **options
    )


def test_what_runs_on_a_robot_needs_neither_simulator_nor_figures():
    modules = [
        f"serd_ros.nodes.{name}"
        for name in (
            "bag_replay", "demo_recorder", "guard", "learner", "local_planner",
            "nav2_bridge", "people_tracker", "scripted_expert", "strategy", "teleop_mux",
            "teleop_page", "watch_page",
        )
    ]  # fmt: skip
    ended = run("".join(f"import {each}\n" for each in modules))
    assert ended.returncode == 0, ended.stderr


@pytest.mark.parametrize(
    ("statement", "words", "code", "library"),
    [
        (SERD, ["scenario", "show", "hallway", "--output", "plan.png"], 2, "serd: matplotlib"),
        (SERD, ["batch", "--scenario", "hallway", "--output", "runs.csv"], 2, "serd: pybullet"),
        (
            "from serd_ros.process.executable import run; run('hallway_sim')", [], 1,
            "hallway_sim: pybullet",
        ),
    ],
)  # fmt: skip
@pytest.mark.ros
def test_a_command_and_a_node_say_which_extra_they_need(
    statement, words, code, library, tmp_path, ros_env
):
    ended = run(statement, *words, cwd=tmp_path, env=ros_env)
    assert ended.returncode == code
    expected = f"{library} is not installed; run: pip install 'serd[sim]'"
    assert expected in ended.stderr.replace("\n", " ")


def test_a_table_is_written_where_no_picture_can_be_drawn(tmp_path):
    rows = [f"{agent},{t / 2:.1f},{t / 2:.2f},1.0" for agent in range(3) for t in range(12)]
    (tmp_path / "walk.csv").write_text("\n".join(["agent,time,x,y", *rows]) + "\n")
    ended = run(SERD, "demos", "walk.csv", cwd=tmp_path)
    assert ended.returncode == 0, ended.stderr
    assert "no picture is drawn: matplotlib is not installed" in ended.stderr.replace("\n", " ")
    assert (tmp_path / "decisions.csv").exists()
    assert not (tmp_path / "decisions.png").exists()
