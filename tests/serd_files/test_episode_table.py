"""The table of episodes: exact round trips, faults by line."""

import math

import pytest

from serd_bag.errors import FileError
from serd_files.episode_table import EpisodeResult, load_episodes
from serd_files.table import write_rows


def result(episode=0, outcome="arrived", time_of_arrival_s=0.1 + 0.2):
    return EpisodeResult(
        episode=episode,
        seed=3,
        driver="strategy, greedy",
        start_area="train",
        outcome=outcome,
        time_of_arrival_s=time_of_arrival_s,
        duration_s=1 / 3,
        distance_m=25.7,
        robot_on_person=0,
        person_on_robot=2,
        robot_on_wall=0,
        minimum_person_distance_m=-1e-17,
        wall_s=1.5,
    )


def test_rows_survive_exactly(tmp_path):
    rows = (result(0), result(1, time_of_arrival_s=47.0))
    write_rows(tmp_path / "episodes.csv", EpisodeResult, rows)
    assert load_episodes(tmp_path / "episodes.csv") == rows


@pytest.mark.parametrize("time_s", [-1.5, math.inf])
def test_a_time_of_arrival_that_cannot_be_is_named_by_file_and_line(tmp_path, time_s):
    write_rows(tmp_path / "episodes.csv", EpisodeResult, [result(), result(1, "arrived", time_s)])
    with pytest.raises(
        FileError,
        match=rf"episodes.csv: line 3, time_of_arrival_s must be finite and not .* got {time_s};",
    ):
        load_episodes(tmp_path / "episodes.csv")


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        (
            "0,3,strategy",
            "zero,3,strategy",
            r"line 2, episode must be a whole number, got 'zero'; correct the line",
        ),
        (
            "arrived",
            "timeout",
            r"line 2, time_of_arrival_s must be a number exactly if outcome is 'arrived'",
        ),
        ("episode,", "number,", r"must have the columns episode, seed"),
    ],
)
def test_a_spoilt_table_is_named_by_line(tmp_path, old, new, sentence):
    path = tmp_path / "episodes.csv"
    write_rows(path, EpisodeResult, [result()])
    text = path.read_text()
    path.write_text(text.replace(old, new, 1) if old == "episode," else spoil(text, old, new))
    with pytest.raises(FileError, match=sentence):
        load_episodes(path)


def spoil(text, old, new):
    head, row = text.split("\n", 1)
    row = row.replace('0,3,"strategy', 'zero,3,"strategy') if "strategy" in old else row
    return head + "\n" + row.replace(old, new, 1)


def test_a_table_written_before_there_were_reasons_is_read(tmp_path):
    write_rows(tmp_path / "new.csv", EpisodeResult, [result()])
    lines = (tmp_path / "new.csv").read_text().splitlines()
    assert lines[0].endswith(",reason")
    older = [line.rsplit(",", 1)[0] for line in lines]
    (tmp_path / "old.csv").write_text("\n".join(older) + "\n")
    assert load_episodes(tmp_path / "old.csv") == (result(),)
