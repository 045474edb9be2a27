"""Records come back from files as they were; nothing else is read or written."""

import json
from contextlib import suppress

import numpy as np
import pytest

import serd_core as sc


def test_problem_decisions_and_fit_come_back_with_the_same_numbers(gridworld, tmp_path):
    fit = sc.fit_mdce_serd(gridworld.problem, gridworld.decisions)
    for record in (gridworld.problem, gridworld.decisions, fit):
        sc.save(tmp_path / "record.npz", record)
        again = sc.load(tmp_path / "record.npz")
        assert type(again) is type(record)
    assert again.summary() == fit.summary()
    assert again.assumptions == fit.assumptions
    np.testing.assert_array_equal(again.parameters.vector, fit.parameters.vector)
    sc.save(tmp_path / "problem.npz", gridworld.problem)
    problem = sc.load(tmp_path / "problem.npz")
    information = [
        sc.fit_information(each, gridworld.decisions, fit).observed
        for each in (problem, gridworld.problem)
    ]
    np.testing.assert_array_equal(*information)


def test_known_transitions_come_back(tmp_path):
    problem = sc.from_transitions(np.full((2, 1, 2), 0.5), np.eye(2), discount=0.9)
    sc.save(tmp_path / "problem.npz", problem)
    value = sc.soft_policy(sc.load(tmp_path / "problem.npz"), [1.0, 2.0]).value
    np.testing.assert_array_equal(value, sc.soft_policy(problem, [1.0, 2.0]).value)


def test_functions_are_refused_and_leave_the_old_file(tmp_path):
    model = sc.SparseModel((1, 1), [0], [0], [0], 0, lambda _: np.ones(1), lambda *_: np.zeros(0))
    (tmp_path / "old.npz").write_bytes(b"old")
    with pytest.raises(sc.SerdError, match=r"SparseModel.probabilities must be an array"):
        sc.save(tmp_path / "old.npz", model)
    assert (tmp_path / "old.npz").read_bytes() == b"old"


def test_a_record_that_cannot_be_placed_leaves_no_file(gridworld, tmp_path):
    (tmp_path / "taken.npz").mkdir()
    with pytest.raises(OSError, match="directory"):
        sc.save(tmp_path / "taken.npz", gridworld.decisions)
    assert [path.name for path in tmp_path.iterdir()] == ["taken.npz"]


@pytest.mark.parametrize("seed", range(40))
def test_damaged_files_are_refused_or_read_as_they_were(tmp_path, seed):
    file = tmp_path / "grid.npz"
    sc.save(file, table := np.linspace(0.0, 1.0, 500))
    content = bytearray(file.read_bytes())
    rng = np.random.default_rng(seed)
    for place in rng.integers(len(content), size=3):
        content[place] = rng.integers(256)
    file.write_bytes(content)
    with suppress(sc.SerdError):
        np.testing.assert_array_equal(sc.load(file), table)


@pytest.mark.parametrize("place", ["os:system", "serd_core.files:Path", "serd_core.nothing:None"])
def test_a_file_cannot_name_other_classes(tmp_path, place):
    record = {"class": place, "fields": {}}
    text = json.dumps({"format": "serd-core 1", "record": record})
    np.savez(tmp_path / "made.npz", structure=np.array(text))
    with pytest.raises(sc.SerdError, match="must be of a class of serd_core, got"):
        sc.load(tmp_path / "made.npz")


def test_other_files_are_refused(tmp_path):
    (tmp_path / "text.npz").write_text("no archive")
    np.savez(tmp_path / "arrays.npz", one=np.ones(1))
    text = json.dumps({"format": "serd-core 1", "record": {"class": 5, "fields": {}}})
    np.savez(tmp_path / "class.npz", structure=np.array(text))
    for name in ("text.npz", "arrays.npz", "class.npz"):
        with pytest.raises(sc.SerdError, match="must be a file written by save"):
            sc.load(tmp_path / name)


def test_a_mixture_of_experts_comes_back(tmp_path):
    rng = np.random.default_rng(0)
    table = rng.dirichlet(np.ones(4), size=(4, 2))
    problem = sc.from_transitions(table, rng.normal(size=(4, 2, 1)), discount=0.8)
    policy = sc.soft_policy(problem, [1.0]).probabilities
    decisions = sc.sample_decisions(problem.mdp, policy, n_episodes=8, n_steps=6, rng=rng)
    types = sc.fit_expert_types(problem, decisions, 2)
    sc.save(tmp_path / "types.npz", types)
    read = sc.load(tmp_path / "types.npz")
    np.testing.assert_array_equal(read.reward_weights, types.reward_weights)
    # Computed anew, from other starting values of the Bellman equation.
    np.testing.assert_allclose(read.responsibilities, types.responsibilities, atol=1e-12)
