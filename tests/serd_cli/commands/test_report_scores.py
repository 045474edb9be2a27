"""How usual trajectories are for a model: its own kind of episodes is, another kind is not."""

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from serd_app.demonstrations.decision_table import load_decisions, save_decisions
from serd_app.drives.mapping import TableMapping
from serd_app.errors import AppError
from serd_app.navigation.evaluation.familiarity import familiarity_of
from serd_bag.errors import FileError
from serd_core.semi_markov.timed_decisions import TimedDecisions
from support.commands import printed_in


def walks(path, y_m, seed, n=30):
    """People walk 10 m east within a corridor, each in a lane around y."""
    rng, lines = np.random.default_rng(seed), ["id,t,x,y"]
    for agent in range(n):
        lane_m, time_s, x_m = np.clip(y_m + rng.normal(0, 0.2), 0.1, 2.9), 100.0 * agent, 0.5
        while x_m < 10.5:
            lines.append(f"{agent},{time_s:.1f},{x_m:.3f},{lane_m:.3f}")
            x_m += 0.1 * (1.0 + rng.normal(0, 0.1))
            time_s += 0.1
    # Two who walk across show the whole width of the corridor.
    for agent in (n, n + 1):
        start_s, x_m = 1e4 * agent, 5 * (agent - n) + 0.5
        lines += [f"{agent},{start_s + y / 10:.1f},{x_m},{y / 10}" for y in range(30)]
    path.write_text("\n".join(lines) + "\n")
    return path


@pytest.fixture(scope="module")
def learned(tmp_path_factory):
    """Learned from people who keep to the southern side."""
    folder = tmp_path_factory.mktemp("learned")
    people = walks(folder / "people.csv", 0.5, seed=0)
    printed_in(folder, "demos", people, "--cell-size-m", 1)
    printed_in(folder, "learn", "decisions.csv")
    return folder


@pytest.fixture
def model(learned, tmp_path):
    """This test's own copy of the model, with its table."""
    shutil.copytree(learned, tmp_path, dirs_exist_ok=True)
    return tmp_path / "model.yaml"


def test_episodes_like_those_learned_from_are_usual_and_others_are_not(serd, model, tmp_path):
    same = walks(tmp_path / "same.csv", 0.5, seed=1)
    other = walks(tmp_path / "other.csv", 2.5, seed=2)
    usual, unusual = (familiarity_of(model, [each]).as_json() for each in (same, other))
    assert usual["n_hidden"] == usual["n_decisions"] > 0
    assert f"decisions in {usual['n_episodes']} episodes" in usual["discretised"]
    assert usual["mean_rank"] > unusual["mean_rank"]
    assert usual["log_likelihood"] > unusual["log_likelihood"]
    shown = serd("report", model, "--demonstrations", other, "--json").values
    assert shown["familiarity"] == unusual
    rows = Path("report/compared.csv").read_text().splitlines()
    assert rows[0] == "episode,decisions,log_likelihood,simulated,rank,surprising"
    ranks = [float(row.split(",")[4]) for row in rows[1:]]
    assert ranks == sorted(ranks)
    assert np.mean(ranks) == pytest.approx(unusual["mean_rank"])
    assert sum(int(row.split(",")[5]) for row in rows[1:]) == unusual["n_surprising"] > 0
    page = Path("report/report.html").read_text(encoding="utf-8")
    assert "Least usual demonstrations" in page
    assert f"mean rank {unusual['mean_rank']:.2f}" in page


def test_several_recordings_are_scored_together_and_decisions_alone(model, tmp_path):
    recordings = [walks(tmp_path / f"run{n}.csv", 0.5, seed=n, n=n) for n in (5, 6)]
    alone = [familiarity_of(model, [each]).as_json() for each in recordings]
    both = familiarity_of(model, recordings).as_json()
    for name in ("n_episodes", "n_decisions"):
        assert both[name] == sum(each[name] for each in alone)
    assert "places in m are assumed" in both["discretised"]
    table = tmp_path / "decisions.csv"
    found = familiarity_of(model, [table])
    assert found.discretised == ""
    whole = load_decisions(table)
    n_censored = int(found.files.decisions.censored.sum())
    assert len(found.decisions) + n_censored + found.files.n_after_goal == len(whole)
    assert f"decisions left out: {found.files.left_out()}" in found.sentence()
    with pytest.raises(AppError, match="a table of decisions must be compared alone"):
        familiarity_of(model, [recordings[0], table])
    with pytest.raises(AppError, match="--mapping must be left out for a table of decisions"):
        familiarity_of(model, [table], mapping=TableMapping(unit="m"))


def test_other_cells_and_other_places_are_refused(serd, model, tmp_path):
    people = walks(tmp_path / "again.csv", 0.5, seed=3)
    table = tmp_path / "fine.csv"
    assert serd("demos", people, "--cell-size-m", 0.5, "--output", table).code == 0
    far = tmp_path / "far.csv"
    far.write_text("t,x,y\n" + "".join(f"{n / 10},{500 + n / 10},900\n" for n in range(100)))
    for trajectories, sentence in (
        (table, "was learned with cells of 1 m, but"),
        (far, "holds no decision on the grid of"),
    ):
        with pytest.raises((AppError, FileError), match=sentence):
            familiarity_of(model, [trajectories])
    model.with_suffix(".grid.yaml").unlink()
    with pytest.raises(FileError, match=r"model\.grid\.yaml, which is written with it, must be be"):
        familiarity_of(model, [people])


def test_decisions_that_another_command_ended_are_not_scored(model, tmp_path):
    """Of what they would have led to nothing is known; what was reached is scored as before."""
    table = tmp_path / "decisions.csv"
    before, whole = familiarity_of(model, [table]), load_decisions(table)
    second = np.flatnonzero(whole.episode == whole.episodes[0])[1]
    columns = whole.columns().items()
    cut = TimedDecisions(**{name: np.insert(each, second, each[second]) for name, each in columns})
    censored = np.arange(len(cut)) == second
    ended = replace(
        cut,
        time_s=cut.time_s - 0.01 * censored,
        next_state=np.where(censored, cut.state, cut.next_state),
        dwell_s=np.where(censored, 0.01, cut.dwell_s),
        censored=censored,
    )
    save_decisions(table, ended)
    found = familiarity_of(model, [table])
    assert len(load_decisions(table)) == len(whole) + 1
    assert len(found.decisions) == len(before.decisions)
    assert found.as_json() == before.as_json()
