"""`serd learn`: a table of decisions becomes a model, with and without a scenario."""

import json
from pathlib import Path
from typing import get_args

import numpy as np
import pytest

from serd_app.demonstrations.decision_table import load_decisions, save_decisions
from serd_app.demonstrations.grid.flow_field import FlowField, save_flow
from serd_app.demonstrations.recorded import BagRecord, DemonstrationRecord
from serd_app.learning.learning_files import read_learning_files
from serd_app.learning.settings import MethodName
from serd_core.bayes.draws import N_DRAWS
from serd_core.grid.navigation import with_dwell_times
from serd_core.policies.solved_policy import soft_policy
from serd_core.semi_markov.simulation import sample_timed_decisions
from serd_files.grid_file import save_grid
from serd_files.model_file import load_model
from serd_files.yaml_config import model_yaml
from serd_sim.drivers.strategy import load_strategy, start_distribution
from serd_sim.scenario.grid import flow_of, grid_of, navigation_problem_of, start_states_of
from serd_sim.scenario.scenario import load_scenario
from tests.conftest import MEAN_S, OUTCOMES

HALLWAY = load_scenario("hallway")
GRID = grid_of(HALLWAY)
WEIGHTS = {"goal": 5.0, "social_norm": 1.0, "inverse_wall_distance": 0.2}
TRUTH = np.array(list(OUTCOMES.values()))


def problem_with(flow=None):
    """Of the hallway, whose decisions take time."""
    untimed = navigation_problem_of(HALLWAY, 0.99, flow=flow)
    return with_dwell_times(untimed, patience_s=HALLWAY.patience_s, wait_s=HALLWAY.wait_s)


def test_states_alone_are_learned_from(serd, demonstrations, tmp_path):
    """The same rewards and dynamics as with actions, within what is left open."""
    table, model = demonstrations(n_episodes=60), tmp_path / "model.yaml"
    decisions = load_decisions(table)
    save_decisions(table, decisions.with_hidden_actions())
    assert load_decisions(table).hidden.all()
    values = serd("learn", table, "--output", model, "--json").values
    assert values["method"] == "mdce_serd_evidence"
    assert load_model(model).method == "mdce_serd_evidence"
    learned = np.array(values["outcome_probabilities"])
    assert abs(learned[0, 1] - TRUTH[0, 1]) < 0.1
    assert values["weight.goal"] > 0
    refusal = serd("learn", table, "--output", model, "--method", "policy_matching").refusal
    assert "where actions are hidden, got policy_matching, which counts actions" in refusal


@pytest.fixture
def demonstrations(tmp_path):
    """Writes what `serd demos` writes: a soft expert's decisions under a flow of people."""

    def make(scenario: str = "hallway", flow=None, n_episodes: int = 30, **changes) -> Path:
        problem = problem_with(flow)
        weights = np.array([WEIGHTS[name] for name in problem.feature_names])
        start = np.zeros(GRID.n_states)
        start[start_states_of(HALLWAY, GRID, "train")] = 1.0
        model = problem.mdp.transitions
        truth = model.parameters_from(TRUTH, list(MEAN_S.values()), 5.0)
        decisions = sample_timed_decisions(
            problem.mdp,
            soft_policy(problem, weights, model.local_probabilities(truth)).probabilities,
            truth,
            start / start.sum(),
            n_episodes=n_episodes,
            n_steps=60,
            rng=np.random.default_rng(1),
        )
        table = tmp_path / "decisions.csv"
        save_decisions(table, decisions)
        save_grid(tmp_path / "decisions.grid.yaml", GRID, scenario)
        bag = BagRecord(bag="b", n_decisions=1, n_censored=0, n_episodes=1)
        values = {
            "scenario": scenario,
            "grid_fingerprint": GRID.fingerprint(),
            "patience_s": HALLWAY.patience_s,
            "wait_s": HALLWAY.wait_s,
            "bags": (bag,),
        }
        record = DemonstrationRecord(**(values | changes))
        (tmp_path / "decisions.yaml").write_text(model_yaml(record))
        if flow is not None:
            zeros = np.zeros((GRID.n_states, 2))
            file = tmp_path / "decisions.flow.csv"
            count = np.zeros(GRID.n_states, dtype=int)
            save_flow(file, GRID, FlowField(flow, zeros, zeros[:, 0], count))
        return table

    return make


def learned(ended, *, code: int = 0):
    assert ended.code == code, ended.err
    return json.loads(ended.out)


