"""`serd navigate`: predicted against measured, goals, resuming, and what is refused."""

import numpy as np
import pytest

from serd_app.navigation.comparison import compare, predicted_law
from serd_app.navigation.navigator import ArrivalRow
from serd_app.navigation.settings import DriveSettings
from serd_cli.output.arrival import remarks
from serd_files.table import load_episodes, read_rows
from serd_files.yaml_config import model_yaml
from serd_sim.drivers.strategy import load_strategy
from serd_sim.scenario.grid import with_goal
from serd_sim.scenario.scenario import load_scenario
from support.episodes import episode_result

NEAR = ("--goal", "4.5,4.5", "--episodes", "1")


def test_it_drives_to_a_goal_and_prints_predicted_and_measured(serd, save_model_of):
    words = ("navigate", save_model_of(), "--goal", "4.5,6.5", "--episodes", "2", "--json")
    values = serd(*words).values
    assert values["outcomes"] == {"arrived": 2}
    assert values["goal"] == "4.5,6.5"
    assert values["predicted_probability"] == pytest.approx(1.0)
    assert 3.0 < values["measured_median_s"] < 40.0
    assert values["crps_s"] > 0.0
    assert 0.0 < values["gap_probability"] <= 1.0
    assert values["n_trap_states"] == 0


def test_the_table_says_what_the_numbers_are_of(serd, save_model_of):
    path = save_model_of("corridor")
    words = ("--scenario", "hallway", "--transfer", "--goal", "1.5,5.5", "--episodes", "1")
    ended = serd("navigate", path, *words)
    assert ended.code == 0, ended.err
    for sentence in (
        "arrives in time",
        "half of all by",
        "1 episode: 1 arrived; contacts: robot into people",
        "the model was learned on another grid",
        "nine in ten between",
        "if the prediction is right",
    ):
        assert sentence in ended.out


def test_an_interrupted_drive_goes_on_where_it_stopped_with_the_same_result(
    serd, save_model_of, tmp_path
):
    path = save_model_of()
    whole, parts = tmp_path / "whole", tmp_path / "parts"
    for folder, episodes in ((whole, 2), (parts, 1), (parts, 2)):
        words = ("--goal", "4.5,4.5", "--episodes", episodes, "--output", folder)
        assert serd("navigate", path, *words).code == 0
    one, other = (
        (
            read_rows(folder / "arrivals.csv", ArrivalRow),
            [row.time_of_arrival_s for row in load_episodes(folder / "episodes.csv")],
        )
        for folder in (parts, whole)
    )
    assert one == other


def test_a_folder_of_another_drive_is_refused(serd, save_model_of, tmp_path):
    folder, scenario = tmp_path / "drive", tmp_path / "own.yaml"
    scenario.write_text(model_yaml(load_scenario("hallway")))
    path = save_model_of()
    words = ("navigate", path, "--scenario", scenario, *NEAR, "--output", folder)
    ended = serd(*words, "--people", "3")
    assert ended.code == 0, ended.err
    assert "driven among 3 people; the model does not keep among how many" in ended.out
    words = (*words, "--people", "3")
    assert "was begun with people = 3, but None is given" in serd(*words[:-2]).refusal
    sentence = "was begun with goal = '4.5,4.5', but '4.5,5.5' is given; give another folder"
    assert sentence in serd(*words, "--goal", "4.5,5.5").refusal
    save_model_of(reward_weights={"goal": 4.0, "social_norm": 1.0, "inverse_wall_distance": 0.0})
    assert f"must hold drives of {path} as it is now" in serd(*words).refusal
    save_model_of()
    assert serd(*words).code == 0
    scenario.write_text(scenario.read_text().replace("radius_m: 0.25", "radius_m: 0.2"))
    assert f"must hold drives of {scenario} as it is now" in serd(*words).refusal
    (tmp_path / "full").mkdir()
    (tmp_path / "full/notes.txt").write_text("mine")
    assert serd("navigate", path, "--output", tmp_path / "full").code == 2


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
    printed = " ".join(remarks(found, strategy.scenario.patience_remark))
    for words in ("4 episodes", "1 aborted (no progress)"):
        assert words in printed


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
