"""The table of the field: scores of the truth, what methods may not state, and the command."""

import csv
import json
import threading
import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import serd_core as sc
from lab.bench import environment, worker
from lab.bench.case import Case, Target, distinct_rows
from lab.bench.measure import METHODS
from lab.bench.page import direction, summary
from lab.bench.tasks import TASKS
from serd_core.errors import SerdError

WORLDS = ("borders", "aliased", "hazard", "confounded", "misspecified", "durations")


@pytest.mark.parametrize("name", WORLDS)
def test_the_truth_has_the_best_scores_and_a_seed_fixes_the_case(name, tmp_path):
    case, again, other = (TASKS[name].case(tmp_path, 3, seed) for seed in (1, 1, 2))
    given, same, different = (each.given() for each in (case, again, other))
    assert all(np.array_equal(given[key], same[key]) for key in given)
    assert not np.array_equal(given["state"], different["state"])
    assert len(np.unique(given["episode"])) == 3
    assert case.truth is not None
    known = case.weights if case.weights is not None else np.zeros(given["features"].shape[2])
    drawn = np.repeat(known[None], 5, axis=0), np.repeat(case.truth[None], 5, axis=0)
    truth = {"weights": known, "table": case.truth, "draws_weights": drawn[0]}
    scores = case.scores(truth | {"draws_table": drawn[1]})
    assert scores["divergence"] == pytest.approx(0.0, abs=1e-12)
    assert scores["coverage of probabilities"] == 1.0
    away = case.scores({"weights": known + 1.0, "table": case.truth, "draws_table": 0.9 * drawn[1]})
    for kind in ("log-likelihood", "transfer"):
        if case.weights is not None:
            assert scores[kind] == pytest.approx(0.0, abs=1e-9)
            assert scores["coverage of weights"] == 1.0
        assert away[kind] < 0.0
    assert away["coverage of probabilities"] == 0.0


def test_only_what_transitions_determine_counts_and_recordings_have_the_log_loss_of_moves():
    """Of three outcomes the last two stay: moving them into each other changes nothing."""
    cells = np.arange(4)
    successors = np.stack([(cells + 1) % 4, cells, cells], axis=1)[:, None]
    models = sc.OutcomeModels(successors, np.zeros((4, 1), int), np.ones((4, 1), bool), 1)
    problem = sc.TabularProblem(sc.Mdp(models, 0.9), np.ones((4, 1, 1)), ("one",))
    assert [(row, groups.tolist()) for row, groups in distinct_rows(problem)] == [(0, [0, 1, 1])]
    seen = sc.Decisions([0, 0], [0.0, 1.0], state=[0, 1], action=[0, 0], next_state=[1, 1])
    target = Target(np.full((4, 1), 0.25))
    known = Case(problem, seen, target, truth=np.array([[0.7, 0.2, 0.1]]))
    assert known.scores({"table": np.array([[0.7, 0.0, 0.3]])})["divergence"] == pytest.approx(0.0)
    found = known.scores({"table": np.array([[0.5, 0.1, 0.4]])})["divergence"]
    assert found == pytest.approx(0.7 * np.log(0.7 / 0.5) + 0.3 * np.log(0.3 / 0.5))
    recorded = Case(problem, seen, target, held_out=seen)
    found = recorded.scores({"table": np.array([[0.6, 0.3, 0.1]])})["divergence"]
    assert found == pytest.approx(-np.mean(np.log([0.6, 0.4])))


def test_means_have_intervals_and_only_clear_differences_in_pairs_are_marked():
    rng = np.random.default_rng(0)
    ours = {seed: {"divergence": value} for seed, value in enumerate(rng.uniform(size=12))}
    rows = [
        {"seed": s, "divergence": row["divergence"] + 0.1, "warm_s": 1.0} for s, row in ours.items()
    ]
    found = summary(rows, ours)
    assert found["divergence: against SERD"] == -1
    assert found["divergence: SERD better by"] == pytest.approx(0.1)
    assert found["divergence: SERD better by ±"] == pytest.approx(0.0, abs=1e-12)
    values = np.array([row["divergence"] for row in rows])
    half = 2.200985 * values.std(ddof=1) / np.sqrt(12)  # Student's t of 11 degrees of freedom
    assert found["divergence ±"] == pytest.approx(half, rel=1e-5)
    gains = rng.normal(size=40)
    assert direction(gains) == 0
    assert direction(gains + 1.5) == -direction(-gains - 1.5) == 1


def lap(rng, number):
    """Rows of a drive of 8 m among two people, as a table of a robot among people has them."""
    time = np.arange(100) / 10 + 1000 * number
    places = np.stack([np.clip(0.9 * (time - time[0]), 0, 8), rng.normal(0, 0.01, 100)])
    people = [np.stack([9 - 0.8 * (time - time[0]), np.full(100, y)]) for y in (0.9, -0.9)]
    return np.vstack([1.7e18 + 1e9 * time, places, *people]).T


def test_weights_of_which_a_method_states_no_interval_do_not_count(tmp_path):
    case = TASKS["hazard"].case(tmp_path, 3, 0)
    drawn = np.tile([case.weights[0], case.weights[1] + 1.0], (5, 1))
    found = [
        case.scores({"draws_weights": drawn, "unstated": np.array(unstated)})
        for unstated in ([False, False], [False, True], [True, True])
    ]
    assert [each["weights without interval"] for each in found] == [0.0, 0.5, 1.0]
    assert [each.get("coverage of weights") for each in found] == [0.5, 1.0, None]


