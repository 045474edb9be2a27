"""The people study in miniature, on generated corridors, and its parts."""

from ast import literal_eval
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from lab.experiments.study.people.covariate_models import CovariateModels
from lab.experiments.study.people.cross_validation.fold import scored
from lab.experiments.study.people.cross_validation.folds import folds_of
from lab.experiments.study.people.cross_validation.forecasts import Asked
from lab.experiments.study.people.cross_validation.walkers import (
    CONSTANT_VELOCITY,
    DISTANCE_OVER_SPEED,
    SOCIAL_FORCE,
    calibrated,
    confusion,
    walker_predictions,
)
from lab.experiments.study.people.crowd import bins_of, field_at, mean_field, on_cells
from lab.experiments.study.people.learners import (
    CLONING,
    IRL,
    SERD,
    SERD_DENSITY,
    cloning,
    covariates_in,
)
from lab.experiments.study.people.people import People
from lab.experiments.study.people.problem import COVARIATES, Layers
from lab.experiments.study.people.run import PeopleStudy, run_people, stages_of
from lab.experiments.study.people.scores import point_law
from lab.experiments.study.people.settings import people_settings
from lab.experiments.study.people.tables import PERIODS, headline, summary_of
from serd_core.arrival.law import ArrivalLaw
from serd_core.errors import SerdError
from serd_core.mdp.mdp import checked_policy
from serd_files.errors import USER_ERRORS
from serd_files.trajectories.columns import TableColumns
from serd_sim.episodes.execution import Execution

SERIAL = Execution(n_jobs=1)
TINY = "crowd: {training_layers: 4, training_people: 16}\nstatistics: {bootstrap: 20}\n"


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
    assert {SERD_DENSITY, SERD, IRL, CLONING, CONSTANT_VELOCITY, SOCIAL_FORCE} < set(methods)
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
        "{crowd: {training_layers: 24, training_people: 48}, folds: {number: 3, runs: 3},"
        " statistics: {bootstrap: 20}}"
    )
    settings = people_settings(files, quick=True, config=config)
    tables = run_people(settings, tmp_path / "runs", SERIAL, lambda *_: None)
    assert list(tables["recordings"]["rows"]) == [3, 5, 3]
    # Each fold predicts a file: b is wider than those learned from, c has one direction only.
    folds = tables["moves"].pivot(index="method", columns="fold", values="log_likelihood")
    for method in (SERD_DENSITY, SERD, IRL):
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
    assert np.all(found.speed_mps > 0.1)
    # A corridor's own bins are means over its cells, so the mean of one field is that field.
    same = on_cells(wide, mean_field([(wide, field_at(wide, middle_s, 1, 0.6))]))
    rows = same.speed_mps.reshape(wide.grid.walkable.shape)
    assert np.all(np.ptp(rows, axis=0) > 0)


def test_people_of_one_way_are_predicted_by_what_both_ways_showed(corridor, tmp_path):
    files = [corridor("both"), corridor("one", two_way=False)]
    people = People.read(settings_of(files, tmp_path))
    moves, run, sign = people.moves
    each = []
    for number in (0, 1):
        at = people.layers_at(
            run[run == number], sign[run == number], moves.entered_s[run == number]
        )
        layers = Layers(at.layers, 0.95, moves=replace(moves.select(run == number), layer=at.place))
        each.append(layers)
    like = replace(each[0], covariates=covariates_in(each[0]))
    assert like.covariates == COVARIATES
    new = replace(each[1], covariates=COVARIATES)
    with pytest.raises(USER_ERRORS, match="covariates must have linearly independent columns"):
        new.problem.mdp  # noqa: B018
    known = replace(new, learned_rows=np.unique(like.crowding, axis=0))
    models = known.problem.mdp.transitions
    rows = models.covariates[models.model_of.ravel()]
    assert not rows[:, COVARIATES.index("opposite way")].any()
    assert np.linalg.matrix_rank(models.covariates) == len(COVARIATES)


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
    moves, run, sign = people.moves
    at = people.layers_at(run, sign, moves.entered_s)
    layers = Layers(at.layers, 0.95, moves=replace(moves, layer=at.place))
    problem = replace(layers, covariates=covariates_in(layers)).problem
    models = problem.mdp.transitions
    assert isinstance(models, CovariateModels)
    assert models.covariate_names == COVARIATES
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
    moves, run, sign = people.moves
    at = people.layers_at(run, sign, moves.entered_s)
    layers = Layers(at.layers, 0.95, moves=replace(moves, layer=at.place))
    shares = checked_policy("shares", cloning(layers).directions(layers))
    bins = np.concatenate([bins_of(layer.run) for layer in layers.each])[layers.cell]
    mine = moves.direction[bins[layers.decided] == 12]
    inside = (bins == 12) & (layers.neighbours != layers.cell[:, None]).all(axis=1)
    expected = (np.bincount(mine, minlength=4) + 1) / (len(mine) + 4)
    assert inside.any()
    np.testing.assert_allclose(shares[inside], np.tile(expected, (inside.sum(), 1)))


