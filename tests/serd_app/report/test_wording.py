"""Numbers in sentences read as a person would write them."""

import pytest

from serd_app.report.words import in_words, percent
from serd_bag.quantities import counted, seconds_in_words


@pytest.mark.parametrize(
    ("seconds", "words"),
    [(3.14, "3.1 s"), (51.1, "51 s"), (119.9, "2 min"), (420.0, "7 min"), (139.6, "2 min 20 s")],
)
def test_durations(seconds: float, words: str) -> None:
    assert seconds_in_words(seconds) == words


def test_shares_counts_and_names() -> None:
    assert [percent(1.0), percent(0.75), percent(2 / 3)] == ["100 %", "75 %", "66.7 %"]
    assert [counted(1, "episode"), counted(0, "episode")] == ["1 episode", "0 episodes"]
    assert in_words("with_flow") == "with flow"
