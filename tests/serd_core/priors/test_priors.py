import numpy as np
import pytest
import scipy.integrate
from hypothesis import given, settings
from hypothesis import strategies as st

from serd_core.dynamics.outcome_models import OutcomeModels
from serd_core.errors import SerdError
from serd_core.posterior.derivatives.differences import gradient_differences
from serd_core.posterior.parameters import Block, Parameters
from serd_core.priors.coupling import CouplingPrior
from serd_core.priors.dirichlet import DirichletPrior
from serd_core.priors.divergence import KldPrior
from serd_core.priors.entropy import EntropyPrior
from serd_core.priors.gaussian import GaussianAroundTruth, GaussianPrior
from serd_core.priors.norm import NormPrior
from serd_core.priors.prior import UniformPrior

#: Two states, one action, three outcomes; in state 1 two of them land in the same cell.
MODEL = OutcomeModels([[[0, 1, 0]], [[1, 0, 1]]], [[0], [0]], np.ones((2, 1), bool), n_models=1)
REFERENCE = np.array([[0.2, 0.3, 0.5]])

PRIORS = [
    NormPrior(0.7, Block.REWARD, p=1.0),
    NormPrior(0.7, Block.TRUTH, p=2.0),
    NormPrior(0.7, Block.BELIEF, p=7.0),
    NormPrior(0.7, Block.POLICY),
    GaussianPrior(1.5, Block.REWARD, mean=0.3),
    EntropyPrior(0.7),
    EntropyPrior(0.7, Block.BELIEF, state_action_weights=np.array([[2.0], [0.5]])),
    KldPrior(0.7, REFERENCE),
    KldPrior(0.7, REFERENCE, Block.BELIEF, np.array([[2.0], [0.5]])),
    KldPrior(0.7, REFERENCE, state_action_weights=np.array([[2.0], [0.5]]), mean_over_pairs=True),
    EntropyPrior(0.7, mean_over_pairs=True),
    CouplingPrior(0.7),
    DirichletPrior(0.7),
    DirichletPrior(0.3, Block.BELIEF),
    GaussianAroundTruth(0.8),
    GaussianPrior((0.5, 2.0), Block.REWARD),
    KldPrior(0.7, REFERENCE) + GaussianPrior(2.0, Block.REWARD) + UniformPrior(),
]

#: Parameters at which two outcomes are equally probable.
EVENS = Parameters(np.zeros(1), np.zeros(2), np.zeros(2), np.zeros(1))


def blocks(vector):
    return Parameters(vector[:2], vector[2:5], vector[5:8], vector[8:])


@pytest.mark.parametrize("prior", PRIORS, ids=lambda prior: type(prior).__name__)
@settings(deadline=None, max_examples=20)
@given(seed=st.integers(0, 10_000))
def test_the_gradient_is_the_finite_difference(prior, seed):
    vector = np.random.default_rng(seed).normal(size=9)
    gradient = prior.evaluate(MODEL, blocks(vector)).gradient
    found = np.concatenate([gradient.reward, gradient.belief, gradient.truth, gradient.policy])
    step = 5e-8  # NormPrior bends within its smoothing of 1e-4
    numeric = [
        (
            prior.evaluate(MODEL, blocks(vector + step * unit)).value
            - prior.evaluate(MODEL, blocks(vector - step * unit)).value
        )
        / (2 * step)
        for unit in np.eye(9)
    ]
    np.testing.assert_allclose(found, numeric, atol=2e-7)


@pytest.mark.parametrize("prior", PRIORS, ids=lambda prior: type(prior).__name__)
@settings(deadline=None, max_examples=10)
@given(seed=st.integers(0, 10_000))
def test_second_derivatives_are_differences_of_the_gradient(prior, seed):
    vector = np.random.default_rng(seed).normal(size=9)
    exact = prior.hessian(MODEL, blocks(vector))
    numeric = gradient_differences(
        lambda v: prior.evaluate(MODEL, blocks(v)).gradient.vector, vector, step=1e-7
    )
    np.testing.assert_allclose(exact, numeric, rtol=1e-5, atol=1e-7)


@pytest.mark.parametrize("smoothing", [1e-2, 1e-5, 1e-9])
@pytest.mark.parametrize("p", [1.0, 1.5, 2.0, 7.0])
def test_second_derivatives_of_a_norm_hold_within_its_kinks(p, smoothing):
    """Differences by steps far below the smoothing, where the curvature is that of the kink."""
    prior = NormPrior(0.7, Block.TRUTH, p, smoothing)
    vector = np.array([3.0, -1.0, 0.1, 0.2, 0.3, 0.5, 0.0, -2.0, 1.5]) * smoothing
    exact = prior.hessian(MODEL, blocks(vector))
    numeric = gradient_differences(
        lambda v: prior.evaluate(MODEL, blocks(v)).gradient.vector, vector, step=1e-4 * smoothing
    )
    np.testing.assert_allclose(exact, numeric, rtol=1e-6, atol=1e-7 / smoothing)


