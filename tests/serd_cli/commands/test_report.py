"""`serd report`: from a bag of another robot to a page in three commands, and of other models."""

import json
import re
import shutil
from pathlib import Path

import numpy as np
import pytest

from serd_app.demonstrations.decision_table import load_decisions, save_decisions
from support.bag_messages import Messages
from support.commands import printed_in
from support.foreign_bags import STEP_S, ForeignBag
from support.made_once import made_once

SPEED_MPS = 0.4
#: Dynamics are counted here, so that no demonstration is said to teach most.
FIGURES = {"forecast", "visitation", "policy", "outcomes", "gain"}


def laps(n_laps, rng):
    """(T, 5) time, x, y, yaw, speed: through the door to the goal and back, standing nowhere."""
    way = [(1.0, 1.0), (2.6, 1.2), (3.4, 2.2), (4.7, 2.2), (5.6, 3.4), (6.7, 3.9)]
    points = np.array([way[0]])
    for _ in range(n_laps):
        there = np.array(way[1:]) + rng.normal(0.0, 0.05, (len(way) - 1, 2))
        points = np.concatenate([points, there, np.array(way[-2::-1])])
    steps_m = np.linalg.norm(np.diff(points, axis=0), axis=1)
    at_s = np.concatenate([[0.0], np.cumsum(steps_m) / SPEED_MPS])
    time_s = np.arange(0.0, at_s[-1], STEP_S)
    x, y = (np.interp(time_s, at_s, each) for each in points.T)
    yaw = np.arctan2(np.gradient(y), np.gradient(x))
    return np.stack([time_s, x, y, yaw, np.full(len(time_s), SPEED_MPS)], axis=1)


def foreign_bag(folder):
    """Laps of a robot that publishes odometry and is driven by velocities."""
    track = laps(8, np.random.default_rng(0))
    rate = np.gradient(np.unwrap(track[:, 3]), STEP_S)
    bag = ForeignBag(Messages())
    bag.add_odometry("/odom", track)
    commands = zip(track[::5, 0], rate[::5], strict=True)
    bag.add_commands("/cmd_vel", [(time_s, SPEED_MPS, turn) for time_s, turn in commands])
    return bag.write(folder)


@pytest.fixture(scope="session")
def three_commands(tmp_path_factory):
    """A folder in which three commands were run, and what they printed."""

    def run(folder):
        bag = foreign_bag(folder / "bag")
        printed = (
            printed_in(folder, "bag", "suggest", bag, "--output", "mapping.yaml"),
            printed_in(folder, "demos", bag, "--mapping", "mapping.yaml", "--cell-size-m", "0.5"),
            printed_in(folder, "learn", "decisions.csv", "--report", "report"),
        )
        (folder / "printed.txt").write_text("".join(printed))

    folder = made_once(tmp_path_factory, "three-commands", run)
    return folder, (folder / "printed.txt").read_text()


@pytest.fixture
def learned(serd, three_commands, tmp_path):
    """`serd` in a folder with their files."""
    shutil.copytree(three_commands[0], tmp_path / "here", dirs_exist_ok=True)
    return serd


def shown(page):
    return set(re.findall(r'<figure id="(\w+)">', Path(page).read_text(encoding="utf-8")))


def test_a_bag_of_another_robot_is_a_page_after_three_commands(three_commands):
    folder, printed = three_commands
    page = folder / "report" / "report.html"
    assert "report.html" in printed
    assert shown(page) == FIGURES
    text = page.read_text(encoding="utf-8")
    (headline,) = re.findall(r'<p class="headline">([^<]+)', text)
    assert headline.startswith("The learned way leads through cells that nobody drove")
    summary = json.loads((folder / "report" / "summary.json").read_text())
    assert summary["outcome_probabilities"]["across_flow"][1] > 0.85
    assert summary["predicted_median_s"] == pytest.approx(17.0, abs=0.8)
    assert "<td>16 with " in text
    assert "cells of 0.5 m, patience of 4 s" in text


def test_a_model_is_reported_with_its_drives_and_chosen_starts(learned):
    assert learned("navigate", "model.yaml", "--episodes", 1, "--output", "driven").code == 0
    words = ("--episodes", "driven/episodes.csv", "--start", "3.4,2.2", "--output", "driven/page")
    found = json.loads(learned("report", "model.yaml", *words, "--json").out)
    assert (found["n_episodes"], found["n_demonstrations"]) == (1, 16)
    assert shown(found["report"]) == (FIGURES - {"visitation"}) | {"arrival"}
    assert ">3.4, 2.2</th>" in Path(found["report"]).read_text(encoding="utf-8")


def test_one_demonstration_predicts_nothing_and_its_own_time_is_drawn(learned):
    every = load_decisions("decisions.csv")
    save_decisions("decisions.csv", every.select_episodes(every.episodes[:1]))
    words = ("--minimum-decisions", 5, "--method", "mdce_serd", "--report", "one")
    assert learned("learn", "decisions.csv", *words).code == 0
    found = json.loads(Path("one/summary.json").read_text(encoding="utf-8"))
    (time_s,) = found["recorded_times_s"]
    (reason,) = found["no_prediction_because"]
    assert reason.startswith("1 drive supports no claim but counts")
    printed = learned("report", "model.yaml", "--demonstrations", "decisions.csv").out
    assert f"Recorded arrivals: 1 of them, after {time_s:.0f} s" in printed
    assert "Predicted arrival: none, because" in printed
    assert "is predicted to reach" not in printed
    page = Path("report/report.html").read_text(encoding="utf-8")
    assert "Black: when the recorded drives arrived" in page
    assert "This is no prediction, because 1 drive supports no claim" in page
