"""The whole study in miniature, in this process."""

import numpy as np
import pytest

from lab.experiments.running.tables import plain_rows
from lab.experiments.study.fits.methods import METHODS
from lab.experiments.study.hallway.figures.catalogue import FIGURES
from lab.experiments.study.hallway.run import redraw, run_study, stages_of
from lab.experiments.study.hallway.tables.catalogue import headline
from lab.experiments.study.hallway.tables.hindsight import tables_under
from lab.experiments.study.hallway.tables.results import Results
from lab.experiments.study.recordings.demonstrations import check_bags, load_sets
from lab.experiments.study.recordings.experts import EXPERTS, PEOPLE
from lab.experiments.study.settings import study_settings
from lab.experiments.study.study import Study
from serd_files.errors import USER_ERRORS
from serd_sim.episodes.execution import Execution
from support.changed_scenario import changed_scenario

TINY = """
scenario: {scenario}
people: 3
drive: kinematic
demonstrations: {{training: 2, test: 1, transfer: 1}}
reference: {{experts: 1, against_flow: 1, exploring: 1, exploring_s: 20.0}}
learning: {{repetitions: 2, sizes: [2], prior_weights: [1.0], reirl_samples: 20}}
beliefs: {{repetitions: 2, sizes: [2], episodes: 1}}
arrival: {{episodes: 1, sampled: 20}}
statistics: {{bootstrap: 20}}
"""
NEAR_STARTS = {
    "train: [[0, 0], [2, 0], [2, 3], [0, 3]]": "train: [[6, 16], [8, 16], [8, 18], [6, 18]]",
    "transfer: [[4, 0], [6, 0], [6, 3], [4, 3]]": "transfer: [[6, 18], [8, 18], [8, 20], [6, 20]]",
    "episode_timeout_s: 420.0": "episode_timeout_s: 16.0",
    "warm_up_s: 10.0": "warm_up_s: 1.0",
    "control_period_s: 0.05": "control_period_s: 0.1",
}


@pytest.fixture
def settings(tmp_path):
    """Near the goal and short of time, so that an episode takes a moment."""
    scenario = changed_scenario(tmp_path, "hallway", NEAR_STARTS)
    config = tmp_path / "tiny.yaml"
    config.write_text(TINY.format(scenario=scenario))
    return study_settings(config=config)


@pytest.mark.slow
@pytest.mark.usefixtures("quick_pictures")
def test_every_stage_leaves_its_products_from_which_tables_and_figures_are_made(settings, tmp_path):
    folder, calls = tmp_path / "study", []
    tables = run_study(
        settings, folder, Execution(n_jobs=1), lambda *progress: calls.append(progress)
    )

    assert list(dict.fromkeys(name for *_, name in calls)) == [
        "reference recordings",
        "demonstrations",
        "learning",
        "times of arrival",
    ]
    assert not any(stage.missing for stage in stages_of(Study(settings, folder / "work")))
    assert list(headline(tables)["method"]) == list(METHODS)
    assert set(tables["measures"]["expert"]) == set(EXPERTS)
    assert_every_method_drove_the_same_episodes(tables["measured_episodes"])
    results = Results(settings, folder / "work")
    assert_predictions_differ_by_their_dynamics_alone(results)
    assert_estimates_are_made_of_all_decisions(results, tables["arrival_hindsight"])
    for figure in FIGURES:
        for ending in (".csv", ".png", ".svg"):
            assert (folder / f"{figure.stem}{ending}").stat().st_size > 100

    picture = folder / "figure_5_8.png"
    drawn = picture.read_bytes()
    assert redraw(["5.8"], folder) == [picture]
    assert picture.read_bytes() == drawn


def assert_every_method_drove_the_same_episodes(rows):
    by_method = {}
    for row in plain_rows(rows):
        if row["expert"] == PEOPLE:
            by_method.setdefault(row["method"], []).append((row["seed"], row["episode"]))
    assert set(by_method) == set(METHODS)
    assert len({tuple(each) for each in by_method.values()}) == 1


def assert_predictions_differ_by_their_dynamics_alone(results):
    learned = results.models(PEOPLE, "cloning", "truth")[1]
    same = tables_under(results, PEOPLE, "cloning", learned)
    predicted = results.arrival_tables(PEOPLE, "cloning").predicted
    np.testing.assert_allclose(same.predicted[1], predicted[1], atol=1e-12)

    nobody_moves = np.tile([1.0, 0.0, 0.0, 0.0, 0.0], (len(learned), 1))
    assert not tables_under(results, PEOPLE, "cloning", nobody_moves).predicted.any()


def assert_estimates_are_made_of_all_decisions(results, rows):
    rows = plain_rows(rows)
    for row in rows:
        moves = results.moves(row["expert"], row["method"])
        expected = {
            "hindsight_decisions": sum(count for *_, count in moves),
            "pooled_decisions": sum(
                len(load_sets(results, row["expert"], number).training)
                for number in range(results.settings.n_repetitions(row["expert"]))
            ),
        }
        for name, count in expected.items():
            assert row[name] == (count if row["always_arrived"] else None)
    assert any(row["always_arrived"] for row in rows)
    is_cloned = (results.measured[["expert", "method"]] == [PEOPLE, "cloning"]).all(axis=1)
    periods = results.measured.loc[is_cloned, "time_s"].sum() / 2.0
    counted = sum(count for *_, count in results.moves(PEOPLE, "cloning"))
    assert 0.8 * periods < counted <= np.ceil(periods) + 2


@pytest.mark.parametrize(
    ("bags", "refusal"),
    [
        (("nowhere",), r"nowhere"),
        (("training",), r"must hold 30 episodes for training and test, got 20"),
        (("training", "test"), r"must hold 10 episodes for transfer, got 0"),
    ],
)
def test_bags_that_do_not_do_are_refused_before_a_folder_is_claimed(
    bags, refusal, bags_folder, tmp_path
):
    settings = study_settings(bags=[bags_folder / bag for bag in bags])
    with pytest.raises(USER_ERRORS, match=refusal):
        run_study(settings, tmp_path / "study", Execution(n_jobs=1), lambda *_: None)
    assert not (tmp_path / "study").exists()


def test_bags_of_another_place_are_refused(bags_folder, tmp_path):
    config = tmp_path / "corridor.yaml"
    config.write_text("scenario: corridor\n")
    settings = study_settings(quick=True, config=config, bags=[bags_folder / "training"])
    sentence = r"must be recorded in the scenario 'corridor', but 443 of 599 decisions lie outside"
    with pytest.raises(USER_ERRORS, match=sentence):
        check_bags(Study(settings, tmp_path))


def test_a_folder_without_a_study_is_refused(tmp_path):
    with pytest.raises(USER_ERRORS, match=r"must hold a finished study, but has no settings\.yaml"):
        redraw(["5.9"], tmp_path)
