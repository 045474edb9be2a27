"""The people study in miniature, on generated corridors, and its parts."""

from ast import literal_eval

import numpy as np
import pandas as pd
import pytest

from lab.experiments.study.people.fold import in_band, log_likelihood, scored, task_of
from lab.experiments.study.people.folds import folds_of
from lab.experiments.study.people.learners import (
    COUNT,
    HIDDEN_ACTIONS,
    IRL,
    LEARNERS,
    NOBODY,
    ONE_LAW,
    SERD,
    counts,
    nobody,
)
from lab.experiments.study.people.people import Asked, People
from lab.experiments.study.people.run import PeopleStudy, run_people, stages_of
from lab.experiments.study.people.settings import people_settings
from lab.experiments.study.people.tables import headline, summary_of
from lab.experiments.study.people.walkers import CONSTANT_VELOCITY, scaled_law, straight_s
from serd_core.arrival.law import ArrivalLaw
from serd_core.arrival.scores import crps_s
from serd_core.grid.grid import Action
from serd_core.mdp.mdp import checked_policy
from serd_sim.episodes.execution import Execution

SERIAL = Execution(n_jobs=1)
TINY = "training_people: 16\nstatistics: {bootstrap: 20}\n"


def all_people(people):
    return np.ones(len(people.walkers), dtype=np.bool_)


def settings_of(files, tmp_path, extra="", **given):
    config = tmp_path / "tiny.yaml"
    config.write_text(TINY + extra)
    return people_settings(files, quick=True, config=config, **given)


@pytest.mark.slow
def test_the_study_runs_from_a_file_to_tables_and_resumes(corridor, tmp_path):
    settings = settings_of([corridor()], tmp_path)
    folder, calls = tmp_path / "people", []
    tables = run_people(settings, folder, SERIAL, lambda *each: calls.append(each))
    assert not any(stage.missing for stage in stages_of(PeopleStudy(settings, folder / "work")))
    methods = list(headline(tables)["method"])
    assert set(methods) == {*LEARNERS, CONSTANT_VELOCITY}
    summary = tables["summary"].set_index("method")
    for method in (SERD, HIDDEN_ACTIONS, IRL, ONE_LAW, COUNT):
        assert summary.loc[method, "crps_s"] < 0.5 * summary.loc[NOBODY, "crps_s"]
        assert 0.3 < summary.loc[method, "coverage_90"] <= 1.0
    for method in (SERD, IRL, ONE_LAW):
        assert summary.loc[method, "log_likelihood"] > summary.loc[NOBODY, "log_likelihood"]
    # In a free corridor people keep their pace, which is what constant velocity assumes.
    assert summary["crps_s"].idxmin() == CONSTANT_VELOCITY
    assert np.isnan(summary.loc[CONSTANT_VELOCITY, "log_likelihood"])
    people = tables["recordings"]["people"].sum()
    assert tables["arrivals"].groupby("method")["walker"].nunique().eq(people).all()
    for name in ("summary.csv", "paired.csv", "people.png", "settings.yaml"):
        assert (folder / name).stat().st_size > 100

    fold = folder / "work" / "folds" / "01.json"
    before, written = fold.read_text(), fold.with_name("00.json").stat().st_mtime_ns
    fold.unlink()
    run_people(settings, folder, SERIAL, lambda *_: None)
    assert fold.read_text() == before
    assert fold.with_name("00.json").stat().st_mtime_ns == written


