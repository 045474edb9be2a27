"""The density study: its settings, and its tables from files of its stages."""

import json

import numpy as np
import pytest

from lab.experiments.study.density.settings import DensityStudy, density_settings
from lab.experiments.study.density.stages import WITH, WITHOUT, learn, stages_of
from lab.experiments.study.density.tables import all_tables, arrival_tables
from serd_core.demonstrations.simulation import sample_decisions
from serd_core.policies.solved_policy import soft_policy
from sim.scenario.grid import start_states_of
from storage.errors import FileError
from tests.conftest import OUTCOMES


@pytest.fixture
def study(tmp_path):
    """Recordings are sampled in the decision problem, in crowds of random density."""
    study = DensityStudy(density_settings(quick=True), tmp_path)
    problem, truth = study.problem, np.array(list(OUTCOMES.values()))
    policy = soft_policy(problem, np.array([4.0, 1.0, -0.2]), truth).probabilities
    starts = np.zeros(problem.mdp.n_states)
    starts[start_states_of(study.scenario(20), problem.grid, "train")] = 1.0
    rng = np.random.default_rng(0)
    for people in study.settings.crowds:
        for repetition in range(study.settings.repetitions):
            found = sample_decisions(
                problem.mdp, policy, truth, starts / starts.sum(), n_episodes=4, n_steps=60, rng=rng
            )
            found = found.select(~np.isin(found.state, problem.goal_states))
            content = {
                "decisions": {name: values.tolist() for name, values in found.columns().items()},
                "aimed_at_pm2": rng.uniform(0.0, people / 50, (len(found), 5)).tolist(),
                "mean_pm2": np.full(problem.mdp.n_states, people / 100).tolist(),
                "n_diagonal": 1,
                "n_far": 0,
            }
            write(study, "recordings", people, repetition, content)
    return study


def write(study, stage, people, repetition, content):
    file = study.folder / stage / f"{people:02d}_{repetition:02d}.json"
    file.parent.mkdir(exist_ok=True)
    file.write_text(json.dumps(content))


def test_tables_compare_both_models_on_other_demonstrations_and_arrivals(study):
    for repetition in range(2):
        fit = learn(study, 20, repetition)
        assert fit["converged"] == [True, True]
        write(study, "fits", 20, repetition, fit)
        write(study, "arrival", 20, repetition, {"40": [50.0 + 2 * repetition]})
    tables = all_tables(study)
    assert set(tables) == {"scores", "likelihood", "arrival", "crowds"}
    scores = tables["scores"]
    assert len(scores) == 2 * 2 * 2
    assert (scores["move_log_likelihood"] < scores["action_log_likelihood"]).all()
    arrival = tables["arrival"].set_index("method")
    assert arrival.loc[WITH, "measured_median_s"] == arrival.loc[WITHOUT, "measured_median_s"] == 50
    gained = tables["likelihood"].set_index(["crowd", "measure"])["difference"]
    means = scores.groupby(["crowd", "method"])["move_log_likelihood"].mean()
    assert gained[40, "move_log_likelihood"] == pytest.approx(means[40, WITH] - means[40, WITHOUT])
    crowds = tables["crowds"].set_index("crowd")
    assert crowds["predicted_pm2"].is_monotonic_increasing
    assert crowds.loc[20, "measured_pm2"] == pytest.approx(0.2)
    assert crowds.loc[20, "fault_share"] == pytest.approx(2 / crowds.loc[20, "n_decisions"])


def test_measured_times_count_whole_periods_and_what_never_arrives_does_not(study):
    flat = {"40": {WITH: [0.0] * 30, WITHOUT: [0.0] * 30}}
    for repetition, time_s in enumerate((49.9, float("inf"))):
        write(study, "fits", 20, repetition, {"predicted": flat})
        write(study, "arrival", 20, repetition, {"40": [time_s]})
    found = arrival_tables(study, 20, 40, WITH)
    assert found.measured[0].sum() == 5  # from period 25 to 29
    assert found.measured[1].sum() == 0


@pytest.mark.parametrize("name", ["learned_from", "predicted"])
def test_a_number_of_people_is_named_once(tmp_path, name):
    file = tmp_path / "mine.yaml"
    file.write_text(f"{name}: [20, 20]\n")
    with pytest.raises(FileError, match=rf"{name} must name each number of people once, got \[20,"):
        density_settings(config=file)


def test_a_stage_has_a_file_for_each_crowd_and_repetition(study):
    stages = {stage.name: stage for stage in stages_of(study)}
    assert {name: len(stage.tasks) for name, stage in stages.items()} == {
        "recordings": 4, "fits": 2, "arrival": 2,
    }  # fmt: skip
    assert not stages["recordings"].missing
