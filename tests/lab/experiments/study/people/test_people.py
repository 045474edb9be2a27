"""The people study in miniature, on generated corridors, and its parts."""

from ast import literal_eval

import numpy as np
import pandas as pd
import pytest

from lab.experiments.study.people.crowd import bins_of, field_at, mean_field, on_cells
from lab.experiments.study.people.fold import scored
from lab.experiments.study.people.folds import folds_of
from lab.experiments.study.people.forecasts import Asked
from lab.experiments.study.people.learners import CLONING, IRL, SERD, cloning
from lab.experiments.study.people.people import People
from lab.experiments.study.people.problem import Layers
from lab.experiments.study.people.run import PeopleStudy, run_people, stages_of
from lab.experiments.study.people.scores import point_law
from lab.experiments.study.people.settings import people_settings
from lab.experiments.study.people.tables import PERIODS, headline, summary_of
from lab.experiments.study.people.walkers import (
    CONSTANT_VELOCITY,
    DISTANCE_OVER_SPEED,
    calibrated,
    confusion,
    straight_on,
)
from serd_core.arrival.law import ArrivalLaw
from serd_core.dynamics.outcome_models import OutcomeModels
from serd_core.mdp.mdp import checked_policy
from serd_sim.episodes.execution import Execution

SERIAL = Execution(n_jobs=1)
TINY = "crowd: {snapshots: 4, training_people: 16}\nstatistics: {bootstrap: 20}\n"


def layers_of(people):
    """The mean crowd at the times of all moves, with these moves."""
    crowd = people.layers(people.mean_crowd(people.moves))
    return Layers(crowd, 0.95, moves=people.moves)


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
    assert {SERD, IRL, CLONING, CONSTANT_VELOCITY, PERIODS} < set(methods)
    summary = tables["summary"].set_index("method")
    # In a free corridor people keep their pace, which is what distance over speed assumes.
    assert summary.loc[SERD, "crps_s"] < 1.0
    assert summary.loc[SERD, "log_likelihood"] > summary.loc[CLONING, "log_likelihood"]
    covered = summary["coverage_90"].drop(DISTANCE_OVER_SPEED).astype(float)
    assert covered.drop(PERIODS).between(0.5, 1.0).all()
    assert covered[PERIODS] < covered[SERD]
    assert np.isnan(summary.loc[DISTANCE_OVER_SPEED, "log_likelihood"])
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
        "{crowd: {snapshots: 24, training_people: 48}, folds: {number: 3, runs: 3},"
        " statistics: {bootstrap: 20}}"
    )
    settings = people_settings(files, quick=True, config=config)
    tables = run_people(settings, tmp_path / "runs", SERIAL, lambda *_: None)
    assert list(tables["recordings"]["rows"]) == [3, 5, 3]
    # Each fold predicts a file: b is wider than those learned from, c has one direction only.
    folds = tables["moves"].pivot(index="method", columns="fold", values="log_likelihood")
    for method in (SERD, IRL):
        assert np.all(folds.loc[method] > folds.loc[CONSTANT_VELOCITY] - 0.15)
    assert tables["summary"]["without_median"].eq(0).all()
    assert "files: [a.txt, b.txt, c.txt]" in (tmp_path / "runs" / "settings.yaml").read_text()


def test_the_mean_crowd_of_a_narrow_corridor_covers_a_wide_one(corridor, tmp_path):
    files = [corridor("narrow", n_people=20), corridor("wide", n_people=20, width_m=4.0)]
    narrow, wide = People.read(settings_of(files, tmp_path)).runs
    assert (narrow.grid.walkable.shape[0], wide.grid.walkable.shape[0]) == (3, 5)
    middle_s = sum(narrow.span_s) / 2
    times_s = np.linspace(middle_s - 5, middle_s + 5, 6)
    seen = [(narrow, field_at(narrow, float(time_s), 1, 0.6)) for time_s in times_s]
    found = on_cells(wide, mean_field(seen))
    low, high = (each([field.same_pm2 for _, field in seen]) for each in (np.min, np.max))
    assert np.all((found.same_pm2 > 0) & (found.same_pm2 >= low) & (found.same_pm2 <= high))
    # A corridor's own bins are means over its cells, so the mean of one field is that field.
    same = on_cells(wide, mean_field([(wide, field_at(wide, middle_s, 1, 0.6))]))
    rows = same.same_pm2.reshape(wide.grid.walkable.shape)
    assert np.all(np.ptp(rows, axis=0) > 0)


def test_a_file_of_other_content_is_not_resumed(corridor, tmp_path):
    path = corridor()
    study = PeopleStudy(settings_of([path], tmp_path), tmp_path / "work")
    before = [stage.description for stage in stages_of(study)]
    path.write_text(path.read_text().replace(" 170", " 171"))
    after = [stage.description for stage in stages_of(study)]
    assert all(one != other for one, other in zip(before, after, strict=True))


def test_calibrated_directions_lead_into_no_wall():
    table = confusion(np.array([1, 1, 1, 0]), np.array([1, 1, 0, 0]))
    free = np.array([[True, True, True, True], [False, True, True, True]])
    found = calibrated(table, np.array([1, 1]), free)
    np.testing.assert_allclose(found, [np.array([2, 3, 1, 1]) / 7, np.array([0, 3, 1, 1]) / 5])


