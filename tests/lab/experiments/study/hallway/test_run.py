"""The whole study in miniature, in this process."""

import pytest

from lab.experiments.running.tables import plain_rows
from lab.experiments.study.fits.methods import METHODS
from lab.experiments.study.hallway.run import run_study, stages_of
from lab.experiments.study.hallway.tables import headline
from lab.experiments.study.recordings.experts import EXPERTS, PEOPLE
from lab.experiments.study.settings import study_settings
from lab.experiments.study.study import Study
from serd_sim.episodes.execution import Execution
from support.changed_scenario import changed_scenario

TINY = """
scenario: {scenario}
people: 3
drive: kinematic
demonstrations: {{training: 2, test: 1, transfer: 1}}
reference: {{experts: 1, against_flow: 1, exploring: 1, exploring_s: 10.0}}
learning: {{repetitions: 2, sizes: [2], prior_weights: [1.0], reirl_samples: 20}}
beliefs: {{repetitions: 2, sizes: [2], episodes: 1}}
arrival: {{episodes: 1}}
statistics: {{bootstrap: 20}}
"""
NEAR_STARTS = {
    "train: [[0, 0], [2, 0], [2, 3], [0, 3]]": "train: [[6, 16], [8, 16], [8, 18], [6, 18]]",
    "transfer: [[4, 0], [6, 0], [6, 3], [4, 3]]": "transfer: [[6, 18], [8, 18], [8, 20], [6, 20]]",
    "episode_timeout_s: 420.0": "episode_timeout_s: 10.0",
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
def test_every_stage_leaves_its_products_from_which_tables_and_the_figure_are_made(
    settings, tmp_path
):
    folder, calls = tmp_path / "study", []
    tables = run_study(settings, folder, Execution(n_jobs=1), lambda *each: calls.append(each))
    stages = ["reference recordings", "demonstrations", "learning", "times of arrival"]
    assert list(dict.fromkeys(name for *_, name in calls)) == stages
    assert not any(stage.missing for stage in stages_of(Study(settings, folder / "work")))
    assert list(headline(tables)["method"]) == list(METHODS)
    assert set(tables["measures"]["expert"]) == set(EXPERTS)
    rows = [row for row in plain_rows(tables["measured_episodes"]) if row["expert"] == PEOPLE]
    driven = {
        method: [(row["seed"], row["episode"]) for row in rows if row["method"] == method]
        for method in METHODS
    }
    assert len({tuple(each) for each in driven.values()}) == 1
    for name in ("figure_5_9.csv", "figure_5_9.png", "figure_5_9.svg", "prior_weights.csv"):
        assert (folder / name).stat().st_size > 100