def test_a_person_who_walks_straight_is_predicted_by_constant_velocity(corridor, tmp_path):
    settings = settings_of([corridor(spacing_s=6.0, n_people=20)], tmp_path)
    people = People.read(settings)
    found = walker_predictions(people.runs[0], settings)
    measured = np.array([one.duration_s for one in people.asked])
    for name in (CONSTANT_VELOCITY, SOCIAL_FORCE):
        directions = np.concatenate([np.array(d) for d in found[name]["directions"]])
        assert np.mean(directions == people.moves[0].direction) > 0.85
        np.testing.assert_allclose(found[name]["arrival_s"], measured, rtol=0.25)


def test_the_confusion_of_directions_is_counted_with_one_added():
    found = confusion(np.array([1, 1, 1, 0]), np.array([1, 1, 0, 0]))
    np.testing.assert_allclose(found[1], np.array([2, 3, 1, 1]) / 7)
    np.testing.assert_allclose(found[2], 0.25)


def test_forecasts_cover_some_times_the_longest_measured_time(corridor, tmp_path):
    people = People.read(settings_of([corridor()], tmp_path, "forecast: {horizon: 3.0}\n"))
    assert people.horizon_s == 3 * max(one.duration_s for one in people.asked)


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


def test_units_that_cannot_be_are_named_with_the_speed(corridor, tmp_path):
    files = [corridor()]
    with pytest.raises(USER_ERRORS, match=r"corridor\.txt: agents must move at less than 40 m/s"):
        People.read(settings_of(files, tmp_path, mapping=TableColumns(unit="m")))
    with pytest.raises(USER_ERRORS, match=r"corridor\.txt: people must walk at 0\.05 to 4 m/s"):
        People.read(settings_of(files, tmp_path, mapping=TableColumns(fps=200)))


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


def test_people_elsewhere_do_not_widen_the_corridor(corridor, tmp_path):
    path = corridor()
    alone = People.read(settings_of([path], tmp_path)).runs[0]
    standing = [f"99 {frame} 0 4000 170" for frame in range(2000)]
    path.write_text(path.read_text() + "\n".join(standing) + "\n")
    run = People.read(settings_of([path], tmp_path)).runs[0]
    assert run.width_m == alone.width_m
    assert run.grid.walkable.shape == alone.grid.walkable.shape
    assert run.left_out == {"away from the corridor": 1}
    assert "agent 99, from row" in run.assumed[-1]


def test_a_corridor_at_an_angle_has_the_same_cells(corridor, tmp_path):
    path = corridor()
    alone = People.read(settings_of([path], tmp_path)).runs[0]
    head, rows = path.read_text().splitlines()[:2], np.loadtxt(path)
    cos, sin = np.cos(0.4), np.sin(0.4)
    rows[:, 2:4] = rows[:, 2:4] @ np.array([[cos, sin], [-sin, cos]])
    lines = (f"{i:.0f} {f:.0f} {x:.4f} {y:.4f} {z:g}" for i, f, x, y, z in rows)
    path.write_text("\n".join([*head, *lines]) + "\n")
    run = People.read(settings_of([path], tmp_path)).runs[0]
    assert run.grid.walkable.shape == alone.grid.walkable.shape
    assert run.width_m == pytest.approx(alone.width_m, abs=0.2)
    assert len(run.walkers) == len(alone.walkers)
    assert "23° to the x axis" in run.assumed[-1]


def test_ids_of_two_people_are_refused_with_the_row(corridor, tmp_path):
    path = corridor()
    lines = path.read_text().splitlines()
    rows = [line.split() for line in lines[2:]]
    later = [f"{i} {int(f) + 9000} {x} {y} {z}" for i, f, x, y, z in rows]
    path.write_text("\n".join([*lines, *later]) + "\n")
    with pytest.raises(
        USER_ERRORS, match=r"or a gap, as agent 1 from row 1; give each person an id"
    ):
        People.read(settings_of([path], tmp_path))
    path.write_text("\n".join([*lines, *later[:50]]) + "\n")
    run = People.read(settings_of([path], tmp_path)).runs[0]
    assert run.left_out["away in between, so maybe two people of one id"] == 1
    assert "1" not in [walker.name for walker in run.walkers]


def test_one_person_alone_is_too_few(corridor, tmp_path):
    with pytest.raises(
        SerdError, match="must have at least 10 people who walk through, got 1 of 1"
    ):
        People.read(settings_of([corridor(n_people=1)], tmp_path))


def test_two_files_of_one_name_are_rejected(corridor, tmp_path):
    first = corridor()
    other = tmp_path / "other"
    other.mkdir()
    second = other / first.name
    second.write_text(first.read_text())
    with pytest.raises(USER_ERRORS, match="files must have different names, got corridor twice"):
        People.read(settings_of([first, second], tmp_path))


def test_too_few_people_for_the_blocks_are_rejected(corridor, tmp_path):
    settings = settings_of([corridor(n_people=12)], tmp_path, "folds: {number: 40}\n")
    with pytest.raises(USER_ERRORS, match="each of 40 time blocks must hold people and leave 10"):
        folds_of(People.read(settings).runs, settings.folds)


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