def test_who_asks_for_an_environment_while_another_installs_it_waits(tmp_path, monkeypatch):
    monkeypatch.setattr(environment, "ENVIRONMENTS", tmp_path)
    installed, together = [], threading.Barrier(4)

    def install(name, _, folder, __):
        installed.append(name)
        time.sleep(0.05)
        folder.mkdir(exist_ok=True)

    def asked(_):
        together.wait()
        return environment.peer_python("one", ("a==1",))

    monkeypatch.setattr(environment, "_install", install)
    with ThreadPoolExecutor(4) as pool:
        found = set(pool.map(asked, range(4)))
    assert found == {tmp_path / "one" / "bin" / "python"}
    assert installed == ["one"]


def test_drives_of_a_robot_among_people_are_read_from_a_table(tmp_path):
    rng = np.random.default_rng(0)
    (tmp_path / "robots").mkdir()
    for number in range(6):
        np.savetxt(
            tmp_path / "robots" / f"drive_{number}.csv", lap(rng, number), "%.4f", ",",
            header="timestamp,robot_x,robot_y,x1,y1,x2,y2", comments="",
        )  # fmt: skip
    case = TASKS["robots"].case(tmp_path, 3, 0)
    assert len(np.unique(case.given()["episode"])) == 3
    given = case.given()
    found = case.scores(
        {"policy": np.full(given["available"].shape, 0.2), "table": given["counted"]}
    )
    assert found["log-likelihood"] == pytest.approx(-np.log(5))
    assert 0.0 <= found["divergence"] < 1.0
    with pytest.raises(SerdError, match=r"more than 10 episodes must be there .* got 6; record"):
        TASKS["robots"].case(tmp_path, 10, 0)
    with pytest.raises(SerdError, match=r"--data must hold pedestrians/.*, but does not"):
        TASKS["crowds"].case(tmp_path, 10, 0)


def test_a_method_is_one_file_whose_refusals_and_failures_are_lines(tmp_path, capsys):
    case = TASKS["hazard"].case(tmp_path, 3, 0)
    for number in range(3):
        np.savez(tmp_path / f"case_{number}.npz", number=number, **case.given())
    method = tmp_path / "method.py"
    method.write_text(
        "def learn(given):\n"
        "    if given['number'] == 1:\n        raise NotImplementedError('small problems')\n"
        "    if given['number'] == 2:\n        raise ValueError('singular')\n"
        "    return {'weights': given['features'][0, 0], 'policy': None}\n"
    )
    worker.main(str(method), tmp_path)
    found = [
        json.loads(line.removeprefix("BENCH ")) for line in capsys.readouterr().out.split("\n")[:-1]
    ]
    assert set(found[0]) == {"case", "cold_s", "warm_s"}
    assert found[1:] == [
        {"case": 1, "refused": "small problems"},
        {"case": 2, "failed": "ValueError: singular"},
    ]
    with np.load(tmp_path / "result_0.npz") as content:
        assert content.files == ["weights"]


def test_the_command_writes_table_and_page_and_goes_on_where_it_stopped(lab, tmp_path, monkeypatch):
    """A task of own methods, one without data, and a library that cannot be installed."""
    monkeypatch.setattr(environment, "ENVIRONMENTS", tmp_path / "environments")
    for name in ("PIP_INDEX_URL", "PIP_EXTRA_INDEX_URL"):
        monkeypatch.setenv(name, (tmp_path / "nowhere").as_uri())
    monkeypatch.setenv("PIP_CONFIG_FILE", "/dev/null")
    words = ["bench", "--quick", "--output", "out", "--data", "here", "--jobs", "1"]
    for name in ("hazard", "rust"):
        words += ["--task", name]
    for name in ("serd", "irl_same_prior", "cloning", "jax_joint"):
        words += ["--method", name]
    ended = lab(*words)
    assert "rust is left out: --data must hold rust1987/a530875.asc" in ended.err
    assert "jax_joint is left out: jax_joint must install (jax==" in ended.err.replace("\n", " ")
    nothing = lab("bench", "--task", "rust", "--output", "empty", "--data", "here")
    assert nothing.code == 2
    assert "a task must have files and a method that states it, got none" in nothing.err.replace(
        "\n", " "
    )
    folder = tmp_path / "here" / "out"
    with (folder / "bench.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert {(row["task"], row["demonstrations"], row["method"]) for row in rows} == {
        ("hazard", size, METHODS[method].title)
        for size in ("3", "25")
        for method in ("serd", "irl_same_prior", "cloning")
    }
    ours = [row for row in rows if row["method"] == "SERD"]
    assert all(float(row["log-likelihood"]) > -0.2 for row in ours)
    page = (folder / "bench.md").read_text()
    first = page.partition("## What joint estimation adds")[2].partition("## ")[0]
    assert "\nhazard, 25 | " in first
    assert "- *rust* is not measured: --data must hold rust1987/a530875.asc" in page
    assert "- *jax_joint* is not measured: jax_joint must install (jax==" in page
    assert (folder / "bench.png").stat().st_size > 10_000
    lines = {path: path.read_bytes() for path in (folder / "cases").iterdir()}
    assert lab(*words).code == 0
    assert lines == {path: path.read_bytes() for path in (folder / "cases").iterdir()}
