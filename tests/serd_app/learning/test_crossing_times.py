"""The law of crossing times that a model file keeps."""

from dataclasses import replace

import numpy as np
import pytest

from serd_app.demonstrations.crossing_table import Crossing
from serd_app.errors import AppError
from serd_app.learning.crossing_times import (
    fit_crossing_times,
    leaving_outcomes,
    load_times,
    mean_and_kind,
    pace_of_a_drive,
    paces_of_draws,
    unseen_sentence,
)
from serd_core.arrival.crossing_chain import Kind
from serd_files.table import write_rows

TABLE = np.array(
    [
        [0.2, 0.6, 0.1, 0.02, 0.08],
        [0.5, 0.3, 0.1, 0.05, 0.05],
        [0.3, 0.5, 0.05, 0.05, 0.1],
        [0.9, 0.04, 0.02, 0.02, 0.02],
    ]
)


def drives(n_episodes, people=(0.2,), lookahead=3, seed=0):
    """Gamma times of mean 1 s, twice that where it turns, e^p times at p people more per m²."""
    rng, rows = np.random.default_rng(seed), []
    for episode in range(n_episodes):
        density = people[episode % len(people)]
        pace = np.exp(rng.normal(0.0, 0.1))
        for number in range(25):
            kind = "first" if not number else "turning" if number % 5 == 0 else "straight"
            mean = pace * np.exp(density) * (2.0 if kind == "turning" else 1.0)
            rows.append(
                Crossing(
                    episode, lookahead, density, 0, 1, "with_flow", kind, 0.0,
                    rng.gamma(10.0, mean / 10.0), 1, "with_flow",
                    "left" if number == 3 else "forward",
                )
            )  # fmt: skip
    return rows


def test_times_of_simulated_drives_are_recovered():
    times = fit_crossing_times([drives(60, people=(0.2, 0.6))])
    found = times.coefficients
    assert found["turning"] == pytest.approx(np.log(2.0), abs=0.05)
    assert found["people_pm2"] == pytest.approx(1.0, abs=0.25)
    at_mean = np.exp(found["intercept"])
    assert at_mean == pytest.approx(np.exp(times.mean_people_pm2), rel=0.05)
    assert times.pace_variance == pytest.approx(0.01, abs=0.005)
    assert times.dispersion["straight"] == pytest.approx(0.1, abs=0.02)
    assert times.people_pm2 == (0.2, 0.6)
    assert (times.n_crossings, times.n_episodes) == (1500, 60)


def test_one_number_of_people_leaves_their_influence_at_none():
    assert fit_crossing_times([drives(5)]).coefficients["people_pm2"] == pytest.approx(0, abs=1e-9)


@pytest.mark.parametrize("seen", [("across_flow",), ("across_flow", "against_flow")])
def test_flows_that_were_not_seen_have_the_times_of_the_most_frequent_one(seen):
    rows = [
        replace(row, flow=seen[row.kind == "first"] if len(seen) > 1 else seen[0])
        for row in drives(20)
    ]
    times = fit_crossing_times([rows])
    unseen = [name for name in ("with_flow", "against_flow") if name not in seen]
    assert times.not_seen == tuple(unseen)
    usual_s = np.mean([row.dwell_s for row in rows if row.kind == "straight"])
    for flow in (seen[0], *unseen):
        mean_s, _ = mean_and_kind(times, flow, Kind.STRAIGHT, 0.2)
        assert mean_s[0] == pytest.approx(usual_s, rel=0.1)
    assert f"no crossing was {', '.join(unseen)}; such" in unseen_sentence(times)


def test_contrasts_do_not_depend_on_what_is_most_frequent():
    rows = [
        replace(row, flow="with_flow" if number % 10 == 3 else "against_flow")
        for number, row in enumerate(drives(30))
    ]
    turned = [replace(row, flow="with_flow" if row.flow != "with_flow" else "against_flow")
              for row in rows]  # fmt: skip
    first, other = (fit_crossing_times([each]).coefficients for each in (rows, turned))
    assert first["against_flow"] == pytest.approx(-other["against_flow"], abs=1e-4)
    assert first["turning"] == pytest.approx(other["turning"], abs=1e-4)
    assert (
        unseen_sentence(fit_crossing_times([[*rows, replace(rows[0], flow="across_flow")]])) == ""
    )


def test_episodes_of_two_tables_are_different_drives():
    assert fit_crossing_times([drives(3), drives(3, seed=1)]).n_episodes == 6


def test_few_drives_leave_the_pace_of_the_next_more_open():
    times = fit_crossing_times([drives(4)])
    assert pace_of_a_drive(times).variance == pytest.approx(1.25 * times.pace_variance)
    paces = paces_of_draws(times, 400)
    between = np.var([pace.mean for pace in paces])
    assert between + paces[0].variance == pytest.approx(1.25 * times.pace_variance, rel=0.01)


def test_outcomes_of_drives_have_those_of_the_model_as_prior():
    times = fit_crossing_times([drives(4)])
    found = leaving_outcomes(times, TABLE)
    assert found.sum(axis=1) == pytest.approx(1.0)
    prior = TABLE[0, 1:] / TABLE[0, 1:].sum()
    counts = np.array([96, 0, 0, 4])
    assert found[0, 1:] == pytest.approx((counts + prior) / 101.0)
    # Nothing was counted against and across the flow.
    assert found[1, 1:] == pytest.approx(TABLE[1, 1:] / 0.5)
    assert found[3, 1:] == pytest.approx(TABLE[3, 1:] / 0.1)


def test_each_look_ahead_of_the_tables_has_times_of_its_own(tmp_path):
    for number, ahead in enumerate((3, 2)):
        write_rows(tmp_path / f"{number}.csv", Crossing, drives(3, lookahead=ahead))
    found = load_times([tmp_path / "0.csv", tmp_path / "1.csv"])
    assert [each.lookahead_cells for each in found] == [2, 3]
    assert load_times([]) == ()


def test_too_few_drives_are_refused(tmp_path):
    with pytest.raises(AppError, match=r"at least 3 episodes per look-ahead, got 2; drive more"):
        fit_crossing_times([drives(2)])
    write_rows(tmp_path / "none.csv", Crossing, [])
    with pytest.raises(AppError, match=r"must hold crossings, got none in .*none\.csv"):
        load_times([tmp_path / "none.csv"])


def test_a_table_that_is_named_twice_is_rejected(tmp_path):
    path = tmp_path / "crossings.csv"
    write_rows(path, Crossing, drives(5))
    with pytest.raises(AppError, match="--times must name each table once, got"):
        load_times([path, tmp_path / "." / "crossings.csv"])