def test_the_expert_s_weights_lie_within_their_standard_errors(serd, demonstrations):
    found = learned(serd("learn", demonstrations(), "--json"))
    assert found["converged"]
    weights = [found[f"weight.{name}"] for name in WEIGHTS]
    errors = np.array(found["standard_errors"])
    assert (errors < 1.0).all()
    assert (np.abs(np.subtract(weights, list(WEIGHTS.values()))) < 3 * errors).all()
    assert (found["scenario"], found["flow"], found["n_episodes"]) == ("hallway", "scenario", 30)
    model = load_model(found["model"], expected_grid=GRID)
    assert (model.patience_s, model.wait_s, model.flow) == (HALLWAY.patience_s, HALLWAY.wait_s, ())
    times = {row["model"]: row for row in found["knowledge"]["durations"]}
    for name, true_s in MEAN_S.items():
        row = times[name]
        assert row["lower_s"] / 1.3 < true_s < 1.3 * row["upper_s"]
    assert found["mean_dwell_s"]["with_flow"] == pytest.approx(times["with_flow"]["median_s"], 0.05)
    assert [f"{weight:.6f}" for weight in model.weights] == [f"{weight:.6f}" for weight in weights]


def test_a_recorded_flow_is_learned_with_and_kept_in_the_model(serd, demonstrations):
    flow = flow_of(HALLWAY, GRID)
    turned = np.where(flow > 0, (flow + 1) % 4 + 1, flow)
    table = demonstrations(flow=turned)
    by_recorded = learned(serd("learn", table, "--flow", "recorded", "--json"))
    by_scenario = learned(serd("learn", table, "--output", "other.yaml", "--json"))
    assert (by_recorded["flow"], by_scenario["flow"]) == ("recorded", "scenario")
    assert abs(by_recorded["weight.social_norm"] - 1.0) < 0.5
    assert by_scenario["weight.social_norm"] < 0.5  # people walk against the direction of the plan
    model = load_model(by_recorded["model"])
    assert model.flow_on("model", GRID).tolist() == turned.tolist()
    used = load_strategy(by_recorded["model"], HALLWAY, "optimal")
    assert used.problem.flow.tolist() == turned.tolist()


def test_without_a_scenario_the_goal_is_where_the_episodes_end(serd, demonstrations):
    table = demonstrations(scenario="", flow=flow_of(HALLWAY, GRID))
    found = learned(serd("learn", table, "--json"))
    assert (found["scenario"], found["flow"]) == ("", "recorded")
    goal = navigation_problem_of(HALLWAY, 0.99).goal_states
    ends = GRID.states_at(found["goals_m"])
    assert set(ends.tolist()) <= set(goal.tolist())


def test_a_model_of_a_fitted_grid_drives_on_its_cells(serd, demonstrations):
    table = demonstrations(scenario="", flow=flow_of(HALLWAY, GRID))
    found = learned(serd("learn", table, "--json"))
    kept = Path(found["model"]).with_suffix(".scenario.yaml")
    assert grid_of(load_scenario(kept)).fingerprint() == GRID.fingerprint()
    assert serd("navigate", found["model"], "--episodes", "2", "--json").values["n_arrived"] == 2
    edited = kept.read_text().replace("count: 0", "count: 4")
    kept.write_text(edited)
    refusal = serd("learn", table).refusal
    assert "edited or written by hand; move it to another name" in refusal
    assert "learning" not in refusal
    assert kept.read_text() == edited
    kept.unlink()
    assert "--scenario must be given" in serd("navigate", found["model"]).refusal


def read(table, goals_m=(), scenario=""):
    return read_learning_files(table, discount=0.99, goals_m=goals_m, scenario=scenario)


def test_a_goal_that_no_episode_reaches_is_remarked(serd, demonstrations):
    table = demonstrations()
    visited = np.unique(load_decisions(table).next_state)
    starts = start_states_of(HALLWAY, GRID, "train")
    unseen = np.setdiff1d(np.arange(GRID.n_states), [*visited, *starts])[0]
    x_m, y_m = GRID.centers_m[unseen]
    files = read(table, ((x_m, y_m),))
    assert files.n_reaching_goal == 0
    (remark,) = files.remarks()
    assert remark.startswith(f"no episode reaches the goal ({x_m:g},{y_m:g})")
    assert remark in serd("learn", table, "--goal", f"{x_m},{y_m}", "--prior-weight", "1").out
    files = read(table)
    assert 0 < files.n_reaching_goal <= 30
    assert not tuple(files.remarks())


