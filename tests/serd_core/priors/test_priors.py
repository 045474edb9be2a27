import numpy as np
import pytest
import scipy.stats
from hypothesis import given, settings
from hypothesis import strategies as st

import serd_core as sc
from serd_core.arrays import gradient_differences
from serd_core.errors import SerdError
from serd_core.posterior.parameters import Block, Parameters
from serd_core.priors.divergence import CouplingPrior, DirichletPrior, KldPrior
from serd_core.priors.prior import GaussianPrior, LogPrior, UniformPrior

BOTH = np.ones((2, 1), bool)
#: Two states, one action, three outcomes; in state 1 two of them land in the same cell.
MODEL = sc.OutcomeModels([[[0, 1, 0]], [[1, 0, 1]]], [[0], [0]], BOTH, n_models=1)
#: The same dynamics, of which the energies have another scale.
SCALED = sc.OutcomeModels(
    MODEL.successors, MODEL.model_of, BOTH, n_models=1, beta=0.7, intended=[2]
)
REFERENCE = np.array([[0.2, 0.3, 0.5]])
PAIRS = np.array([[2.0], [0.5]])

PRIORS = [
    GaussianPrior(1.5, Block.REWARD, mean=0.3),
    KldPrior(0.7, REFERENCE, Block.BELIEF, state_action_weights=PAIRS),
    CouplingPrior(0.7),
    DirichletPrior(0.3, Block.BELIEF),
    DirichletPrior(0.3, intended_ratio=7.0),
    GaussianPrior((0.5, 2.0), Block.REWARD),
    KldPrior(0.7, REFERENCE) + CouplingPrior(0.7) + DirichletPrior(0.7) + UniformPrior(),
]


def blocks(vector):
    return Parameters(vector[:2], vector[2:5], vector[5:8], vector[8:])


def at(reward=(0.0, 0.0), belief=(0.0,) * 3, truth=(0.0,) * 3):
    return Parameters(*(np.array(block, float) for block in (reward, belief, truth, (1.0,))))


def require_derivatives(prior, model, of, vector):
    """Gradient and second derivatives are finite differences."""
    step, found = 5e-8, prior.evaluate(model, of(vector)).gradient.vector
    numeric = [
        prior.evaluate(model, of(vector + unit)).value
        - prior.evaluate(model, of(vector - unit)).value
        for unit in step * np.eye(len(vector))
    ]
    np.testing.assert_allclose(found, np.array(numeric) / (2 * step), atol=2e-7)
    several = [of(vector), of(vector[::-1] / 2)]
    values = [prior.evaluate(model, each).value for each in several]
    np.testing.assert_allclose(prior.values(model, several), values, rtol=1e-12)
    by_gradient = gradient_differences(
        lambda v: prior.evaluate(model, of(v)).gradient.vector, vector, step=1e-7
    )
    np.testing.assert_allclose(prior.hessian(model, of(vector)), by_gradient, rtol=1e-5, atol=1e-7)


@pytest.mark.parametrize("prior", PRIORS, ids=lambda prior: type(prior).__name__)
@settings(deadline=None, max_examples=8)
@given(seed=st.integers(0, 10_000))
def test_gradient_and_second_derivatives_are_finite_differences(prior, seed):
    require_derivatives(prior, SCALED, blocks, np.random.default_rng(seed).normal(size=9))


def test_divergence_sums_over_merged_transitions_by_the_weights_of_pairs():
    prior, weighted = KldPrior(1.0, REFERENCE), KldPrior(1.0, REFERENCE, Block.TRUTH, PAIRS)
    there = at(truth=np.log(REFERENCE[0]))
    assert prior.evaluate(MODEL, there).value == pytest.approx(0, abs=1e-12)
    elsewhere = 0.3 * np.log(0.3 / (1 / 3)) + 0.7 * np.log(0.7 / (2 / 3))
    assert prior.evaluate(MODEL, at()).value == pytest.approx(-2 * elsewhere)
    assert weighted.evaluate(MODEL, at()).value == pytest.approx(-2.5 * elsewhere)
    # Transitions that the reference rules out do not count.
    certain = KldPrior(1.0, np.array([[1.0, 0.0, 0.0]])).evaluate(MODEL, at()).value
    assert certain == pytest.approx(-2 * np.log(3 / 2))


def test_a_divergence_without_reference_is_anchored_to_the_initial_dynamics():
    prior = (KldPrior(1.0) + UniformPrior()).anchored(REFERENCE)
    assert prior.evaluate(MODEL, at(truth=np.log(REFERENCE[0]))).value == pytest.approx(0)
    with pytest.raises(SerdError, match=r"^reference of KldPrior must be given"):
        KldPrior(1.0).evaluate(MODEL, at())


