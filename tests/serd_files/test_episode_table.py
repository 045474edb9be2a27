"""The table of episodes: exact round trips, faults by line."""

import math

import pytest

from serd_bag.errors import FileError
from serd_files.episode_table import EpisodeResult, load_episodes
from serd_files.table import write_rows
from support.episodes import episode_result

ODD = {"driver": "strategy, greedy", "duration_s": 1 / 3, "minimum_person_distance_m": -1e-17}


def test_rows_survive_exactly(tmp_path):
    rows = (episode_result(0, "arrived", 0.1 + 0.2, **ODD), episode_result(1, "arrived", 47.0))
    write_rows(tmp_path / "episodes.csv", EpisodeResult, rows)
    assert load_episodes(tmp_path / "episodes.csv") == rows


@pytest.mark.parametrize(
    ("outcome", "time_s", "sentence"),
    [
        ("arrived", -1.5, "line 3, time_of_arrival_s must be finite and not .* got -1.5;"),
        ("arrived", math.inf, "line 3, time_of_arrival_s must be finite and not .* got inf;"),
        ("timeout", 0.3, "line 3, time_of_arrival_s must be a number exactly if outcome is 'arr"),
        ("arrived", math.nan, "line 3, time_of_arrival_s must be a number exactly if outcome is"),
    ],
)
def test_a_time_of_arrival_that_cannot_be_is_named_by_file_and_line(
    tmp_path, outcome, time_s, sentence
):
    rows = [episode_result(0, "arrived", 0.3), episode_result(1, outcome, time_s)]
    write_rows(tmp_path / "episodes.csv", EpisodeResult, rows)
    with pytest.raises(FileError, match=f"episodes.csv: {sentence}"):
        load_episodes(tmp_path / "episodes.csv")


def test_a_table_written_before_there_were_reasons_is_read(tmp_path):
    row = episode_result(0, "arrived", 0.3)
    write_rows(tmp_path / "new.csv", EpisodeResult, [row])
    lines = (tmp_path / "new.csv").read_text().splitlines()
    assert lines[0].endswith(",reason")
    older = [line.rsplit(",", 1)[0] for line in lines]
    (tmp_path / "old.csv").write_text("\n".join(older) + "\n")
    assert load_episodes(tmp_path / "old.csv") == (row,)
