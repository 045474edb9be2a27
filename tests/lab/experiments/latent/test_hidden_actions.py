import numpy as np
import pandas as pd
import pytest

from lab.experiments.latent.hidden_actions import (
    FEATURES,
    KINDS,
    MOVES,
    TERRAINS,
    TRUTH,
    HiddenActionsConfig,
    learn_one_world,
    summary_of,
    terrain_problem,
    with_actions,
)
from serd_core.demonstrations.decisions import Decisions
from serd_core.grid.grid import Action, Grid, Outcome
from serd_core.grid.navigation import outcome_successors

CONFIG = HiddenActionsConfig(n_repetitions=1, sizes=(100, 300), side=5)


def test_every_size_kind_and_number_has_a_row():
    table = pd.DataFrame(learn_one_world(CONFIG, 0))
    found = [tuple(key) for key in table[["size", "kind", "number"]].to_numpy()]
    assert found == [
        (size, kind, name)
        for size in (100, 300)
        for kind in KINDS
        for name in (*FEATURES, *TERRAINS)
    ]
    good = table[table["converged"]]
    assert len(good) > 0
    assert np.all((good["lower"] <= good["estimate"]) & (good["estimate"] <= good["upper"]))


def test_a_fifth_of_the_episodes_keeps_its_actions():
    column = np.arange(10)
    decisions = Decisions(column, column, column, column % 4, column)
    shown = ~with_actions(decisions, "a fifth shown").hidden
    np.testing.assert_array_equal(np.flatnonzero(shown), [0, 5])
    assert with_actions(decisions, "hidden").hidden.all()
    assert not with_actions(decisions, "shown").hidden.any()


def test_outcomes_are_relative_to_the_direction():
    grid = Grid((0.0, 0.0), 1.0, np.ones((3, 3), bool))
    middle = outcome_successors(grid, np.broadcast_to(MOVES, (grid.n_states, len(MOVES))))[4]
    neighbours = grid.neighbours[4]
    assert middle[0, Outcome.FORWARD] == neighbours[Action.NORTH]
    assert middle[0, Outcome.RIGHT] == neighbours[Action.EAST]
    assert middle[3, Outcome.RIGHT] == neighbours[Action.NORTH]
    assert middle[2, Outcome.BACK] == neighbours[Action.NORTH]
    np.testing.assert_array_equal(middle[:, Outcome.STAY], 4)
    np.testing.assert_allclose(TRUTH.sum(axis=1), 1.0)
    problem = terrain_problem(CONFIG, np.random.default_rng(0))
    assert problem.mdp.transitions.n_models == len(TERRAINS)


def test_the_summary_counts_coverage_and_bias():
    row = {"number": "goal", "size": 1, "kind": "hidden", "truth": 4.0, "converged": True}
    rows = [
        row | {"estimate": 4.5, "lower": 3.0, "upper": 5.0},
        row | {"estimate": 5.5, "lower": 5.0, "upper": 6.0},
        row | {"estimate": 9.9, "lower": 9.0, "upper": 9.9, "converged": False},
    ]
    (found,) = summary_of(pd.DataFrame(rows)).to_dict("records")
    assert found["coverage"] == 0.5
    assert found["bias"] == pytest.approx(1.0)
    assert (found["n"], found["failed"]) == (2, 1)