@pytest.mark.slow
def test_runs_of_other_widths_units_and_axes_are_learned_together(corridor, tmp_path):
    files = [
        corridor("a", seed=1, n_people=24),
        corridor("b", seed=2, n_people=24, width_m=4.0, fps=25),
        corridor("c", seed=3, n_people=24, along="y", two_way=False),
    ]
    config = tmp_path / "folds.yaml"
    config.write_text(
        "{training_people: 48, folds: {number: 3, runs: 3}, statistics: {bootstrap: 20}}"
    )
    settings = people_settings(files, quick=True, config=config)
    tables = run_people(settings, tmp_path / "runs", SERIAL, lambda *_: None)
    assert list(tables["recordings"]["rows"]) == [3, 5, 3]
    # Each fold predicts a file: b is wider than those learned from, c has one direction only.
    folds = tables["moves"].pivot(index="method", columns="fold", values="log_likelihood")
    for method in (SERD, HIDDEN_ACTIONS, IRL, ONE_LAW):
        assert np.all(folds.loc[method] > folds.loc[NOBODY])
    assert tables["summary"]["without_median"].eq(0).all()
    assert "files: [a.txt, b.txt, c.txt]" in (tmp_path / "runs" / "settings.yaml").read_text()


def test_the_flow_of_a_narrow_corridor_covers_a_wide_one(corridor, tmp_path):
    files = [corridor("narrow"), corridor("wide", width_m=4.0)]
    people = People.read(settings_of(files, tmp_path))
    narrow, wide = people.runs
    assert (narrow.grid.walkable.shape[0], wide.grid.walkable.shape[0]) == (3, 5)
    own = people.decisions_of(people.run_of == 0)
    left = own.select(people.place.grid.centers_m[own.state, 1] > 1.6)
    flow = people.place.flow(left, people.signs_of(left))
    first = people.place.start[1]
    # All walk on their left, so on their right are those who come the other way.
    for cells, run in ((flow[:first], narrow), (flow[first:], wide)):
        rows = cells.reshape(run.grid.walkable.shape)
        assert np.all(rows[-1, 1:-1] == Action.EAST)
        assert np.all(rows[0, 1:-1] == Action.WEST)


def test_who_walks_in_one_direction_flows_ahead(corridor, tmp_path):
    people = People.read(settings_of([corridor(two_way=False)], tmp_path))
    flow = people.place.flow(people.decisions, people.signs_of(people.decisions))
    assert np.all(flow == Action.EAST)


def test_a_file_of_other_content_is_not_resumed(corridor, tmp_path):
    path = corridor()
    study = PeopleStudy(settings_of([path], tmp_path), tmp_path / "work")
    before = [stage.description for stage in stages_of(study)]
    path.write_text(path.read_text().replace(" 170", " 171"))
    after = [stage.description for stage in stages_of(study)]
    assert all(one != other for one, other in zip(before, after, strict=True))


def test_both_directions_walk_ahead_and_keep_their_left(corridor, tmp_path):
    for along in ("x", "y"):
        run = People.read(settings_of([corridor(along=along)], tmp_path)).runs[0]
        assert {walker.sign for walker in run.walkers} == {-1, 1}
        for walker in run.walkers:
            assert walker.position_m[-1, 0] > walker.position_m[0, 0] + 8
        first, second = run.walkers[0], run.walkers[1]
        turned = np.array([first.position_m[:, 1].mean(), second.position_m[:, 1].mean()])
        assert np.all(np.abs(turned) < run.width_m / 2)


@pytest.mark.parametrize("n_files", [1, 2, 5])
def test_no_person_is_on_both_sides_of_a_fold(corridor, tmp_path, n_files):
    files = [corridor(f"run{i}", seed=i, n_people=60) for i in range(n_files)]
    settings = settings_of(files, tmp_path, "folds: {number: 3, gap_s: 1.5}\n")
    people = People.read(settings)
    folds = folds_of(people.runs, settings.folds)
    assert np.all(sum(fold.test.astype(int) for fold in folds) == 1)
    walkers = [walker for run in people.runs for walker in run.walkers]
    for fold in folds:
        assert not np.any(fold.test & fold.training)
        for i in np.flatnonzero(fold.test):
            for j in np.flatnonzero(fold.training & (people.run_of == people.run_of[i])):
                one, other = walkers[i], walkers[j]
                apart = max(one.time_s[0] - other.time_s[-1], other.time_s[0] - one.time_s[-1])
                assert apart >= 1.5


