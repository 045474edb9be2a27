"""`serd learn`: a table of decisions becomes a model, with and without a scenario."""

import json
from pathlib import Path
from typing import get_args

import numpy as np
import pytest

from serd_app.demonstrations.decision_table import (
    DemonstrationRecord,
    FlowField,
    Place,
    save_flow,
    save_learnable,
)
from serd_app.learning.settings import MethodName
from serd_core.bayes.laplace import N_DRAWS
from serd_core.demonstrations.simulation import sample_timed_decisions
from serd_core.grid.navigation import with_dwell_times
from serd_core.policies.solved_policy import soft_policy
from serd_files.model_file import load_model, require_grid
from serd_files.yaml_config import load_yaml_model, model_yaml
from serd_sim.drivers.strategy import load_strategy, start_distribution
from serd_sim.scenario.grid import flow_of, grid_of, navigation_problem_of, start_states_of
from serd_sim.scenario.scenario import load_scenario
from support.commands import printed_in
from support.made_once import made_once
from tests.conftest import MEAN_S, OUTCOMES

HALLWAY = load_scenario("hallway")
GRID = grid_of(HALLWAY)
WEIGHTS = {"goal": 5.0, "social_norm": 1.0, "inverse_wall_distance": 0.2}
TRUTH = np.array(list(OUTCOMES.values()))
QUICK = ("--method", "mdce_serd_evidence")


def write_demonstrations(folder, scenario="hallway", flow=None, n_episodes=30, **changes):
    """What `serd demos` writes: a soft expert's decisions under a flow of people."""
    untimed = navigation_problem_of(HALLWAY, 0.99, flow=flow)
    problem = with_dwell_times(untimed, patience_s=HALLWAY.patience_s, wait_s=HALLWAY.wait_s)
    weights = np.array([WEIGHTS[name] for name in problem.feature_names])
    start = np.zeros(GRID.n_states)
    start[start_states_of(HALLWAY, GRID, "train")] = 1.0
    model = problem.mdp.transitions
    truth = model.parameters_from(TRUTH, list(MEAN_S.values()), 5.0)
    policy = soft_policy(problem, weights, model.local_probabilities(truth)).probabilities
    sizes = {"n_episodes": n_episodes, "n_steps": 60, "rng": np.random.default_rng(1)}
    start /= start.sum()
    decisions = sample_timed_decisions(problem.mdp, policy, truth, start, **sizes)
    place = Place(GRID, HALLWAY.patience_s, HALLWAY.wait_s, HALLWAY if scenario else None)
    save_learnable(folder / "decisions.csv", place, decisions)
    record = load_yaml_model(folder / "decisions.yaml", DemonstrationRecord)
    (folder / "decisions.yaml").write_text(model_yaml(record.model_copy(update=changes)))
    if flow is not None:
        zeros, count = np.zeros((GRID.n_states, 2)), np.zeros(GRID.n_states, dtype=int)
        field = FlowField(flow, zeros, zeros[:, 0], count)
        save_flow(folder / "decisions.flow.csv", GRID, field)
    return folder / "decisions.csv"


@pytest.fixture
def demonstrations(tmp_path):
    return lambda *words, **options: write_demonstrations(tmp_path, *words, **options)


@pytest.fixture(scope="session")
def by_default(tmp_path_factory):
    """What the default learns of 30 episodes: its values, and the folder with its files."""

    def run(folder):
        printed = printed_in(folder, "learn", write_demonstrations(folder), "--json")
        (folder / "printed.json").write_text(printed)

    folder = made_once(tmp_path_factory, "learned-by-default", run)
    return json.loads((folder / "printed.json").read_text()), folder


def test_the_expert_s_weights_lie_within_their_standard_errors(by_default):
    values, folder = by_default
    assert values["converged"]
    assert values["method"] == "mdce_serd_evidence"
    weights = [values[f"weight.{name}"] for name in WEIGHTS]
    errors = np.array(values["standard_errors"])
    assert (errors < 1.0).all()
    assert (np.abs(np.subtract(weights, list(WEIGHTS.values()))) < 3 * errors).all()
    model = load_model(folder / "model.yaml")
    require_grid("model.yaml", model, GRID)
    assert (model.patience_s, model.wait_s, model.flow) == (HALLWAY.patience_s, HALLWAY.wait_s, ())
    assert [f"{weight:.6f}" for weight in model.weights] == [f"{weight:.6f}" for weight in weights]
    assert len(model.draws.reward_weights) == N_DRAWS


def test_it_states_where_all_is_from_and_leaves_what_is_known_beside_the_model(by_default):
    values, folder = by_default
    assert (values["scenario"], values["flow"], values["n_episodes"]) == ("hallway", "scenario", 30)
    assert (values["n_looping_cells"], values["n_reaching_cells"]) == (0, 176)
    known = "posterior.csv", "durations.csv", "next_demonstration.csv", "next_demonstration.png"
    for name in known:
        assert (folder / f"model.{name}").stat().st_size > 100


