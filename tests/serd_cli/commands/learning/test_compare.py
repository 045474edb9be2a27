"""`serd compare`: a model's own kind of episodes is usual, another kind is not."""

import json
import shutil

import numpy as np
import pytest

from serd_app.demonstrations.decision_table import load_decisions
from serd_files.yaml_config import model_yaml
from serd_sim.scenario.scenario import load_scenario


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
    """Where the model and its table are made once."""
    return tmp_path_factory.mktemp("learned")


@pytest.fixture
def model(serd, learned, tmp_path):
    """Learned from people who keep to the southern side; this test's own copy, with its table."""
    table, file = learned / "decisions.csv", learned / "model.yaml"
    if not file.exists():
        people = walks(learned / "people.csv", 0.5, seed=0)
        words = ("--cell-size-m", 1, "--period-s", 1)
        assert serd("demos", people, *words, "--output", table).code == 0
        assert serd("learn", table, "--output", file).code == 0
    shutil.copytree(learned, tmp_path, dirs_exist_ok=True)
    return tmp_path / file.name


def compared(serd, *words):
    ended = serd("compare", *words, "--json")
    assert ended.code == 0, ended.err
    return json.loads(ended.out)


@pytest.mark.usefixtures("whole_pictures")
def test_episodes_like_those_learned_from_are_usual_and_others_are_not(serd, model, tmp_path):
    same = walks(tmp_path / "same.csv", 0.5, seed=1)
    other = walks(tmp_path / "other.csv", 2.5, seed=2)
    output = tmp_path / "out.csv"
    usual, unusual = (compared(serd, model, each, "--output", output) for each in (same, other))
    assert usual["n_hidden"] == usual["n_decisions"] > 0
    assert f"decisions in {usual['n_episodes']} episodes" in usual["discretised"]
    assert usual["mean_rank"] > unusual["mean_rank"]
    assert usual["log_likelihood"] > unusual["log_likelihood"]
    assert len(unusual["episodes"]) == unusual["n_episodes"]
    assert sum(each["surprising"] for each in unusual["episodes"]) == unusual["n_surprising"]
    rows = output.read_text().splitlines()
    assert rows[0] == "episode,decisions,log_likelihood,simulated,rank,surprising"
    assert len(rows) == 1 + unusual["n_episodes"]
    assert output.with_suffix(".png").read_bytes().startswith(b"\x89PNG")
    assert "Episodes of the lowest ranks" in serd("compare", model, same, "--output", output).out


def test_several_recordings_are_compared_together(serd, model, tmp_path):
    one, two = (walks(tmp_path / f"run{n}.csv", 0.5, seed=n, n=n) for n in (5, 6))
    output = tmp_path / "out.csv"
    alone = [compared(serd, model, each, "--output", output) for each in (one, two)]
    both = compared(serd, model, one, two, "--output", output)
    for name in ("n_episodes", "n_decisions"):
        assert both[name] == sum(each[name] for each in alone)
    assert "places in m are assumed" in both["discretised"]
    ended = serd("compare", model, one, tmp_path / "decisions.csv", "--output", output)
    assert ended.code == 2
    assert "a table of decisions must be compared alone" in ended.err


def test_a_table_of_decisions_is_compared_as_it_is(serd, model, tmp_path):
    output = tmp_path / "out.csv"
    table = tmp_path / "decisions.csv"
    values = compared(serd, model, table, "--output", output, "--surprise", 1)
    assert values["discretised"] == ""
    assert values["n_decisions"] <= len(load_decisions(table))
    assert values["n_surprising"] > 0
    none = compared(serd, model, table, "--output", output, "--surprise", 0)
    assert none["n_surprising"] == 0
    assert values["log_likelihood"] == none["log_likelihood"]
    mapping = tmp_path / "mapping.yaml"
    mapping.write_text("unit: m\n")
    ended = serd("compare", model, table, "--mapping", mapping, "--output", output)
    assert ended.code == 2
    assert "--mapping must be left out for a table of decisions" in ended.err


def test_what_is_left_out_is_counted(serd, model, tmp_path):
    """A goal in the middle, where one of those who walk across begins."""
    table = tmp_path / "decisions.csv"
    words = (model, table, "--goal", "5.5,0.5", "--output", tmp_path / "out.csv")
    values, every = compared(serd, *words), load_decisions(table)
    assert values["n_episodes_left_out"] == 1
    assert values["n_episodes"] == len(every.episodes) - 1
    assert values["n_elsewhere"] == 0
    assert values["n_after_goal"] == len(every) - values["n_decisions"] > 0
    printed = serd("compare", *words).out
    assert f"\ndecisions left out: {values['n_after_goal']} after the goal\n" in printed
    assert "\nepisodes left out: 1 that begin in the goal\n" in printed


def test_other_cells_and_other_places_are_refused(serd, model, tmp_path):
    people = walks(tmp_path / "again.csv", 0.5, seed=3)
    table = tmp_path / "fine.csv"
    assert serd("demos", people, "--cell-size-m", 0.5, "--output", table).code == 0
    ended = serd("compare", model, table, "--output", tmp_path / "out.csv")
    assert ended.code == 2
    assert "was learned with cells of 1 m, but" in ended.err
    far = tmp_path / "far.csv"
    far.write_text("t,x,y\n" + "".join(f"{n / 10},{500 + n / 10},900\n" for n in range(100)))
    ended = serd("compare", model, far, "--output", tmp_path / "out.csv")
    assert ended.code == 2
    assert "holds no decision on the grid of" in ended.err
    model.with_suffix(".grid.yaml").unlink()
    alone = serd("compare", model, people)
    assert alone.code == 2
    assert "model.grid.yaml, which is written with it, must be beside it" in alone.err


def test_a_scenario_of_a_file_is_found_beside_the_model_and_the_table(serd, root, tmp_path):
    scenario, table = tmp_path / "place.yaml", tmp_path / "decisions.csv"
    model, output = tmp_path / "model.yaml", tmp_path / "out.csv"
    scenario.write_text(model_yaml(load_scenario("hallway").model_copy(update={"name": "place"})))
    bag = sorted(path.parent for path in (root / "bags" / "data").rglob("metadata.yaml"))[0]
    place = ("--scenario", scenario)
    assert serd("demos", bag, *place, "--output", table).code == 0
    learned = serd("learn", table, *place, "--method", "mdce_irl", "--output", model)
    assert learned.code == 0, learned.err
    for trajectories in (table, bag):
        words = (model, trajectories, "--output", output, "--simulations", 5)
        assert compared(serd, *words)["n_decisions"] > 0
        assert compared(serd, *words, *place)["n_decisions"] > 0
        output.unlink()