def test_decisions_are_the_way_of_a_person_cell_by_cell(corridor, tmp_path):
    people = People.read(settings_of([corridor("a", seed=1), corridor("b", seed=2)], tmp_path))
    decisions, place = people.decisions, people.place
    assert decisions.hidden.all()
    assert not decisions.censored.any()
    near = place.grid.neighbours[decisions.state]
    assert np.all(np.any(near == decisions.next_state[:, None], axis=1))
    for one in people.asked:
        own = decisions.select(decisions.episode == one.walker)
        assert np.all(own.next_state[:-1] == own.state[1:])
        np.testing.assert_allclose(own.time_s[:-1] + own.dwell_s[:-1], own.time_s[1:])
        assert np.flatnonzero(np.isin(own.next_state, place.goal_states)) == len(own) - 1
        later = own.select(own.time_s >= one.time_s)
        assert one.duration_s == pytest.approx(later.dwell_s.sum())
        run, walker = people.runs[people.run_of[one.walker]], people.walkers[one.walker]
        line_m = run.goal_line_m + 0.1 * run.grid.cell_size_m
        # Somebody who passes a cell at its corner arrives up to 0.02 s later.
        assert -1e-6 < walker.ahead_m(one.time_s + one.duration_s) - line_m < 0.02 * 2.0


def test_who_stands_in_a_cell_for_longer_than_patience_has_stayed(corridor, tmp_path):
    path = corridor(spacing_s=6.0)
    rows = [row.split() for row in path.read_text().splitlines()]
    place = next(row for row in rows[2:] if row[0] == "7" and abs(float(row[2])) < 10)
    for row in rows[2:]:
        if row[0] == "7" and int(row[1]) > int(place[1]):
            row[1] = str(int(row[1]) + 16 * 6)
    frames = range(int(place[1]) + 1, int(place[1]) + 16 * 6 + 1)
    stands = [["7", str(frame), *place[2:]] for frame in frames]
    path.write_text("\n".join(" ".join(row) for row in (*rows, *stands)) + "\n")
    people = People.read(settings_of([path], tmp_path))
    stayed = people.decisions.select(people.decisions.next_state == people.decisions.state)
    assert len(stayed) == 1
    assert people.walkers[stayed.episode[0]].name == "7"
    assert stayed.dwell_s[0] == pytest.approx(4.0, abs=0.1)


def test_counts_are_shares_of_directions_and_of_times(corridor):
    people = People.read(people_settings([corridor()], quick=True))
    task = task_of(people, all_people(people))
    found, place, decisions = counts(task), people.place, people.decisions
    shares = checked_policy("shares", found.chain.toarray())
    towards = np.argmax(
        place.grid.neighbours[decisions.state] == decisions.next_state[:, None], axis=1
    )
    here = place.part[decisions.state] == 12
    assert here.sum() > 10
    every = np.bincount(towards, minlength=5) / len(towards)
    expected = (np.bincount(towards[here], minlength=5) + every) / (here.sum() + 1)
    inside = np.flatnonzero(place.part == 12)
    free = np.all(place.grid.neighbours[inside, 1:] != inside[:, None], axis=1)
    assert free.any()
    for state in inside[free]:
        np.testing.assert_allclose(shares[state, place.grid.neighbours[state]], expected)
    # All decisions before the goal lead into it by chance alone, so times are those of one move.
    last = place.goal_states[0] - 1
    median_s = people.times_s[np.argmax(found.arrival.cdf[:, last] >= 0.5)]
    assert median_s == pytest.approx(np.median(decisions.dwell_s), rel=0.5)


def test_without_people_the_way_is_straight_and_its_time_nearly_unknown(corridor, tmp_path):
    people = People.read(settings_of([corridor()], tmp_path))
    found = nobody(task_of(people, all_people(people)))
    ahead = people.place.grid.neighbours[:, Action.EAST]
    moving = np.setdiff1d(np.arange(len(ahead)), people.place.goal_states)
    np.testing.assert_allclose(found.chain.toarray()[moving, ahead[moving]], 1.0)
    law = ArrivalLaw(people.times_s, found.arrival.cdf[:, people.asked[0].state], 1.0)
    assert law.probability_by(0.5 * people.asked[0].duration_s) > 0.2
    assert law.probability_by(people.times_s[-1]) < 0.8