def test_a_recorded_flow_is_learned_with_and_kept_in_the_model(serd, demonstrations):
    flow = flow_of(HALLWAY, GRID)
    turned = np.where(flow > 0, (flow + 1) % 4 + 1, flow)
    words = ("learn", demonstrations(flow=turned), "--json")
    by_recorded = serd(*words, "--flow", "recorded").values
    by_scenario = serd(*words, *QUICK, "--output", "other.yaml").values
    assert (by_recorded["flow"], by_scenario["flow"]) == ("recorded", "scenario")
    error = by_recorded["standard_errors"][list(WEIGHTS).index("social_norm")]
    assert abs(by_recorded["weight.social_norm"] - WEIGHTS["social_norm"]) < 2.0 * error < 1.5
    assert by_scenario["weight.social_norm"] < 0.5  # people walk against the direction of the plan
    model = load_model(by_recorded["model"])
    assert model.flow_on("model", GRID).tolist() == turned.tolist()
    used = load_strategy(by_recorded["model"], HALLWAY, "optimal")
    assert used.problem.flow.tolist() == turned.tolist()


def test_without_a_scenario_the_goal_is_where_episodes_end_and_the_model_drives_on_its_cells(
    serd, demonstrations
):
    table = demonstrations(scenario="", flow=flow_of(HALLWAY, GRID))
    learned = serd("learn", table, *QUICK, "--json").values
    assert (learned["scenario"], learned["flow"]) == ("", "recorded")
    goal = navigation_problem_of(HALLWAY, 0.99).goal_states
    assert set(GRID.states_at(learned["goals_m"]).tolist()) <= set(goal.tolist())
    kept = Path(learned["model"]).with_suffix(".scenario.yaml")
    assert grid_of(load_scenario(kept)).fingerprint() == GRID.fingerprint()
    assert serd("navigate", "model.yaml", "--episodes", "1", "--json").values["n_arrived"] == 1
    edited = kept.read_text().replace("count: 0", "count: 4")
    kept.write_text(edited)
    refusal = serd("learn", table).refusal
    assert "edited or written by hand; move it to another name" in refusal
    assert "learning" not in refusal
    assert kept.read_text() == edited
    kept.unlink()
    assert "--scenario must be given" in serd("navigate", "model.yaml").refusal


#: What is changed in the files, words of the command and of its refusal.
APART = (
    ({"patience_s": 1.0}, (), "patience_s must be 4 as in the scenario, got 1"),
    ({"wait_s": 2.0}, (), "wait_s must be 1 as in the scenario, got 2"),
    ({"grid_fingerprint": "0"}, (), "but it is another; run 'serd demos' again"),
    ({"scenario": ""}, ("--flow", "scenario"), "--flow scenario needs a scenario"),
    (
        {},
        ("--goal", "4.5,10.5", "--minimum-decisions", "99999"),
        "after the goal; demonstrate more",
    ),
)


@pytest.mark.parametrize(("changes", "words", "sentence"), APART)
def test_files_that_do_not_belong_together_are_refused(
    serd, demonstrations, changes, words, sentence
):
    table = demonstrations(n_episodes=3, **changes)
    assert sentence in serd("learn", table, *words).refusal
    assert not Path("model.yaml").exists()


def test_a_state_beyond_the_grid_and_files_that_are_missing_are_refused(serd, demonstrations):
    table = demonstrations(n_episodes=3)
    lines = table.read_text().splitlines()
    last = dict(zip(lines[0].split(","), lines[-1].split(","), strict=True))
    beyond = ",".join((last | {"time_s": "999.0", "state": "100000"}).values())
    table.write_text("\n".join([*lines, beyond, ""]))
    assert "states must be below 176" in serd("learn", table).refusal
    for suffix in (".yaml", ".grid.yaml"):
        table.with_suffix(suffix).unlink()
        sentence = f"decisions.csv: decisions{suffix}, which is written with it, must be beside it"
        assert sentence in serd("learn", table).refusal


def test_files_of_decisions_with_a_period_are_refused_with_the_command_that_makes_them_again(
    serd, demonstrations, save_model_of
):
    def older(file):
        text = file.read_text().replace("format_version: 2", "format_version: 1")
        file.write_text(text.replace("patience_s: 4.0", "decision_period_s: 2.0"))
        return file

    table = demonstrations(n_episodes=3)
    older(table.with_suffix(".yaml"))
    sentence = "format_version must be 2, got 1 of another version; run 'serd demos' again"
    assert sentence in serd("learn", table).refusal
    model = older(save_model_of())
    for command in ("navigate", "report"):
        assert "run 'serd demos' and then 'serd learn' again" in serd(command, model).refusal


@pytest.mark.parametrize(
    "method", [name for name in get_args(MethodName) if not name.endswith("evidence")]
)
def test_every_method_gives_a_model_that_navigates(serd, demonstrations, method):
    words = ("--method", method, "--prior-weight", "0.1", "--json")
    values = serd("learn", demonstrations(), *words).values
    assert (values["method"], values["converged"]) == (method, True)
    assert load_model(values["model"]).method == method
    strategy = load_strategy(values["model"], HALLWAY, "optimal")
    law = strategy.law_from(start_distribution(HALLWAY, "train"))
    assert law.quantile_s(0.5) < HALLWAY.episode_timeout_s