@pytest.mark.parametrize(
    ("name", "output"),
    [
        ("decisions", "decisions.yaml"),
        ("decisions", "decisions.grid.yaml"),
        ("decisions", "folder/../decisions.yaml"),
        ("model.learning", "model.yaml"),
        ("model.grid", "model.yaml"),
    ],
)
def test_a_model_never_overwrites_what_it_is_learned_from(
    serd, demonstrations, tmp_path, name, output
):
    demonstrations()
    (tmp_path / "folder").mkdir()
    for file in tmp_path.glob("decisions*"):
        file.rename(tmp_path / file.name.replace("decisions", name))
    before = {file: file.read_bytes() for file in tmp_path.iterdir() if file.is_file()}
    refusal = serd("learn", tmp_path / f"{name}.csv", "--output", tmp_path / output).refusal
    assert "--output must not overwrite what is read" in refusal
    after = {file: file.read_bytes() for file in tmp_path.iterdir() if file.is_file()}
    assert after == before


def test_too_little_before_the_goal_is_refused_with_what_lies_behind_it(serd, demonstrations):
    words = ("--goal", "4.5,10.5", "--minimum-decisions", "100000")
    refusal = serd("learn", demonstrations(), *words).refusal
    assert "at least 100000 decisions before the goal are needed to learn" in refusal
    assert "after it (goal: 4.5,10.5); name another --goal" in refusal


def test_what_nobody_did_is_said_to_be_open(serd, demonstrations):
    table = demonstrations(flow=np.full(GRID.n_states, -1))
    found = serd("learn", table, "--flow", "none", "--method", "mdce_serd", "--json").values
    assert not found["identified_without_prior"]
    against, across = found["outcome_standard_errors"][1:3]
    assert against == [None] * 5
    assert None not in across


def test_it_states_from_how_many_cells_the_learned_policy_never_arrives(serd, demonstrations):
    table = demonstrations()
    words = " ".join(serd("learn", table).out.split())
    found = learned(serd("learn", table, "--json"))
    assert (found["n_looping_cells"], found["n_reaching_cells"]) == (1, 176)
    assert "the learned policy never reaches the goal from 1 of 176 cells" in words
    elsewhere = learned(serd("learn", table, "--goal", "0.5,23.5", "--json"))
    assert elsewhere["n_looping_cells"] > 0  # nobody went there
    share = f"{elsewhere['n_looping_cells']} of 176 cells"
    words = " ".join(serd("learn", table, "--goal", "0.5,23.5").out.split())
    assert f"the learned policy never reaches the goal from {share}" in words


def test_a_bag_in_place_of_a_table_is_refused_with_the_command_that_makes_one(serd, tmp_path):
    (tmp_path / "bag").mkdir()
    (tmp_path / "bag_0.mcap").touch()
    for bag in (tmp_path / "bag", tmp_path / "bag_0.mcap"):
        ended = serd("learn", bag).refusal
        assert f"TABLE must be a table of decisions, got {bag}" in ended
        assert "'serd demos' makes one" in ended


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (("--output", "model.txt"), "--output must end in .yaml, .yml, got model.txt"),
        (("--goal", "0.5"), "goal must be two numbers 'x, y' (m), got '0.5'"),
        (("--goal", "99,0"), "--goal must lie in a walkable cell of the grid, got 99,0"),
        (("--goal", "nan,0"), "--goal must lie in a walkable cell of the grid, got nan,0"),
        (
            ("--flow", "recorded"),
            "decisions.flow.csv, for the bags hold no people; use --flow n",
        ),
        (("--scenario", "corridor"), "must be the grid of the scenario 'corridor'"),
        (("--minimum-decisions", "100000"), "at least minimum_decisions = 100000"),
        (("--discount", "1"), "discount must be"),
        (("--pseudo-count", "0"), "pseudo_count must be"),
    ],
)
def test_bad_input_gets_a_sentence_and_exit_code_2(serd, demonstrations, words, sentence):
    assert sentence in serd("learn", demonstrations(), *words).refusal
    assert not Path("model.yaml").exists()


def test_files_that_do_not_belong_together_are_refused(serd, demonstrations):
    another_patience = serd("learn", demonstrations(patience_s=1.0))
    assert "patience_s must be 4 as in the scenario, got 1" in another_patience.err
    another_wait = serd("learn", demonstrations(wait_s=2.0))
    assert "wait_s must be 1 as in the scenario, got 2" in another_wait.err
    another_grid = serd("learn", demonstrations(grid_fingerprint="0"))
    assert "but it is another; run 'serd demos' again" in another_grid.err
    no_plan = serd("learn", demonstrations(scenario=""), "--flow", "scenario")
    assert "--flow scenario needs a scenario" in no_plan.err
    table = demonstrations()
    lines = table.read_text().splitlines()
    last = dict(zip(lines[0].split(","), lines[-1].split(","), strict=True))
    beyond = ",".join((last | {"time_s": "999.0", "state": "100000"}).values())
    table.write_text("\n".join([*lines, beyond, ""]))
    assert "states must be below 176" in serd("learn", table).err
    for suffix in (".yaml", ".grid.yaml"):
        table.with_suffix(suffix).unlink()
        sentence = f"decisions.csv: decisions{suffix}, which is written with it, must be beside it"
        assert sentence in serd("learn", table).err
    assert another_patience.code == another_wait.code == another_grid.code == no_plan.code == 2


