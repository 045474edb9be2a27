"""Crossings of cells as a table, and the people around a robot at each."""

from dataclasses import replace
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest

from serd_app.demonstrations.crossing_table import (
    CrossedPlace,
    Crossing,
    crossings_of_track,
    load_crossings,
    people_per_m2,
)
from serd_app.demonstrations.recorded_crossings import people_around
from serd_app.drives.recorded_people import Sighting
from serd_bag.errors import FileError
from serd_core.demonstrations.decisions import HIDDEN
from serd_core.grid.grid import Action, Grid
from serd_files.table import write_rows

GRID = Grid((0.0, 0.0), 1.0, np.ones((4, 4), dtype=bool))
PLACE = CrossedPlace(GRID, np.full(16, Action.EAST), 3, 0.5)
SPEED_MPS = 0.5


def track_of(*corners_m, start_s=10.0):
    """Poses at 20 Hz on straight lines at a constant speed."""
    legs = [np.array([corners_m[0]])]
    for begin, end in pairwise(corners_m):
        n = round(np.hypot(*np.subtract(end, begin)) / SPEED_MPS * 20)
        legs.append(np.linspace(begin, end, n + 1)[1:])
    places = np.concatenate(legs)
    return np.column_stack([start_s + np.arange(len(places)) / 20, places])


EAST_THEN_NORTH = track_of((0.5, 0.5), (2.5, 0.5), (2.5, 2.001))
NOTHING = np.zeros((0, 2))


def test_a_way_at_constant_speed_takes_a_cell_over_the_speed_and_adds_up_to_the_arrival():
    rows = crossings_of_track(PLACE, 7, EAST_THEN_NORTH, NOTHING, arrived=True)
    assert [row.kind for row in rows] == ["first", "straight", "turning", "straight"]
    assert [row.flow for row in rows] == ["with_flow"] * 2 + ["across_flow"] * 2
    total_s = EAST_THEN_NORTH[-1, 0] - EAST_THEN_NORTH[0, 0]
    assert sum(row.dwell_s for row in rows) == pytest.approx(total_s)
    assert rows[0].entered_s == 10.0
    # Half a cell and the hysteresis of a tenth, then a whole cell.
    assert rows[0].dwell_s == pytest.approx(0.6 / SPEED_MPS, abs=1e-6)
    assert rows[1].dwell_s == pytest.approx(1.0 / SPEED_MPS, abs=1e-6)
    assert {row.episode for row in rows} == {7}
    assert {row.action for row in rows} == {HIDDEN}


def test_the_arrival_is_the_end_of_the_episode_though_it_is_short_of_a_crossing():
    arrived = crossings_of_track(PLACE, 0, EAST_THEN_NORTH, NOTHING, arrived=True)
    given_up = crossings_of_track(PLACE, 0, EAST_THEN_NORTH, NOTHING, arrived=False)
    assert len(arrived) == len(given_up) + 1
    last = arrived[-1]
    assert last.entered_s + last.dwell_s == pytest.approx(EAST_THEN_NORTH[-1, 0])
    assert last.next_state == GRID.state_at(2.5, 2.5)


def test_outcomes_are_relative_to_the_last_action_before_the_crossing():
    decided = np.array([[10.0, Action.EAST], [14.0, Action.EAST], [14.5, Action.WEST]])
    rows = crossings_of_track(PLACE, 0, EAST_THEN_NORTH, decided, arrived=True)
    assert [row.outcome for row in rows] == ["forward", "forward", "right", "right"]
    assert rows[-1].action_flow == "against_flow"


def test_a_waiting_robot_that_is_carried_on_has_no_outcome():
    decided = np.array([[10.0, Action.WAIT]])
    rows = crossings_of_track(PLACE, 0, EAST_THEN_NORTH, decided, arrived=True)
    assert {(row.outcome, row.action_flow) for row in rows} == {("", "")}


def test_a_table_reads_back_and_names_the_line_of_a_fault(tmp_path):
    rows = crossings_of_track(PLACE, 0, EAST_THEN_NORTH, NOTHING, arrived=True)
    path = tmp_path / "crossings.csv"
    write_rows(path, Crossing, rows)
    assert load_crossings(path) == tuple(rows)
    for change, message in (
        ({"dwell_s": 0.0}, r"line 3, dwell_s must be above 0, got 0.0"),
        ({"kind": "slow"}, r"kind must be straight, turning or first, got 'slow'"),
        ({"flow": "up"}, r"flow must be with_flow, against_flow or across_flow, got 'up'"),
        ({"lookahead_cells": 0}, "lookahead_cells must be at least 1, got 0"),
    ):
        write_rows(path, Crossing, [rows[0], replace(rows[1], **change)])
        with pytest.raises(FileError, match=message):
            load_crossings(path)


def test_people_are_counted_per_walkable_area():
    assert people_per_m2(GRID, 8) == 0.5


BAG = SimpleNamespace(crowd=None)


def seen(time_s: float, *places_m: tuple[float, float, float]) -> Sighting:
    people = SimpleNamespace(position_m=np.array(places_m, dtype=np.float64).reshape(-1, 3))
    return Sighting(time_s, people, b"")


def counts(sightings, *times_s: float) -> list[int | None]:
    found = people_around(BAG, 0, sightings)(np.array(times_s))
    return [None if people is None else len(people) for people in found]


def test_the_last_sighting_at_most_a_second_before_counts():
    sightings = [seen(1.0, (2.5, 2.5, 0.0)), seen(2.0), seen(4.0, (2.5, 1.5, 0.0), (0.5, 0.5, 0.0))]
    assert counts(sightings, 0.5, 1.5, 2.0, 4.2, 5.0, 5.01) == [None, 1, 0, 2, 2, None]


def test_people_without_a_place_are_left_out():
    assert counts([seen(1.0, (2.5, 2.5, 0.0), (np.nan, 1.0, 0.0))], 1.0) == [1]


def test_sightings_of_a_clock_that_goes_back_are_not_known():
    person = (2.5, 2.5, 0.0)
    assert counts([seen(2.0, person), seen(1.0, person)], 1.0, 2.0) == [None, None]
