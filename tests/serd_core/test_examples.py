"""The examples in docstrings of the flat interface run."""

import inspect
import re
import textwrap
from dataclasses import replace

import gymnasium
import numpy as np
import pandas
import pytest

import serd_core as sc
from serd_core import plots
from serd_core.arrival.law import ArrivalLaw
from tests.support.small_problems import room, sampled

PUBLIC = {name: getattr(sc, name) for name in dir(sc)}
PUBLIC |= {
    name: part
    for name, part in vars(plots).items()
    if getattr(part, "__module__", "") == plots.__name__ and name[0] != "_"
}
DOCUMENTS = {name: inspect.getdoc(part) or "" for name, part in PUBLIC.items()}
EXAMPLES = {name: re.findall(r"(?:^    .*\n?)+", text, re.M) for name, text in DOCUMENTS.items()}
#: Indented lines that are no program.
FORMULA = "    CRPS = integral"


def place(goal, n=2):
    whole = room(5, 5, goal)
    return replace(whole, features=whole.features[..., :n], feature_names=whole.feature_names[:n])


@pytest.fixture(scope="module")
def given():
    """What examples take as given, by the names that they use."""
    rng, (n_states, n_models, state, action) = np.random.default_rng(0), (25, 4, 3, 1)
    table, weights = 0.1 + 0.5 * np.eye(5)[[1, 1, 1, 0]], np.array([0.5, 0.5])
    starts, transitions = np.full(25, 0.04), np.full((25, 5, 25), 0.04)
    problem, other_problem = place(24), place(0)
    features, models = problem.features, problem.mdp.transitions
    policy = sc.soft_policy(problem, weights, table)
    samples = drives_to_lift = drives_to_door = sampled(
        problem, policy.probabilities, table, 30, 15
    )
    entries = problem.mdp.transitions.groups
    known = np.zeros((25, 5, 25))
    known[entries.row // 5, entries.row % 5, entries.successor] = 1.0
    known /= np.maximum(known.sum(axis=2, keepdims=True), 1.0)
    to_lift = to_door = sc.from_transitions(known, features, discount=0.95)
    timed = sc.semi_markov_problem(problem, law_of=np.repeat([[0] * 5, [1] * 5], [3, 1], axis=0))
    truth = timed.mdp.transitions.parameters_from(table, [1.0, 3.0], 6.0)
    decisions = sc.sample_timed_decisions(
        timed.mdp, policy.probabilities, truth, starts, n_episodes=20, n_steps=15, rng=rng
    )
    fit, timed_fit = (sc.fit_mdce_serd(each, decisions) for each in (problem, timed))
    found = sc.laplace(problem, decisions, fit)
    law, errors = (
        ArrivalLaw(np.arange(9.0), np.linspace(0.0, 0.9, 9), 1.0),
        sc.standard_errors(problem, sc.fit_information(problem, decisions, fit)),
    )
    steps = [(0, 0), (0, 1), (1, 0), (0, -1), (-1, 0)]
    fit_without_walls = sc.fit_mdce_serd(place(24, 1), decisions, rng=rng, prior=sc.UniformPrior())
    return locals() | {"sc": sc, "np": np, "pandas": pandas, "gymnasium": gymnasium, "plots": plots}


@pytest.mark.parametrize("name", sorted(filter(EXAMPLES.get, EXAMPLES)))
def test_the_examples_of_a_docstring_run(name, given, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    pandas.DataFrame(given["decisions"].columns()).to_csv("decisions.csv")
    for example in (each for each in EXAMPLES[name] if not each.startswith(FORMULA)):
        fit = given["timed_fit" if "timed" in example else "fit"]
        names = given | {"fit": fit, "rng": np.random.default_rng(1)}
        exec(compile(textwrap.dedent(example), name, "exec"), names)


def test_every_function_has_an_example_and_none_lost_its_indent():
    functions = {name for name, part in PUBLIC.items() if inspect.isfunction(part)}
    assert {name for name in functions if "(" not in "".join(EXAMPLES[name])} == {
        "move_log_likelihood"
    }
    pattern = re.compile(r"^(\S.*\b)?sc\.", re.M)
    assert [name for name, text in DOCUMENTS.items() if pattern.search(text)] == []
