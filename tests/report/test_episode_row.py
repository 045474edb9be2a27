"""Rows of the episodes table refuse what cannot be."""

import pytest

from report.inputs import EpisodeRow
from serd_core.errors import SerdError


def test_an_unknown_outcome_is_refused() -> None:
    with pytest.raises(SerdError, match="must be one of arrived, timeout, aborted, got 'lost'"):
        EpisodeRow(3, 0, "lost", None, 1.0)  # type: ignore[arg-type]


def test_a_time_without_an_arrival_is_refused() -> None:
    with pytest.raises(SerdError, match="time_of_arrival_s of episode 3 must be given exactly if"):
        EpisodeRow(3, 0, "timeout", 4.0, 1.0)


def test_a_nan_time_is_refused() -> None:
    with pytest.raises(SerdError, match="time_of_arrival_s of episode 3 must be a finite number"):
        EpisodeRow(3, 0, "arrived", float("nan"), 1.0)
