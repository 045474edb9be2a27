"""`serd navigate`: predicted against measured, goals, resuming, and what is refused."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import serd_sim.scenario.scenario
from serd_app.navigation.evaluation.comparison import compare, predicted_law
from serd_app.navigation.navigator import load_arrivals
from serd_app.navigation.settings import DriveSettings
from serd_bag.quantities import counted
from serd_cli.output.arrival import remarks
from serd_files.episode_table import load_episodes
from serd_sim.drivers.strategy import load_strategy
from serd_sim.scenario.goal import with_goal
from serd_sim.scenario.scenario import load_scenario
from support.episodes import episode_result


def test_it_drives_to_a_goal_and_prints_predicted_and_measured(serd, save_model_of):
    found = serd(
        "navigate", save_model_of(), "--goal", "4.5,6.5", "--episodes", "2", "--json"
    ).values
    assert found["outcomes"] == {"arrived": 2}
    assert found["goal"] == "4.5,6.5"
    assert found["predicted_probability"] == pytest.approx(1.0)
    assert 3.0 < found["measured_median_s"] < 40.0
    assert found["crps_s"] > 0.0
    assert 0.0 < found["gap_probability"] <= 1.0
    assert found["n_trap_states"] == 0


def test_the_table_says_what_the_numbers_are_of(serd, save_model_of):
    path = save_model_of("corridor")
    done = serd(
        "navigate", path, "--scenario", "hallway", "--transfer", "--goal", "1.5,5.5",
        "--episodes", "1",
    )  # fmt: skip
    assert done.code == 0, done.err
    for words in (
        "arrives in time",
        "half of all by",
        "1 episode: 1 arrived; contacts: robot into people",
        "the model was learned on another grid",
        "nine in ten between",
        "if the prediction is right",
    ):
        assert words in done.out


def test_a_trapped_policy_drives_the_way_of_least_time_and_its_cells_are_counted(
    serd, save_model_of
):
    path = save_model_of(reward_weights={"goal": 0.1, "inverse_wall_distance": -5.0})
    done = serd("navigate", path, "--episodes", "1")
    assert done.code == 0, done.err
    words = " ".join(done.out.split())
    assert "1 episode: 1 arrived" in words
    assert "cells the way of least expected time is taken instead" in words


def test_an_interrupted_drive_goes_on_where_it_stopped_with_the_same_result(
    serd, save_model_of, tmp_path
):
    path = save_model_of()
    given = ("--goal", "4.5,5.5")
    whole, parts = tmp_path / "whole", tmp_path / "parts"
    assert serd("navigate", path, *given, "--episodes", "3", "--output", whole).code == 0
    assert serd("navigate", path, *given, "--episodes", "1", "--output", parts).code == 0
    assert serd("navigate", path, *given, "--episodes", "3", "--output", parts).code == 0
    assert load_arrivals(parts / "arrivals.csv") == load_arrivals(whole / "arrivals.csv")
    times_s = [
        [row.time_of_arrival_s for row in load_episodes(folder / "episodes.csv")]
        for folder in (parts, whole)
    ]
    assert times_s[0] == times_s[1]


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (("--goal", "9,3"), "goal must be in a walkable cell"),
        (("--goal", "north"), "goal must be two numbers"),
        (("--start-area", "trian"), "did you mean 'train'?"),
        (("--scenario", "corridor"), "was made for another grid of the scenario 'hallway'"),
        (("--planner", "dva"), "did you mean 'dwa'?"),
    ],
)
def test_what_cannot_be_driven_is_said_before_anything_drives(
    serd, save_model_of, words, sentence, tmp_path
):
    refusal = " ".join(
        serd("navigate", save_model_of(), *words, "--output", tmp_path / "new").refusal.split()
    )
    assert sentence in refusal
    assert not (tmp_path / "new").exists()


def test_a_folder_of_another_drive_is_refused(serd, save_model_of, tmp_path):
    path, folder = save_model_of(), tmp_path / "drive"
    assert serd(
        "navigate", path, "--goal", "4.5,4.5", "--episodes", "1", "--output", folder
    ).code == 0  # fmt: skip
    refusal = serd("navigate", path, "--goal", "4.5,5.5", "--output", folder).refusal
    message = " ".join(refusal.split())
    assert "was begun with goal = '4.5,4.5', but '4.5,5.5' is given; give another folder" in message
    (tmp_path / "full").mkdir()
    (tmp_path / "full/notes.txt").write_text("mine")
    assert serd("navigate", path, "--output", tmp_path / "full").code == 2


def test_a_folder_begun_with_other_content_of_the_same_files_is_refused(
    serd, save_model_of, tmp_path
):
    folder, scenario = tmp_path / "drive", tmp_path / "own.yaml"
    built_in = Path(serd_sim.scenario.scenario.__file__).parent / "scenarios" / "hallway.yaml"
    scenario.write_text(built_in.read_text())
    path = save_model_of()
    words = ("--scenario", scenario, "--goal", "4.5,4.5", "--episodes", "1", "--output", folder)
    assert serd("navigate", path, *words).code == 0
    save_model_of(reward_weights={"goal": 4.0, "social_norm": 1.0, "inverse_wall_distance": 0.0})
    refusal = " ".join(serd("navigate", path, *words).refusal.split())
    assert f"must hold drives of {path} as it is now" in refusal
    save_model_of()
    assert serd("navigate", path, *words).code == 0
    scenario.write_text(scenario.read_text().replace("radius_m: 0.25", "radius_m: 0.2"))
    refusal = " ".join(serd("navigate", path, *words).refusal.split())
    assert f"must hold drives of {scenario} as it is now" in refusal


def test_it_drives_among_as_many_people_as_asked_for_and_says_so(serd, save_model_of, tmp_path):
    words = (save_model_of(), "--goal", "4.5,4.5", "--episodes", "1", "--output", tmp_path / "few")
    done = serd("navigate", *words, "--people", "3")
    assert done.code == 0, done.err
    assert "driven among 3 people; the model does not keep among how many" in done.out
    refusal = " ".join(serd("navigate", *words).refusal.split())
    assert "was begun with people = 3, but None is given" in refusal
    assert serd("navigate", *words, "--people", "0").code == 2


def row(episode, time_s, reason=""):
    outcome = "arrived" if np.isfinite(time_s) else "aborted"
    arrival_s = time_s if np.isfinite(time_s) else np.nan
    return episode_result(episode, outcome, arrival_s, person_on_robot=1, reason=reason)


def test_a_comparison_counts_those_who_gave_up_as_not_arrived(save_model_of):
    settings = DriveSettings(model=str(save_model_of()), scenario="hallway")
    strategy = load_strategy(settings.model, load_scenario("hallway"), "optimal")
    rows = [row(0, 50.0), row(1, 60.0), row(2, np.inf, "no progress"), row(3, 70.0)]
    found = compare(strategy, settings.start_area, rows)
    assert (found.n_arrived, found.measured_probability) == (3, 0.75)
    assert found.outcomes == {"arrived": 3, "aborted (no progress)": 1}
    assert found.measured_median_s == 60.0
    assert found.measured_most_s is None
    assert found.person_on_robot == 4
    assert any(
        "1 aborted (no progress)" in line
        for line in remarks(found, strategy.scenario.patience_remark)
    )
    assert counted(4, "episode") in "".join(remarks(found, strategy.scenario.patience_remark))


def test_times_drawn_from_the_prediction_agree_with_it_and_late_ones_do_not(save_model_of):
    model = str(save_model_of())
    settings = DriveSettings(model=model, scenario="hallway", goal="4.5,10.5")
    scenario = with_goal(load_scenario("hallway"), settings.goal)
    strategy = load_strategy(settings.model, scenario, "optimal")
    law = predicted_law(strategy, "train")
    place = np.searchsorted(law.cdf, np.random.default_rng(5).random(300), side="right")
    drawn_s = law.times_s[place]
    right, late = (
        compare(strategy, "train", [row(i, time_s) for i, time_s in enumerate(factor * drawn_s)])
        for factor in (1.0, 1.3)
    )
    # Dvoretzky-Kiefer-Wolfowitz: exceeded once in 10^6.
    assert right.largest_gap < np.sqrt(np.log(2e6) / (2 * 300)) < late.largest_gap
    assert right.gap_probability > 0.01 > late.gap_probability
    assert 1.0 < right.detectable_delay < 1.3
    assert right.crps_s < late.crps_s
    # Binomial, at 5 standard deviations.
    assert abs(right.covered - 0.9) < 5 * np.sqrt(0.09 / 300)
    low_s, high_s = right.predicted_band_s
    assert low_s < right.predicted_median_s < high_s
    assert right.covered == np.mean((drawn_s >= low_s - 1e-9) & (drawn_s <= high_s + 1e-9))


def test_remarks_state_the_test_with_its_power(save_model_of):
    strategy = load_strategy(str(save_model_of()), load_scenario("hallway"), "optimal")
    found = compare(strategy, "train", [row(0, 30.0), row(1, 35.0), row(2, 40.0)])
    first = remarks(found, strategy.scenario.patience_remark)[0]
    for number in (found.largest_gap, found.gap_probability, found.detectable_delay, found.crps_s):
        assert f"{number:.2f}" in first
    blind = replace(found, detectable_delay=None)
    assert (
        "not even drives that take three times as long would be noticed"
        in remarks(blind, strategy.scenario.patience_remark)[0]
    )