def test_an_entry_at_the_kink_of_a_sum_of_magnitudes_has_the_curvature_of_its_smoothing():
    for smoothing in (1e-3, 1e-7, 1e-12):
        table = NormPrior(2.0, Block.REWARD, 1.0, smoothing).hessian(MODEL, at(reward=(0.0, 1.0)))
        assert table[0, 0] == pytest.approx(-2.0 / smoothing)
        assert table[0, 1] == 0.0


def at(reward=(0.0, 0.0), belief=(0.0,) * 3, truth=(0.0,) * 3):
    return Parameters(*(np.array(block, float) for block in (reward, belief, truth, (1.0,))))


def test_norms_are_those_of_the_textbook():
    point = at(reward=(3.0, -4.0))
    for p, norm in ((1.0, 7.0), (2.0, 5.0), (3.0, 91 ** (1 / 3))):
        value = NormPrior(2.0, Block.REWARD, p=p).evaluate(MODEL, point).value
        assert value == pytest.approx(-2 * norm, abs=1e-6)


def test_a_norm_of_zeros_has_a_gradient_of_zero():
    for p in (1.0, 2.0):
        found = NormPrior(1.0, Block.REWARD, p=p).evaluate(MODEL, at())
        np.testing.assert_array_equal(found.gradient.reward, 0)


def test_entropy_sums_over_merged_transitions():
    truth = np.log([0.2, 0.3, 0.5])
    value = EntropyPrior(1.0).evaluate(MODEL, at(truth=truth)).value
    binary = -(0.7 * np.log(0.7) + 0.3 * np.log(0.3))
    assert value == pytest.approx(2 * binary)


def test_divergence_is_zero_at_the_reference_and_negative_elsewhere():
    reference = np.log(REFERENCE[0])
    prior = KldPrior(1.0, REFERENCE)
    assert prior.evaluate(MODEL, at(truth=reference)).value == pytest.approx(0, abs=1e-12)
    elsewhere = prior.evaluate(MODEL, at()).value
    expected = 0.3 * np.log(0.3 / (1 / 3)) + 0.7 * np.log(0.7 / (2 / 3))
    assert elsewhere == pytest.approx(-2 * expected)


@pytest.mark.parametrize("n_states", [2, 50])
def test_the_mean_divergence_over_pairs_is_that_of_one_pair_on_every_problem_size(n_states):
    # On a ring of states an outcome stays and another goes on; one pair is not available.
    own = np.arange(n_states)
    successors = np.stack([own, (own + 1) % n_states], axis=1)[:, None].repeat(2, axis=1)
    available = np.ones((n_states, 2), bool)
    available[0, 1] = False
    model = OutcomeModels(successors, np.zeros((n_states, 2), int), available, n_models=1)
    prior = KldPrior(3.0, np.array([[0.75, 0.25]]), mean_over_pairs=True)
    one_pair = 0.75 * np.log(1.5) + 0.25 * np.log(0.5)
    assert prior.evaluate(model, EVENS).value == pytest.approx(-3.0 * one_pair, rel=1e-12)


def test_a_weighted_mean_divides_by_the_weights_of_available_pairs():
    # State 0 distinguishes both outcomes, in state 1 both lead to state 1: its divergence is 0.
    available = np.array([[True, False], [True, True]])
    model = OutcomeModels(
        [[[0, 1]] * 2, [[1, 1]] * 2], np.zeros((2, 2), int), available, n_models=1
    )
    weights = np.array([[3.0, 100.0], [1.0, 2.0]])
    prior = KldPrior(1.0, np.array([[0.75, 0.25]]), Block.TRUTH, weights, mean_over_pairs=True)
    expected = (0.75 * np.log(1.5) + 0.25 * np.log(0.5)) * 3.0 / 6.0
    assert prior.evaluate(model, EVENS).value == pytest.approx(-expected, rel=1e-12)
    none = KldPrior(
        1.0, np.array([[0.75, 0.25]]), Block.TRUTH, np.zeros((2, 2)), mean_over_pairs=True
    )
    with pytest.raises(SerdError, match="must have a positive sum over the available pairs, got 0"):
        none.evaluate(model, EVENS)


def test_transitions_that_the_reference_rules_out_do_not_count():
    prior = KldPrior(1.0, np.array([[1.0, 0.0, 0.0]]))
    value = prior.evaluate(MODEL, at(truth=(0.0, 0.0, 0.0))).value
    assert value == pytest.approx(-2 * np.log(3 / 2))


def test_an_unanchored_divergence_takes_the_initial_dynamics():
    prior = (KldPrior(1.0) + UniformPrior()).anchored(REFERENCE)
    assert prior.evaluate(MODEL, at(truth=np.log(REFERENCE[0]))).value == pytest.approx(0)
    with pytest.raises(SerdError, match="reference of KldPrior must be given"):
        KldPrior(1.0).evaluate(MODEL, at())


def test_coupling_is_zero_where_belief_and_truth_are_the_same():
    same = np.array([0.3, -0.2, 1.0])
    assert CouplingPrior(3.0).evaluate(MODEL, at(belief=same, truth=same)).value == 0
    assert CouplingPrior(3.0).evaluate(MODEL, at(belief=same)).value < 0