@pytest.mark.parametrize("method", get_args(MethodName))
def test_every_method_gives_a_model_that_navigates(serd, demonstrations, method):
    table = demonstrations(n_episodes=6)
    ended = serd("learn", table, "--method", method, "--prior-weight", "0.1", "--json")
    found = learned(ended)
    assert found["method"] == method
    assert found["converged"]
    model = load_model(found["model"], expected_grid=GRID)
    assert (model.method, model.fit.n_episodes) == (method, 6)
    assert all(each.mean_s > 0.2 for each in model.outcome_models)
    strategy = load_strategy(found["model"], HALLWAY, "optimal")
    law = strategy.law_from(start_distribution(HALLWAY, "train"))
    assert law.quantile_s(0.5) < HALLWAY.episode_timeout_s


def test_the_evidence_decides_whether_the_expert_knows_the_dynamics(serd, demonstrations):
    """The episodes are of an expert who does, and the model says so."""
    words = ("learn", demonstrations(n_episodes=20), "--method", "mdce_serd_belief_evidence")
    found = learned(serd(*words, "--json"))
    assert "belief is equal to the truth" in found["belief"]
    assert "Bayes factor" in found["belief"]
    model = load_model(found["model"])
    assert found["belief"] in model.prior
    assert len(model.draws.reward_weights) == N_DRAWS
    assert found["knowledge"] is not None
    assert found["belief"] in serd(*words).out


def test_the_prior_weight_of_a_model_is_the_best_on_validation(serd, demonstrations):
    words = [word for weight in ("0.1", "1000") for word in ("--prior-weight", weight)]
    words += ["--method", "mdce_serd"]
    found = learned(serd("learn", demonstrations(n_episodes=8), *words, "--json"))
    scores = found["validation_log_likelihoods"]
    assert set(scores) == {"0.1", "1000.0"}
    assert str(found["prior_weight"]) == max(scores, key=scores.get)
    prior = load_model(found["model"]).prior
    assert f"weight {found['prior_weight']:g} (chosen on validation episodes)" in prior


@pytest.mark.usefixtures("whole_pictures")
def test_what_is_known_of_outcomes_is_printed_and_mapped(serd, demonstrations, tmp_path):
    table = demonstrations(n_episodes=3)
    model = tmp_path / "out" / "model.yaml"
    model.parent.mkdir()
    ended = serd("learn", table, "--output", model)
    assert ended.code == 0, ended.err
    assert "against flow: " in ended.out
    assert "against flow, time of a move: " in ended.out
    assert "most confounded: how long a move " in ended.out
    assert "with flow, time of a move: " in ended.out
    assert "a demonstration from " in ended.out
    for name in (
        "posterior.csv",
        "durations.csv",
        "next_demonstration.csv",
        "next_demonstration.png",
    ):
        assert model.with_suffix(f".{name}").stat().st_size > 100
    found = learned(serd("learn", table, "--method", "mdce_serd", "--json"))
    assert found["knowledge"] is None


def test_files_of_decisions_with_a_period_are_refused_with_the_command_that_makes_them_again(
    serd, demonstrations
):
    table = demonstrations()
    record = table.with_suffix(".yaml")
    text = record.read_text().replace("format_version: 2", "format_version: 1")
    record.write_text(text.replace("patience_s: 4.0", "decision_period_s: 2.0"))
    refusal = " ".join(serd("learn", table).refusal.split())
    assert "format_version must be 2, got 1 of another version; run 'serd demos' again" in refusal
    found = learned(serd("learn", demonstrations(n_episodes=5), "--method", "mdce_irl", "--json"))
    model = Path(found["model"])
    text = model.read_text().replace("format_version: 2", "format_version: 1")
    model.write_text(text.replace("patience_s: 4.0", "decision_period_s: 2.0"))
    for command in ("navigate", "report"):
        refusal = " ".join(serd(command, model).refusal.split())
        assert "run 'serd demos' and then 'serd learn' again" in refusal
