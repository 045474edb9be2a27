"""Density of people at decisions: measured, joined, kept beside the table."""

import numpy as np
import pytest

from serd_app.demonstrations.measured_density import (
    LONGEST_AGE_S,
    density_at,
    joined_density,
    load_density,
    save_density,
)
from serd_core.demonstrations.decisions import Decisions
from serd_core.grid.density import KERNEL_M
from serd_core.grid.grid import Action, Grid
from storage.errors import FileError

GRID = Grid((0.0, 0.0), 1.0, np.ones((4, 5), dtype=np.bool_))
MIDDLE = int(GRID.states_at([[2.5, 1.5]])[0])
PEAK = 1.0 / (2 * np.pi * KERNEL_M**2)


def decisions_at(*times_s: float) -> Decisions:
    number = len(times_s)
    state = np.full(number, MIDDLE)
    return Decisions(np.zeros(number, int), np.array(times_s), state, np.ones(number, int), state)


def test_a_person_ahead_adds_the_height_of_the_kernel_to_that_cell_alone():
    found = density_at(GRID, decisions_at(1.0), np.array([1.0]), [np.array([[2.5, 2.5]])])
    row = found.aimed_at_pm2[0]
    assert row[Action.NORTH] == pytest.approx(PEAK)
    assert row[Action.WAIT] == pytest.approx(PEAK * np.exp(-0.5 / KERNEL_M**2))
    assert row[Action.SOUTH] < 0.01 * PEAK
    assert found.mean_pm2[GRID.neighbours[MIDDLE, Action.NORTH]] == pytest.approx(PEAK)


def test_the_last_sighting_before_a_decision_counts_unless_it_is_old():
    times_s = np.array([1.0, 2.0, 4.0])
    people = [np.array([[2.5, 2.5]]), np.zeros((0, 2)), np.array([[2.5, 1.5]])]
    late = 4.0 + LONGEST_AGE_S + 0.01
    found = density_at(GRID, decisions_at(0.5, 1.5, 2.0, 4.2, late), times_s, people)
    known = np.isfinite(found.aimed_at_pm2).all(axis=1)
    assert known.tolist() == [False, True, True, True, False]
    assert found.n_known == 3
    assert found.aimed_at_pm2[1, Action.NORTH] == pytest.approx(PEAK)
    assert found.aimed_at_pm2[2].tolist() == [0.0] * 5
    assert found.aimed_at_pm2[3, Action.WAIT] == pytest.approx(PEAK)


def test_means_of_several_recordings_are_over_all_decisions():
    near = [np.array([[2.5, 1.5]])] * 3
    first = density_at(GRID, decisions_at(1.0, 2.0, 3.0), np.array([1.0, 2.0, 3.0]), near)
    second = density_at(GRID, decisions_at(1.0), np.array([1.0]), [np.zeros((0, 2))])
    none = density_at(GRID, decisions_at(1.0), np.zeros(0), [])
    found = joined_density([first, second, none])
    assert found.aimed_at_pm2.shape == (5, 5)
    assert found.mean_pm2[MIDDLE] == pytest.approx(0.75 * PEAK)


def test_tables_beside_the_decisions_are_read_back_and_those_of_others_rejected(tmp_path):
    table, decisions = tmp_path / "decisions.csv", decisions_at(1.0, 9.0)
    found = density_at(GRID, decisions, np.array([1.0]), [np.array([[2.5, 2.5]])])
    save_density(table, GRID, decisions, found)
    read = load_density(table, GRID, decisions)
    np.testing.assert_allclose(read.aimed_at_pm2, found.aimed_at_pm2, atol=1e-4)
    np.testing.assert_allclose(read.mean_pm2, found.mean_pm2, atol=1e-4)
    with pytest.raises(FileError, match="must have a row for each decision"):
        load_density(table, GRID, decisions_at(1.0, 2.0))
    save_density(table, GRID, decisions, None)
    with pytest.raises(FileError, match=r"density\.csv must be there to learn with density"):
        load_density(table, GRID, decisions)
