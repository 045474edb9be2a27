"""Pictures carry the numbers they were given; matplotlib is asked for where it is missing."""

import subprocess
import sys

import numpy as np
import pytest
from matplotlib.figure import Figure

import serd_core as sc
from serd_core import plots


@pytest.fixture
def axes():
    return Figure().subplots()


def test_arrows_of_a_policy_have_its_probabilities_as_lengths_and_waits_are_dots(axes):
    chances, steps = np.array([[0.7, 0.3, 0.0], [0.0, 0.0, 1.0]]), [(1, 0), (0, 1), (0, 0)]
    assert plots.policy(chances, (1, 2), axes, directions=steps) is axes
    arrows, dots = axes.collections
    lengths = np.hypot(arrows.U, arrows.V)
    np.testing.assert_allclose(lengths / lengths.sum(), [0.7, 0.3])
    np.testing.assert_array_equal(dots.get_offsets(), [[1, 0]])


def test_states_without_a_choice_have_no_arrow_and_maps_begin_at_the_top_left(axes):
    ring = np.eye(4)[[[0, 1], [1, 2], [2, 3], [3, 3]]]
    ring[3, 1] = 0.0
    problem = sc.from_transitions(ring, np.eye(4)[:, [3]], discount=0.9)
    plots.policy(sc.soft_policy(problem, [1.0]), (2, 2), axes)
    starts = {tuple(xy) for xy in axes.collections[0].get_offsets()}
    assert starts == {(0, 1), (1, 1), (0, 0)}
    plots.occupancy(sc.decisions_from_episodes([([0, 1, 1], [1, 0])]), (2, 2), axes)
    np.testing.assert_array_equal(axes.collections[-1].get_array(), [1, 1, 0, 0])


@pytest.mark.parametrize(
    ("draw", "sentence"),
    [
        (lambda: plots.values(np.zeros(3), (2, 2)), r"value must have shape \(4\), got \(3,\)"),
        (lambda: plots.values([0.0], "x"), "cells must be an array of numbers"),
        (lambda: plots.policy(np.full(4, 9), (2, 2)), "must be an action that directions have"),
        (lambda: plots.outcomes({"a": [1.0]}, "ab"), r"tables\['a'\] must have shape \(2\) or \(3"),
        (lambda: plots.learning_curve([1, 2], [1.0]), r"measure must have shape \(2\) or \(3, 2\)"),
    ],
)
def test_what_does_not_fit_is_named(draw, sentence, axes, monkeypatch):
    monkeypatch.setattr(plots, "_axes", lambda _: axes)
    with pytest.raises(sc.SerdError, match=sentence):
        draw()


def test_without_matplotlib_the_extra_is_named():
    code = "import sys; sys.modules['matplotlib'] = None; import serd_core as sc"
    code += "; sc.plots.values([0.0], (1, 1))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.stderr.endswith("missing; run: pip install serd-core[plots]\n")