def test_coupling_is_the_sum_of_divergences():
    belief, truth = REFERENCE[0], np.array([0.6, 0.1, 0.3])
    ends = [(truth[[0, 2]].sum(), belief[[0, 2]].sum()), (truth[1], belief[1])]
    divergence = sum(p * np.log(p / q) for p, q in ends)
    place = at(belief=np.log(belief), truth=np.log(truth))
    assert CouplingPrior(0.7).evaluate(MODEL, place).value == pytest.approx(-1.4 * divergence)
    same = at(belief=np.log(belief), truth=np.log(belief))
    assert CouplingPrior(3.0).evaluate(MODEL, same).value == 0


@pytest.mark.parametrize(
    ("prior", "model", "sentence"),
    [
        (GaussianPrior((1.0, 2.0, 3.0), Block.REWARD), MODEL, "one number or 2, one per parameter"),
        (KldPrior(1.0, REFERENCE, Block.TRUTH, np.ones(3)), MODEL, r"must have shape \(2, 1\)"),
        (KldPrior(1.0, np.full((1, 3), 0.5)), MODEL, r"state 0, action 0 .* the row sums to 1.5"),
        (KldPrior(1.0, REFERENCE, Block.TRUTH, PAIRS - 1.0), MODEL, r"\[1, 0\] must not be neg"),
        (DirichletPrior(1.0), None, "^DirichletPrior is a prior of OutcomeModels, got NoneType"),
    ],
)
def test_priors_of_what_the_problem_does_not_have_are_refused(prior, model, sentence):
    for call in (prior.evaluate, prior.hessian):
        with pytest.raises(SerdError, match=sentence):
            call(model, blocks(np.zeros(9)))


PLANE = np.array([[1.0, -1.0, 0.0], [1.0, 1.0, -2.0]]) / np.sqrt([[2.0], [6.0]])


@pytest.mark.parametrize(("beta", "ratio"), [(1.0, 1.0), (0.5, 1.0), (0.5, 4.0)])
def test_priors_of_dynamics_are_densities_of_energies_without_gauge(beta, ratio):
    model = sc.OutcomeModels(MODEL.successors, [[0], [1]], BOTH, 2, beta, intended=[1, 1])
    counts = 0.7 * np.array([1.0, ratio, 1.0])
    belief, truth = np.array([[0.4, -1.1], [0.9, 0.2]]), np.array([[-0.3, 0.5], [1.2, -0.7]])
    place = Parameters(np.zeros(0), (belief @ PLANE).ravel(), (truth @ PLANE).ravel(), np.zeros(0))
    for block in (Block.BELIEF, Block.TRUTH):
        prior, expected = DirichletPrior(0.7, block, ratio), 0.0
        for row in model.local_probabilities(place.block(block)):
            # By log-ratios the density has the factor prod P more than by probabilities.
            expected += scipy.stats.dirichlet.logpdf(row, counts) + np.sum(np.log(row))
            expected += 2.0 * np.log(beta) + 0.5 * np.log(3.0)
        found = prior.evaluate(model, place).value + prior.log_constant(model, place)
        assert found == pytest.approx(expected)


def test_a_gaussian_prior_is_the_normal_density_of_each_number():
    place = at(reward=(1.3, -0.4))
    for deviation in (1.5, (0.5, 2.0)):
        prior = GaussianPrior(deviation, Block.REWARD, mean=0.3)
        found = prior.evaluate(MODEL, place).value + prior.log_constant(MODEL, place)
        assert found == pytest.approx(scipy.stats.norm.logpdf(place.reward, 0.3, deviation).sum())
    parts = GaussianPrior(1.5, Block.REWARD), DirichletPrior(0.7)
    both = parts[0] + parts[1] + UniformPrior()
    total = sum(part.log_constant(MODEL, place) for part in parts)
    assert both.log_constant(MODEL, place) == pytest.approx(total)
    assert both.blocks == (Block.REWARD, Block.TRUTH)


@pytest.mark.parametrize(("value", "slope"), [(np.nan, 0.0), (0.0, np.nan)])
def test_a_prior_that_returns_no_numbers_is_named(value, slope):
    gradient = at().with_vector(np.full(9, slope))
    with pytest.raises(SerdError, match="a LogPrior must hold numbers, got the value"):
        LogPrior(value, gradient)
