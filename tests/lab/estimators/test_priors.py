import numpy as np
import pytest

import serd_core as sc
from lab.estimators.priors import EntropyPrior, NormPrior
from serd_core.arrays import gradient_differences
from serd_core.posterior.parameters import Parameters

#: Two states, one action, three outcomes; in state 1 two of them land in the same cell.
MODEL = sc.OutcomeModels([[[0, 1, 0]], [[1, 0, 1]]], [[0], [0]], np.ones((2, 1), bool), 1, 0.7)
REWARD, BELIEF, TRUTH, POLICY = sc.Block


def blocks(vector):
    return Parameters(vector[:2], vector[2:5], vector[5:8], vector[8:])


@pytest.mark.parametrize(
    ("prior", "size"),
    [
        (NormPrior(0.7, REWARD, p=1.0), 1.0),
        (NormPrior(0.7, BELIEF, p=7.0), 1.0),
        (NormPrior(0.7, POLICY), 1.0),
        (NormPrior(0.7, TRUTH, 1.0, 1e-9), 1e-9),
        (NormPrior(0.7, TRUTH, 7.0, 1e-2), 1e-2),
        (EntropyPrior(0.7), 1.0),
        (EntropyPrior(0.7, BELIEF), 1.0),
    ],
)
def test_derivatives_are_differences_also_within_the_kinks_of_a_norm(prior, size):
    vector, step = size * np.random.default_rng(0).normal(size=9), 1e-4 * size
    gradient = prior.evaluate(MODEL, blocks(vector)).gradient.vector
    sides = [
        prior.evaluate(MODEL, blocks(vector + unit)).value
        - prior.evaluate(MODEL, blocks(vector - unit)).value
        for unit in step * np.eye(9)
    ]
    np.testing.assert_allclose(gradient, np.array(sides) / (2 * step), atol=1e-5)
    numeric = gradient_differences(
        lambda v: prior.evaluate(MODEL, blocks(v)).gradient.vector, vector, step=step
    )
    exact = prior.hessian(MODEL, blocks(vector))
    np.testing.assert_allclose(exact, numeric, rtol=1e-5, atol=1e-5 / size)


def test_norms_are_those_of_the_textbook_and_entropy_sums_over_merged_transitions():
    def at(reward=(0.0, 0.0), truth=(0.0,) * 3):
        return Parameters(np.array(reward), np.zeros(3), np.array(truth), np.ones(1))

    for p, norm in ((1.0, 7.0), (2.0, 5.0), (3.0, 91 ** (1 / 3))):
        value = NormPrior(2.0, REWARD, p=p).evaluate(MODEL, at((3.0, -4.0))).value
        assert value == pytest.approx(-2 * norm, abs=1e-6)
    large = NormPrior(2.0, REWARD, p=400.0).evaluate(MODEL, at((3e3, -4e3)))
    assert large.value == pytest.approx(-8e3)
    binary = -(0.7 * np.log(0.7) + 0.3 * np.log(0.3))
    place = at(truth=np.log([0.2, 0.3, 0.5]) / 0.7)
    assert EntropyPrior(1.0).evaluate(MODEL, place).value == pytest.approx(2 * binary)
    for wrong, sentence in (({"p": 0.5}, "p of NormPrior"), ({"smoothing": 0.0}, "^smoothing of")):
        with pytest.raises(sc.SerdError, match=sentence):
            NormPrior(1.0, REWARD, **wrong)
