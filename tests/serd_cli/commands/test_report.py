"""`serd report`: from a bag of another robot to a page in three commands, and of other models."""

import json
import re
import shutil
from pathlib import Path

import numpy as np
import pytest

from serd_app.demonstrations.decision_table import load_decisions, save_decisions
from serd_files.model_file import load_model
from serd_files.yaml_config import save_yaml_model
from support.bag_messages import Messages
from support.commands import printed_in
from support.foreign_bags import STEP_S, ForeignBag
from tests.serd_cli.test_map_journey import SPEED_MPS, laps

FIGURES = {"forecast", "visitation", "policy", "outcomes", "gain"}


def foreign_bag(folder):
    """Laps of a robot that publishes odometry and is driven by velocities."""
    track = laps(8, np.random.default_rng(0))
    rate = np.gradient(np.unwrap(track[:, 3]), STEP_S)
    bag = ForeignBag(Messages())
    bag.add_odometry("/odom", track)
    commands = zip(track[::5, 0], rate[::5], strict=True)
    bag.add_commands("/cmd_vel", [(time_s, SPEED_MPS, turn) for time_s, turn in commands])
    return bag.write(folder)


@pytest.fixture(scope="module")
def three_commands(tmp_path_factory):
    """A folder in which three commands were run, and what they printed."""
    folder = tmp_path_factory.mktemp("three")
    bag = foreign_bag(folder / "bag")
    printed = [
        printed_in(folder, *words)
        for words in (
            ("bag", "suggest", bag, "--output", "mapping.yaml"),
            ("demos", bag, "--mapping", "mapping.yaml", "--cell-size-m", "0.5"),
            ("learn", "decisions.csv", "--report", "report"),
        )
    ]
    return folder, "".join(printed)


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
    assert "After 8 demonstrations with" in text
    assert "cells of 0.5 m, patience of 4 s" in text


def test_a_model_is_reported_with_its_drives_and_chosen_starts(learned):
    assert learned("navigate", "model.yaml", "--episodes", 1, "--output", "driven").code == 0
    words = ("--episodes", "driven/episodes.csv", "--start", "3.4,2.2", "--output", "driven/page")
    found = json.loads(learned("report", "model.yaml", *words, "--json").out)
    assert (found["n_episodes"], found["n_demonstrations"]) == (1, 8)
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
    assert reason.startswith("a prediction takes at least 3 demonstrations")
    printed = learned("report", "model.yaml", "--demonstrations", "decisions.csv").out
    assert f"Recorded arrivals: 1 of them, after {time_s:.0f} s" in printed
    assert "Predicted arrival: none, because" in printed
    assert f", which arrived after {time_s:.0f} s, the arrival of the robot is not" in printed
    assert "is predicted to reach" not in printed
    page = Path("report/report.html").read_text(encoding="utf-8")
    assert "Black: when the recorded drives arrived" in page
    assert "This is no prediction, because a prediction takes" in page


def test_a_model_that_shuns_the_goal_predicts_nothing_and_is_reported_with_what_drives(learned):
    model = load_model("model.yaml")
    weights = {**dict.fromkeys(model.feature_names, 0.0), "goal": -1.0}
    save_yaml_model(Path("model.yaml"), model.model_copy(update={"reward_weights": weights}))
    ended = learned("report", "model.yaml", "--demonstrations", "decisions.csv", "--json")
    found = json.loads(ended.out)
    assert found["n_least_time_states"] > 20
    assert found["n_trap_states"] == 0
    assert found["no_prediction_because"][0].startswith("the learned policy does not arrive from")
    assert "the way of least expected time is taken instead" in found["plan_remarks"][-1]


def test_a_model_of_an_older_version_is_reported_without_the_norm_of_a_place_without_people(
    learned,
):
    model = load_model("model.yaml")
    rows = tuple((*row, 7.1) for row in model.draws.reward_weights)
    changes = {
        "reward_weights": {**model.reward_weights, "social_norm": 7.1},
        "draws": model.draws.model_copy(update={"reward_weights": rows}),
    }
    save_yaml_model(Path("model.yaml"), model.model_copy(update=changes))
    found = json.loads(learned("report", "model.yaml", "--json").out)
    assert set(found["reward_weights"]) == {"goal", "inverse_wall_distance"}
    assert found["plan_remarks"][0].startswith("the model's weight of social_norm is not used")
