"""Short names distinguish paths."""

from pathlib import Path

import pytest

from serd_cli.output.demonstrations import short_names


@pytest.mark.parametrize(
    ("paths", "names"),
    [
        (["bags/data/hallway/training"], ["training"]),
        (["data/training", "data/test"], ["training", "test"]),
        (["run-1/bag", "run-2/bag"], ["run-1/bag", "run-2/bag"]),
        (
            ["a/run-1/bag", "b/run-1/bag", "b/run-2/bag"],
            ["a/run-1/bag", "b/run-1/bag", "b/run-2/bag"],
        ),
        (["run-1/bag", "bag"], ["run-1/bag", "bag"]),
        (["run-1/bag", "run-1/bag"], ["bag", "bag"]),
        (["/"], ["/"]),
        ([], []),
    ],
)
def test_no_more_of_a_path_is_kept_than_tells_it_apart(paths, names):
    assert short_names([Path(path) for path in paths]) == names
