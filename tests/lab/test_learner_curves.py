"""Curves of learners: one style each, and values where they belong."""

from itertools import combinations

import pytest

from lab.learner_curves import STYLES

TOGETHER = (
    ("MDCE SERD", "MDCE IRL", "REIRL"),
    ("MDCE SERD", "MDCE SERD, training part", "MDCE SERD, stopped early"),
    ("PM SERD", "PM SERD, regularised", "MDCE IRL", "REIRL"),
    ("MDCE SERD", "SERD, free belief", "SERD, evidence", "MDCE IRL, likelihood", "REIRL"),
    ("MDCE SERD", "SERD, free belief", "SERD, evidence", "MDCE IRL, entropy", "cloning"),
    ("MDCE SERD", "SERD, averaged", "SERD, evidence", "REIRL", "cloning"),
)  # fmt: skip


@pytest.mark.parametrize("learners", TOGETHER)
def test_learners_of_one_figure_differ_in_colour_and_marker(learners) -> None:
    for one, other in combinations([STYLES[name] for name in learners], 2):
        assert one.colour != other.colour
        assert one.marker != other.marker