def test_the_likelihood_of_moves_is_that_of_the_chain(corridor, tmp_path):
    people = People.read(settings_of([corridor()], tmp_path))
    found = nobody(task_of(people, all_people(people)))
    one = people.decisions.select(np.array([0]))
    ahead = people.place.grid.neighbours[one.state, Action.EAST] == one.next_state
    assert log_likelihood(found, one) == pytest.approx(0.0 if ahead[0] else np.log(1e-4))


def test_a_person_who_walks_straight_is_predicted_by_constant_velocity(corridor, tmp_path):
    settings = settings_of([corridor(spacing_s=6.0, n_people=20)], tmp_path)
    people = People.read(settings)
    measured = np.array([one.duration_s for one in people.asked])
    predicted = np.array([straight_s(people, one) for one in people.asked])
    np.testing.assert_allclose(predicted, measured, rtol=0.25)


def test_bands_of_a_scaled_law_hold_their_share_of_times_that_follow_it():
    rng, times_s = np.random.default_rng(5), np.arange(0, 60, 0.05)
    law = scaled_law(10.0, np.sort(rng.lognormal(0, 0.3, 4000)), times_s)
    drawn = 10.0 * rng.lognormal(0, 0.3, 2000)
    for share in (0.5, 0.9):
        held = np.mean([in_band(law, share, time_s) for time_s in drawn])
        assert held == pytest.approx(share, abs=0.03)
    assert crps_s(scaled_law(10.0, np.ones(1), times_s), [12.0]) == pytest.approx(2.0, abs=0.05)


def test_forecasts_without_a_median_are_counted():
    late = ArrivalLaw(np.array([1.0, 2.0]), np.array([0.1, 0.4]), 1.0)
    asked = [Asked(number, 0, 0.0, 2.0) for number in range(2)]
    point = ArrivalLaw(np.array([0.0, 2.5]), np.array([0.0, 1.0]), 1.0)
    arrivals = pd.DataFrame(scored(SERD, asked, [late, point]))
    moves = pd.DataFrame([{"method": SERD, "log_likelihood": -1.0, "n_moves": 3}])
    found = summary_of(moves, arrivals).iloc[0]
    assert found["without_median"] == 1
    assert found["people"] == 2
    assert found["median_error_s"] == 0.5
    assert found["coverage_90"] == 0.5


@pytest.mark.parametrize(("jump_cm", "n_rows"), [(70, 1), (1200, 5)])
def test_ids_that_jump_are_left_out_and_counted(corridor, tmp_path, jump_cm, n_rows):
    path = corridor()
    rows = path.read_text().splitlines()
    first = next(i for i, row in enumerate(rows) if row.startswith("7 ")) + 20
    for at in range(first, first + n_rows):
        number, frame, x, y, z = rows[at].split()
        rows[at] = f"{number} {frame} {float(x) + jump_cm} {y} {z}"
    path.write_text("\n".join(rows) + "\n")
    run = People.read(settings_of([path], tmp_path)).runs[0]
    assert run.left_out["a step faster than 8 m/s"] == 1
    assert not [walker.name for walker in run.walkers if walker.name.startswith("7")]


@pytest.mark.slow
def test_the_tutorial_of_the_page_runs(corridor, tmp_path, root, monkeypatch, capsys):
    page = (root / "docs" / "people_study.md").read_text(encoding="utf-8")
    code = page.split("```python\n")[1].split("```")[0]
    assert len([line for line in code.splitlines() if line and "import" not in line]) <= 10
    corridor("bi_corr_400_b_03", spacing_s=2.0)
    monkeypatch.chdir(tmp_path)
    exec(code, {})
    weights, *arrivals = capsys.readouterr().out.strip().splitlines()
    assert "'social_norm'" in weights
    assert len(arrivals) == 5
    for line in arrivals:
        low, middle, high = literal_eval(line.split(" ", 1)[1])
        assert 0 < low < middle < high
