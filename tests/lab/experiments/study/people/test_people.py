"""The people study in miniature, on generated corridors, and its parts."""

import numpy as np
import pytest

from lab.experiments.study.people.fold import CONSTANT_VELOCITY, folds_of
from lab.experiments.study.people.learners import COUNT, HIDDEN_ACTIONS, IRL, LEARNERS, SERD
from lab.experiments.study.people.people import People
from lab.experiments.study.people.run import PeopleStudy, run_people, stages_of
from lab.experiments.study.people.settings import people_settings
from lab.experiments.study.people.tables import headline
from serd_sim.episodes.execution import Execution

SERIAL = Execution(n_jobs=1)
TINY = "training_people: 16\nstatistics: {bootstrap: 20}\n"


_FPS, _WIDTH_M = 16, 2.4


def corridor(folder, name="corridor", *, n_people=40, seed=0):
    """A file of people who walk 10 m both ways with a pace of their own and sway; rows in cm."""
    rng = np.random.default_rng(seed)
    rows = [f"# framerate: {_FPS} fps", "# id frame x/cm y/cm z/cm"]
    for person in range(n_people):
        speed = float(np.exp(rng.normal(0.1, 0.15)))
        time_s = np.arange(0, 10.0 / speed, 1 / _FPS)
        middle, drift = rng.uniform(0.3, _WIDTH_M - 0.3), rng.normal(0, 0.05)
        x_m = (-1 if person % 2 else 1) * (speed * time_s - 5.0)
        y_m = middle + drift * time_s + 0.05 * np.sin(2 * time_s + person)
        y_m = np.clip(y_m, 0.1, _WIDTH_M - 0.1)
        first = round((0.5 + 1.2 * person) * _FPS)
        for step, (x, y) in enumerate(zip(x_m, y_m, strict=True)):
            rows.append(f"{person + 1} {first + step} {100 * x:.2f} {100 * y:.2f} 170")
    path = folder / f"{name}.txt"
    path.write_text("\n".join(rows) + "\n")
    return path


def settings_of(files, tmp_path, extra="", **given):
    config = tmp_path / "tiny.yaml"
    config.write_text(TINY + extra)
    return people_settings(files, quick=True, config=config, **given)


@pytest.mark.slow
def test_the_study_runs_from_a_file_to_tables_and_resumes(tmp_path):
    settings = settings_of([corridor(tmp_path)], tmp_path)
    folder, calls = tmp_path / "people", []
    tables = run_people(settings, folder, SERIAL, lambda *each: calls.append(each))
    assert not any(stage.missing for stage in stages_of(PeopleStudy(settings, folder / "work")))
    methods = list(headline(tables)["method"])
    assert set(methods) == {*LEARNERS, CONSTANT_VELOCITY}
    summary = tables["summary"].set_index("method")
    for method in (SERD, HIDDEN_ACTIONS, IRL, COUNT):
        assert summary.loc[method, "coverage_90"] >= 0.9
        assert summary.loc[method, "crps_s"] < 0.8
    # In a free corridor people keep their pace, which is what constant velocity assumes.
    assert summary["crps_s"].idxmin() == CONSTANT_VELOCITY
    assert summary.loc[COUNT, "crps_s"] < 1.5 * summary.loc[CONSTANT_VELOCITY, "crps_s"]
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


@pytest.mark.parametrize("n_files", [1, 2])
def test_no_person_is_on_both_sides_of_a_fold(tmp_path, n_files):
    files = [corridor(tmp_path, f"run{i}", seed=i, n_people=60) for i in range(n_files)]
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


def test_decisions_are_the_way_of_a_person_cell_by_cell(tmp_path):
    files = [corridor(tmp_path, name, seed=seed) for name, seed in (("a", 1), ("b", 2))]
    people = People.read(settings_of(files, tmp_path))
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