@pytest.mark.parametrize(
    ("make", "sentence"),
    [
        (lambda: KldPrior(-1.0), "weight of KldPrior must be finite and not negative, got -1.0"),
        (lambda: KldPrior(1.0, block=Block.REWARD), "block of KldPrior must be BELIEF or TRUTH"),
        (lambda: EntropyPrior(float("nan")), "weight of EntropyPrior must be finite"),
        (lambda: NormPrior(1.0, Block.REWARD, p=0.5), "p of NormPrior must be .* got 0.5"),
        (lambda: NormPrior(1.0, Block.REWARD, smoothing=0.0), "smoothing of NormPrior"),
        (lambda: GaussianPrior(0.0, Block.REWARD), "standard_deviation of GaussianPrior"),
        (lambda: GaussianPrior(1.0, Block.REWARD, mean=float("inf")), "mean of GaussianPrior"),
        (
            lambda: GaussianPrior("a", Block.REWARD),
            "standard_deviation of GaussianPrior must be an",
        ),
        (lambda: GaussianPrior(1.0, "reward"), "block of GaussianPrior .* Block object, got 'rewa"),
        (lambda: NormPrior(1.0, "reward"), "block of NormPrior must be a Block object"),
        (lambda: EntropyPrior(1.0, "truth"), "block of EntropyPrior must be a Block object"),
        (lambda: EntropyPrior("1"), "weight of EntropyPrior must be finite .* got '1'"),
        (
            lambda: DirichletPrior(1.0) + 3,
            "a term of a sum of priors must be a Prior object, got 3",
        ),
        (lambda: CouplingPrior(-2.0), "^weight of CouplingPrior must be finite"),
        (lambda: NormPrior(-1.0, Block.REWARD), "^weight of NormPrior must be finite"),
    ],
)
def test_wrong_settings_are_refused_by_name(make, sentence):
    with pytest.raises(SerdError, match=sentence):
        make()


def test_a_weight_of_zero_is_allowed_and_leaves_no_preference():
    assert EntropyPrior(0.0).evaluate(MODEL, at()).value == 0
    assert NormPrior(0.0, Block.REWARD).evaluate(MODEL, at()).value == 0


def test_wrong_pair_weights_are_refused():
    prior = EntropyPrior(1.0, state_action_weights=np.ones(3))
    with pytest.raises(SerdError, match=r"state_action_weights must have shape \(2, 1\)"):
        prior.evaluate(MODEL, at())


def test_a_reference_that_is_no_distribution_and_negative_pair_weights_are_refused():
    at = blocks(np.zeros(9))
    with pytest.raises(SerdError, match=r"state 0, action 0 .* the row sums to 1.5"):
        KldPrior(1.0, np.array([[0.5, 0.5, 0.5]])).evaluate(MODEL, at)
    with pytest.raises(SerdError, match=r"state_action_weights\[1, 0\] must not be negative"):
        EntropyPrior(1.0, state_action_weights=np.array([[1.0], [-1.0]])).evaluate(MODEL, at)


@pytest.mark.parametrize("beta", [1.0, 0.5])
@pytest.mark.parametrize(
    "prior", [DirichletPrior(0.7), DirichletPrior(2.0, Block.BELIEF), GaussianAroundTruth(0.8)]
)
def test_priors_of_dynamics_are_densities_over_energies_without_gauge(prior, beta):
    """Integrated over the plane of energies that sum to 0."""
    model = OutcomeModels([[[0, 1, 0]]] * 2, [[0], [0]], np.ones((2, 1), bool), 1, beta)
    basis = np.array([[1.0, -1.0, 0.0], [1.0, 1.0, -2.0]])
    basis /= np.linalg.norm(basis, axis=1, keepdims=True)
    truth = np.array([0.4, -0.3, -0.1])

    def density(second: float, first: float) -> float:
        moved = basis.T @ np.array([first, second]) / beta
        own, other = (moved, truth) if prior.blocks == (Block.BELIEF,) else (truth, moved)
        at = Parameters(np.zeros(0), own, other, np.zeros(0))
        value = prior.evaluate(model, at).value + prior.log_constant(model, at)
        return float(np.exp(value)) / beta**2

    whole = scipy.integrate.dblquad(density, -25, 25, -25, 25, epsabs=1e-5)[0]
    assert whole == pytest.approx(1.0, abs=1e-3)


def test_the_maximum_under_a_dirichlet_prior_is_its_mean():
    slope = DirichletPrior(0.7).evaluate(MODEL, blocks(np.zeros(9))).gradient.truth
    np.testing.assert_allclose(slope, 0.0, atol=1e-12)


def test_deviations_by_number_must_be_as_many_as_the_block_has():
    with pytest.raises(SerdError, match="one number or 2, one per parameter of the block reward"):
        GaussianPrior((1.0, 2.0, 3.0), Block.REWARD).evaluate(MODEL, blocks(np.zeros(9)))
