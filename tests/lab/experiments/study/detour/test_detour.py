"""The detour study in miniature, and its parts."""

import numpy as np
import pytest

from lab.experiments.study.detour.decoy import with_forward
from lab.experiments.study.detour.fits import COUNTED, INFORMED, REWARDS, SERD
from lab.experiments.study.detour.run import run_detour, stages_of
from lab.experiments.study.detour.settings import DetourStudy, detour_settings
from lab.experiments.study.detour.tables import headline
from serd_core.grid.navigation import AGAINST_FLOW
from serd_sim.episodes.execution import Execution
from support.changed_scenario import changed_scenario

TINY = """
scenario: {scenario}
people: 4
demonstrations: {{training: 2, test: 1, transfer: 1}}
reference: {{experts: 1, against_flow: 1, exploring: 1, exploring_s: 8.0}}
learning: {{repetitions: 2, sizes: [2]}}
pseudo_counts: [0.3, 1.0]
decoy: {{truths: [0.3], repetitions: 2, sizes: [2]}}
statistics: {{bootstrap: 20}}
"""
NEAR = {
    "train: [[13, 7], [17, 7], [17, 9], [13, 9]]": "train: [[0, 3], [4, 3], [4, 5], [0, 5]]",
    "transfer: [[9, 0], [12, 0], [12, 4], [9, 4]]": "transfer: [[6, 0], [8, 0], [8, 4], [6, 4]]",
    "episode_timeout_s: 160.0": "episode_timeout_s: 24.0",
    "warm_up_s: 10.0": "warm_up_s: 1.0",
}


@pytest.fixture
def settings(tmp_path):
    """Near the goal and short of time, so that an episode takes a moment."""
    scenario = changed_scenario(tmp_path, "ring", NEAR)
    config = tmp_path / "tiny.yaml"
    config.write_text(TINY.format(scenario=scenario))
    return detour_settings(config=config)


@pytest.mark.slow
def test_every_stage_leaves_its_products_from_which_tables_and_the_figure_are_made(
    settings, tmp_path
):
    folder, calls = tmp_path / "detour", []
    tables = run_detour(settings, folder, Execution(n_jobs=1), lambda *each: calls.append(each))
    assert not any(stage.missing for stage in stages_of(DetourStudy(settings, folder / "work")))
    measures = tables["measures"]
    assert set(measures["method"]) == {SERD, COUNTED, INFORMED}
    assert set(measures["reward"]) == set(REWARDS)
    driven = measures[measures["driven"].notna()]
    assert set(driven["reward"]) == {"goal and wall"}
    assert driven["driven"].between(0, 24.1).all()
    informed = measures[measures["method"] == INFORMED]
    np.testing.assert_allclose(informed["divergence_against_flow"], 0.0, atol=1e-9)
    assert set(measures[measures["method"] == COUNTED]["chosen"]) <= {0.3, 1.0}
    assert list(headline(tables)["method"]) == [SERD, COUNTED]
    assert len(tables["decoy"]) == 2
    for name in ("detour.png", "detour.svg", "paired.csv", "decoy_summary.csv", "settings.yaml"):
        assert (folder / name).stat().st_size > 100


def test_a_decoy_changes_one_probability_and_scales_its_row():
    truth = np.full((4, 5), 0.2)
    table = with_forward(truth, 0.6)
    np.testing.assert_allclose(table[AGAINST_FLOW], [0.1, 0.6, 0.1, 0.1, 0.1])
    np.testing.assert_array_equal(np.delete(table, AGAINST_FLOW, 0), truth[1:])
