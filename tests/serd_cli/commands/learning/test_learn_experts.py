"""`serd learn --experts`: episodes of two experts are grouped, kept in the model and reported."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest

from serd_app.demonstrations.decision_table import concatenate_renumbered, save_decisions
from serd_app.demonstrations.demonstrations import Demonstrations
from serd_app.demonstrations.grid.grid_file import save_grid
from serd_app.demonstrations.recorded import BagRecord, DemonstrationRecord
from serd_app.learning.expert_groups import METHODS, learn_groups
from serd_app.learning.learning_files import read_learning_files
from serd_app.learning.recipe import learn
from serd_app.learning.settings import LearningSettings
from serd_app.navigation.strategy import load_strategy
from serd_core.demonstrations.simulation import sample_decisions
from serd_core.errors import SerdError
from serd_core.policies.solved_policy import soft_policy
from serd_core.posterior.beliefs import BeliefAroundTruth, FreeBelief
from serd_core.selection.evaluation import adjusted_rand_index
from sim.scenario.grid import grid_of, navigation_problem_of, start_states_of
from sim.scenario.scenario import load_scenario
from storage.errors import FileError
from storage.model_file import ModelFile, load_model
from storage.yaml_config import model_yaml, yaml_model
from tests.conftest import OUTCOMES

HALLWAY = load_scenario("hallway")
GRID = grid_of(HALLWAY)
#: With the flow of people and against it, and near the walls.
WEIGHTS = np.array([[5.0, 1.0, 0.2], [5.0, -1.5, 0.2]])
N_EPISODES = (14, 8)


@pytest.fixture(scope="module")
def table(tmp_path_factory):
    """What `serd demos` writes of two bags, one of each expert."""
    folder = tmp_path_factory.mktemp("mixed")
    problem, truth = navigation_problem_of(HALLWAY, 0.99), np.array(list(OUTCOMES.values()))
    start = np.zeros(GRID.n_states)
    start[start_states_of(HALLWAY, GRID, "train")] = 1.0
    parts = [
        sample_decisions(
            problem.mdp,
            soft_policy(problem, weights, truth).probabilities,
            truth,
            start / start.sum(),
            n_episodes=n_episodes,
            n_steps=40,
            rng=np.random.default_rng(number),
        )
        for number, (weights, n_episodes) in enumerate(zip(WEIGHTS, N_EPISODES, strict=True))
    ]
    file = folder / "decisions.csv"
    save_decisions(file, concatenate_renumbered([replace(each, source="s") for each in parts]))
    save_grid(folder / "decisions.grid.yaml", GRID, "hallway")
    bags = tuple(
        BagRecord(
            bag=f"bag{number}", n_decisions=len(part), n_episodes=n_episodes, n_diagonal=0,
            n_far=0, dropped={}, n_bad_poses=0,
        )
        for number, (part, n_episodes) in enumerate(zip(parts, N_EPISODES, strict=True))
    )  # fmt: skip
    record = DemonstrationRecord(
        scenario="hallway",
        grid_fingerprint=GRID.fingerprint(),
        decision_period_s=2.0,
        goal_entry_s=(0.5,),
        bags=bags,
    )
    (folder / "decisions.yaml").write_text(model_yaml(record))
    return file


@pytest.fixture
def learned(serd, table):
    """The model of two types, learned once, its values as JSON, and the folder of its report."""
    model, report = table.parent / "model.yaml", table.parent / "report"
    values = table.parent / "values.json"
    if not values.exists():
        words = ("--output", model, "--experts", "auto", "--report", report, "--json")
        ended = serd("learn", table, *words)
        assert ended.code == 0, ended.err
        values.write_text(ended.out)
    return model, json.loads(values.read_text()), report


@pytest.mark.usefixtures("whole_pictures")
def test_two_experts_are_recovered_and_kept_in_the_model(learned):
    path, values, _ = learned
    model = load_model(path)
    assert len(model.types) == 2
    truth = np.repeat([0, 1], N_EPISODES)
    found = np.zeros(len(truth), dtype=int)
    for number, each in enumerate(model.types):
        found[list(each.episodes)] = number
    assert adjusted_rand_index(found, truth) >= 0.9
    assert model.types[0].share > 0.5
    assert model.reward_weights == model.types[0].reward_weights
    for each, weights in zip(model.types, WEIGHTS, strict=True):
        away = np.array(list(each.reward_weights.values())) - weights
        assert np.all(np.abs(away) < 4 * np.array(list(each.reward_deviations.values())))
        assert each.pace == pytest.approx(1.0, abs=0.3)
    evidence = values["log_evidence_by_types"]
    assert evidence["2"] > evidence["1"] + 10
    assert evidence["2"] >= evidence["3"]
    assert [each["share"] for each in values["experts"]] == [each.share for each in model.types]


def test_the_strategy_is_that_of_the_chosen_type(learned):
    path, _, _ = learned
    first, second = (load_strategy(str(path), HALLWAY, "soft", expert=n) for n in (1, 2))
    default = load_strategy(str(path), HALLWAY, "soft")
    np.testing.assert_array_equal(default.policy.probabilities, first.policy.probabilities)
    truth = np.array(list(OUTCOMES.values()))
    expected = [soft_policy(first.problem, weights, truth).probabilities for weights in WEIGHTS]
    for found, own, other in ((first, *expected), (second, *expected[::-1])):
        distance = [np.abs(found.policy.probabilities - each).mean() for each in (own, other)]
        assert distance[0] < 0.5 * distance[1]
    with pytest.raises(FileError, match=r"expert must be from 1 to 2, .*, got 3"):
        load_strategy(str(path), HALLWAY, "soft", expert=3)


def test_the_report_shows_the_groups(learned):
    path, _, folder = learned
    page = (folder / "report.html").read_text()
    assert "<h2>Types of experts</h2>" in page
    assert "Strategy of type 2" in page
    rows = (folder / "experts.csv").read_text().splitlines()
    assert rows[0] == "episode,expert_type"
    assert len(rows) == 1 + sum(N_EPISODES)
    assert {row.split(",")[1] for row in rows[1:]} == {"1", "2"}
    assert (folder / "figures" / "expert_2.png").exists()
    assert len(load_model(path).types) == 2


def test_the_decisions_of_a_recording_share_their_type(serd, table):
    model = table.parent / "by_recording.yaml"
    ended = serd("learn", table, "--output", model, "--experts", "2", "--same-expert", "recording")
    assert ended.code == 0, ended.err
    assert "2 types of experts" in ended.out
    episodes = [each.episodes for each in load_model(model).types]
    assert sorted(episodes, key=min) == [tuple(range(14)), tuple(range(14, 22))]


def test_one_type_leaves_the_model_unchanged(serd, table):
    plain, one = table.parent / "plain.yaml", table.parent / "one.yaml"
    assert serd("learn", table, "--output", plain).code == 0
    assert serd("learn", table, "--output", one, "--experts", "1").code == 0
    assert one.read_bytes() == plain.read_bytes()
    assert b"types:" not in plain.read_bytes()


def test_auto_leaves_the_model_of_one_type_unchanged(table):
    """Of the decisions of one expert."""
    files = read_learning_files(table, discount=0.99)
    decisions = files.demonstrations.decisions.select_episodes(range(8))
    demonstrations = Demonstrations(decisions, files.demonstrations.goal_entry_s)
    found = learn_groups(files.task, demonstrations, LearningSettings(), "auto")
    assert found.groups.types.n_types == 1
    assert found.model == learn(files.task, demonstrations, LearningSettings()).model
    assert found.groups.sentence().startswith("1 type of experts; log evidence")


def test_a_mixture_without_a_maximum_has_no_evidence(table):
    files = read_learning_files(table, discount=0.99)
    found = learn_groups(files.task, files.demonstrations, LearningSettings(), 2).groups
    lost = replace(found.types, log_evidence=-np.inf)
    groups = replace(found, candidates=(found.types, lost))
    assert groups.values()["log_evidence_by_types"][2] is None
    assert groups.sentence().endswith("2: not converged")


def test_types_of_recordings_need_types(serd, table):
    ended = serd("learn", table, "--same-expert", "recording")
    assert ended.code == 2
    assert "add --experts auto" in ended.err


def test_navigate_names_a_type_that_a_model_has_not(serd, learned, save_model_of):
    ended = serd("navigate", learned[0], "--expert", "3", "--episodes", "1")
    assert ended.code == 2
    assert (
        "expert must be from 1 to 2, the number of types of experts in the model, got 3"
        in ended.err
    )
    ended = serd("navigate", save_model_of(), "--expert", "2", "--episodes", "1")
    assert ended.code == 2
    assert "expert must be from 1 to 1" in ended.err
    assert "serd learn --experts auto" in ended.err


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--experts", "many"), "--experts must be auto or a number from 1 to 5, got 'many'"),
        (("--experts", "9"), "--experts must be auto or a number from 1 to 5, got '9'"),
        (
            ("--experts", "2", "--method", "mdce_serd"),
            "--experts needs the method mdce_serd_evidence or mdce_serd_belief_evidence",
        ),
    ],
)
def test_wrong_options_are_named(serd, table, options, message):
    ended = serd("learn", table, *options, "--output", table.parent / "wrong.yaml")
    assert ended.code == 2
    assert message in ended.err


def test_each_type_keeps_the_belief_of_the_relation_of_highest_evidence(table, monkeypatch):
    relations = (BeliefAroundTruth(), FreeBelief())
    monkeypatch.setitem(METHODS, "mdce_serd_belief_evidence", relations)
    files = read_learning_files(table, discount=0.99)
    settings = LearningSettings(method="mdce_serd_belief_evidence")
    outcome = learn_groups(files.task, files.demonstrations, settings, 2)
    chosen = outcome.groups.types
    evidence = dict(
        re.findall(r"(near|independent of) the truth: (-[\d.]+) with 2", outcome.belief)
    )
    best = max(evidence, key=lambda name: float(evidence[name]))
    assert outcome.belief.startswith(f"The beliefs of the types are {best} the truth;")
    assert float(evidence[best]) == pytest.approx(chosen.log_evidence, abs=0.06)
    assert len(evidence) == 2
    for number in (1, 2):
        own = outcome.model.of_expert("m", number).believed_outcome_probabilities
        expected = chosen.believed_outcome_probabilities[number - 1][: len(own)]
        np.testing.assert_allclose(own, expected)
        np.testing.assert_allclose(own, outcome.model.types[number - 1].believed)
    assert yaml_model(model_yaml(outcome.model), ModelFile, name="model") == outcome.model


def test_a_belief_of_another_length_or_sum_is_rejected(learned):
    model = load_model(learned[0])
    row = model.outcome_models[0].believed
    for believed, message in (
        ((row,), "must have a row per outcome model"),
        (((0.5,) * len(row),) * len(model.outcome_models), "types.0..believed must"),
    ):
        types = [each.model_copy(update={"believed": believed}) for each in model.types]
        values = model.model_dump() | {"types": [each.model_dump() for each in types]}
        with pytest.raises(ValueError, match=message):
            type(model).model_validate(values)


def test_a_fault_in_paces_is_not_taken_for_short_episodes(table, monkeypatch):
    def fail(*_):
        raise SerdError("the fit of paces must converge")

    monkeypatch.setattr("serd_app.learning.expert_groups.pace_of_types", fail)
    files = read_learning_files(table, discount=0.99)
    with pytest.raises(SerdError, match="the fit of paces must converge"):
        learn_groups(files.task, files.demonstrations, LearningSettings(), 1)