def test_both_directions_walk_ahead_and_keep_their_left(corridor, tmp_path):
    for along in ("x", "y"):
        run = People.read(settings_of([corridor(along=along)], tmp_path)).runs[0]
        assert {walker.sign for walker in run.walkers} == {-1, 1}
        for walker in run.walkers:
            assert walker.position_m[-1, 0] > walker.position_m[0, 0] + 8
        first, second = run.walkers[0], run.walkers[1]
        turned = np.array([first.position_m[:, 1].mean(), second.position_m[:, 1].mean()])
        found = field_at(run, float(first.time_s[5]), first.sign, 0.6)
        here = int(run.grid.states_at(first.position_m[[5]])[0])
        if here >= 0:
            assert found.same_pm2[here] > found.same_pm2.min()
        assert np.all(np.abs(turned) < run.width_m / 2)


def test_the_density_of_one_person_integrates_to_one(corridor, tmp_path):
    run = People.read(settings_of([corridor(spacing_s=20.0)], tmp_path)).runs[0]
    walker = run.walkers[3]
    middle = int(np.argmin(np.abs(walker.position_m[:, 0])))
    found = field_at(run, float(walker.time_s[middle]), walker.sign, 0.35)
    away = np.sum((run.grid.centers_m - walker.position_m[middle]) ** 2, axis=1)
    expected = np.exp(-away / (2 * 0.35**2)) / (2 * np.pi * 0.35**2)
    np.testing.assert_allclose(found.same_pm2, expected, rtol=1e-9)
    other = field_at(run, float(walker.time_s[middle]), -walker.sign, 0.35)
    np.testing.assert_allclose(np.sort(other.opposite_pm2), np.sort(expected), rtol=1e-9)


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
                apart = max(one.crossings.entered_s[0] - other.time_s[-1],
                            other.crossings.entered_s[0] - one.time_s[-1])  # fmt: skip
                assert apart >= 1.5


def test_every_outcome_of_the_problem_leads_to_a_neighbour(corridor, tmp_path):
    people = People.read(settings_of([corridor()], tmp_path))
    layers = layers_of(people)
    models = layers.problem.mdp.transitions
    assert isinstance(models, OutcomeModels)
    assert models.n_models == 3
    goal = np.isin(layers.cell, layers.goal_states)
    pair = models.available & ~goal[:, None]
    near = layers.neighbours
    for outcome in range(4):
        reached = models.successors[:, :, outcome]
        assert np.all(np.any(reached[:, :, None] == near[:, None, :], axis=2)[pair])
        assert np.all((reached != layers.cell[:, None])[pair])
    decisions = layers.decisions(hidden=False)
    assert np.all(near[decisions.state, decisions.action] == decisions.next_state)


def test_cloning_counts_directions(corridor, tmp_path):
    people = People.read(settings_of([corridor()], tmp_path))
    layers = layers_of(people)
    shares = checked_policy("shares", cloning(layers).directions(layers))
    bins = np.concatenate([bins_of(layer.run) for layer in layers.each])[layers.cell]
    mine = people.moves.direction[bins[layers.decided] == 12]
    inside = (bins == 12) & (layers.neighbours != layers.cell[:, None]).all(axis=1)
    expected = (np.bincount(mine, minlength=4) + 1) / (len(mine) + 4)
    assert inside.any()
    np.testing.assert_allclose(shares[inside], np.tile(expected, (inside.sum(), 1)))


def test_a_person_who_walks_straight_is_predicted_by_constant_velocity(corridor, tmp_path):
    settings = settings_of([corridor(spacing_s=6.0, n_people=20)], tmp_path)
    people = People.read(settings)
    found = straight_on(people.runs, settings.grid)
    measured = np.array([one.duration_s for one in people.asked])
    assert np.mean(found.directions == people.moves.direction) > 0.85
    np.testing.assert_allclose(found.arrival_s, measured, rtol=0.25)


def test_the_confusion_of_directions_is_counted_with_one_added():
    found = confusion(np.array([1, 1, 1, 0]), np.array([1, 1, 0, 0]))
    np.testing.assert_allclose(found[1], np.array([2, 3, 1, 1]) / 7)
    np.testing.assert_allclose(found[2], 0.25)


def test_forecasts_without_a_median_are_counted():
    late = ArrivalLaw(np.array([1.0, 2.0]), np.array([0.1, 0.4]), 1.0)
    asked = [Asked(number, 0, 0.0, 2.0) for number in range(2)]
    arrivals = pd.DataFrame(scored(SERD, asked, [late, point_law(2.5)]))
    moves = pd.DataFrame([{"method": SERD, "log_likelihood": -1.0, "n_moves": 3}])
    moves["dwell_log_likelihood"] = None
    found = summary_of(moves, arrivals).iloc[0]
    assert found["without_median"] == 1
    assert found["people"] == 2
    assert found["median_error_s"] == 0.5


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
    assert "'drift'" in weights
    assert len(arrivals) == 5
    for line in arrivals:
        low, middle, high = literal_eval(line.split(" ", 1)[1])
        assert 0 < low < middle < high


def test_periods_in_which_a_walker_passes_a_whole_cell_are_counted(corridor, tmp_path):
    run = People.read(settings_of([corridor()], tmp_path)).runs[0]
    assert run.unrepresented(0.05) < 0.05
    assert run.unrepresented(0.8) < run.unrepresented(1.6)
    assert run.unrepresented(3.0) == 1.0
