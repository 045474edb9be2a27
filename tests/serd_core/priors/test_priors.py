from dataclasses import dataclass

import numpy as np
import pytest
import scipy.integrate
import scipy.stats
from hypothesis import given, settings
from hypothesis import strategies as st

import serd_core as sc
from serd_core.arrays import FloatArray, gradient_differences
from serd_core.dynamics.outcome_models import OutcomeModels
from serd_core.errors import SerdError
from serd_core.posterior.parameters import Block, Parameters
from serd_core.priors.dirichlet import DirichletPrior
from serd_core.priors.divergence import CouplingPrior, EntropyPrior, KldPrior
from serd_core.priors.gaussian import GaussianAroundTruth, GaussianPrior
from serd_core.priors.norm import NormPrior
from serd_core.priors.prior import LogPrior, Prior, UniformPrior

#: Two states, one action, three outcomes; in state 1 two of them land in the same cell.
MODEL = OutcomeModels([[[0, 1, 0]], [[1, 0, 1]]], [[0], [0]], np.ones((2, 1), bool), n_models=1)
#: The same dynamics, of which the energies have another scale.
SCALED = OutcomeModels(MODEL.successors, MODEL.model_of, MODEL.available, n_models=1, beta=0.7)
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
    CouplingPrior(0.7, np.array([[3.0], [0.25]])),
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
    gradient = prior.evaluate(SCALED, blocks(vector)).gradient
    found = np.concatenate([gradient.reward, gradient.belief, gradient.truth, gradient.policy])
    step = 5e-8  # NormPrior bends within its smoothing of 1e-4
    numeric = [
        (
            prior.evaluate(SCALED, blocks(vector + step * unit)).value
            - prior.evaluate(SCALED, blocks(vector - step * unit)).value
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
    exact = prior.hessian(SCALED, blocks(vector))
    numeric = gradient_differences(
        lambda v: prior.evaluate(SCALED, blocks(v)).gradient.vector, vector, step=1e-7
    )
    np.testing.assert_allclose(exact, numeric, rtol=1e-5, atol=1e-7)


@pytest.mark.parametrize(
    ("p", "smoothing"), [(1.0, 1e-9), (1.5, 1e-2), (2.0, 1e-5), (7.0, 1e-2), (7.0, 1e-9)]
)
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
    large = NormPrior(2.0, Block.REWARD, p=400.0).evaluate(MODEL, at(reward=(3e3, -4e3)))
    assert large.value == pytest.approx(-8e3)
    for p in (1.0, 2.0):
        found = NormPrior(1.0, Block.REWARD, p=p).evaluate(MODEL, at())
        np.testing.assert_array_equal(found.gradient.reward, 0)
    empty = Parameters(np.array([1.0]), np.zeros(3), np.zeros(3), np.zeros(0))
    prior = NormPrior(0.7, Block.POLICY)
    assert prior.evaluate(MODEL, empty).value == 0.0
    np.testing.assert_array_equal(prior.hessian(MODEL, empty), np.zeros((7, 7)))


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
    with pytest.raises(SerdError, match=r"^reference of KldPrior must be given"):
        KldPrior(1.0).evaluate(MODEL, at())


def test_anchoring_keeps_a_given_reference_and_priors_that_need_none():
    for prior in (KldPrior(1.0, REFERENCE), EntropyPrior(1.0), UniformPrior()):
        assert prior.anchored(np.array([[0.5, 0.25, 0.25]])) is prior


@dataclass(frozen=True)
class NearReference(Prior):
    """A prior of one's own, which is compared by its fields and holds an array."""

    reference: FloatArray | None = None

    def evaluate(self, model, parameters):
        away = model.local_probabilities(parameters.truth) - self.reference
        return LogPrior(-float(np.sum(away**2)), parameters.zeros())

    def anchored(self, initial_local_probabilities):
        return NearReference(initial_local_probabilities)


def test_a_sum_anchors_terms_that_hold_arrays():
    prior = (UniformPrior() + NearReference()).anchored(REFERENCE).anchored(2.0 * REFERENCE)
    assert prior.evaluate(MODEL, at(truth=np.log(REFERENCE[0]))).value == pytest.approx(
        -float(np.sum(REFERENCE**2))
    )


def test_coupling_is_the_sum_of_divergences_by_the_weights_of_pairs():
    belief, truth = REFERENCE[0], np.array([0.6, 0.1, 0.3])
    ends = [(truth[[0, 2]].sum(), belief[[0, 2]].sum()), (truth[1], belief[1])]
    divergence = sum(p * np.log(p / q) for p, q in ends)
    place = at(belief=np.log(belief), truth=np.log(truth))
    for weights, total in ((None, 2.0), (np.array([[3.0], [0.25]]), 3.25), (np.zeros((2, 1)), 0.0)):
        value = CouplingPrior(0.7, weights).evaluate(MODEL, place).value
        assert value == pytest.approx(-0.7 * total * divergence)
    same = np.log(belief)
    assert CouplingPrior(3.0).evaluate(MODEL, at(belief=same, truth=same)).value == 0


class Quartic(Prior):
    """A prior without second derivatives of its own."""

    def evaluate(self, model: OutcomeModels, parameters: Parameters) -> LogPrior:
        weight, reward = model.n_models, parameters.reward
        gradient = parameters.zeros().with_block(Block.REWARD, -4.0 * weight * reward**3)
        return LogPrior(-weight * float(np.sum(reward**4)), gradient)


def test_a_prior_that_gives_no_second_derivatives_has_them_by_differences():
    table = Quartic().hessian(MODEL, at(reward=(1.0, -2.0)))
    np.testing.assert_allclose(table, np.diag([-12.0, -48.0] + [0.0] * 7), rtol=1e-6, atol=1e-6)


def test_no_preference_has_the_value_and_the_derivatives_zero():
    found = UniformPrior().evaluate(MODEL, at(reward=(1.0, 2.0)))
    assert found.value == 0.0
    np.testing.assert_array_equal(found.gradient.vector, np.zeros(9))
    np.testing.assert_array_equal(UniformPrior().hessian(MODEL, at()), np.zeros((9, 9)))
    assert UniformPrior().log_constant(MODEL, at()) == 0.0


@pytest.mark.parametrize(
    ("make", "sentence"),
    [
        (lambda: KldPrior(-1.0), "weight of KldPrior must be finite and not negative, got -1.0"),
        (lambda: KldPrior(1.0, block=Block.REWARD), "block of KldPrior must be BELIEF or TRUTH"),
        (lambda: EntropyPrior(float("nan")), "weight of EntropyPrior must be finite"),
        (lambda: NormPrior(1.0, Block.REWARD, p=0.5), "p of NormPrior must be .* got 0.5"),
        (lambda: NormPrior(1.0, Block.REWARD, smoothing=0.0), "^smoothing of NormPrior"),
        (lambda: GaussianPrior(0.0, Block.REWARD), "^standard_deviation of GaussianPrior"),
        (lambda: GaussianPrior(1.0, Block.REWARD, mean=float("inf")), "mean of GaussianPrior"),
        (
            lambda: GaussianPrior(1e-300, Block.REWARD),
            "Prior must be from 1e-50 to 1e.50, got 1e-3",
        ),
        (lambda: GaussianPrior((1.0, 1e300), Block.REWARD), "must be from 1e-50 to 1e.50, got 1e+"),
        (lambda: GaussianAroundTruth(1e-300), "Truth must be from 1e-50 to 1e.50, got 1e-300"),
        (
            lambda: GaussianPrior(1.0, "reward"),
            "^block of GaussianPrior .* Block object, got 'rewa",
        ),
        (lambda: EntropyPrior("1"), "^weight of EntropyPrior must be finite .* got '1'"),
        (
            lambda: DirichletPrior(1.0) + 3,
            "^a term of a sum of priors must be a Prior object, got 3",
        ),
        (lambda: NormPrior(1.0, Block.REWARD, p=float("inf")), "p of NormPrior must be .* got inf"),
        (lambda: GaussianAroundTruth(0.0), "^standard_deviation of GaussianAroundTruth must be"),
        (lambda: DirichletPrior(0.0), "^pseudo_count of DirichletPrior must be finite and above 0"),
        (lambda: DirichletPrior(1.0, "truth"), "^block must be a Block object, got 'truth'"),
        (lambda: DirichletPrior(1.0, Block.REWARD), "must be BELIEF or TRUTH, got REWARD"),
    ],
)
def test_wrong_settings_are_refused_by_name(make, sentence):
    with pytest.raises(SerdError, match=sentence):
        make()


@pytest.mark.parametrize("deviation", [1e-50, 1e50])
@pytest.mark.parametrize("mean", [-1e50, 1.0])
def test_the_strongest_and_the_widest_normal_prior_have_finite_derivatives(deviation, mean):
    prior, here = GaussianPrior(deviation, Block.REWARD, mean), at(reward=(1.0, 2.0))
    found = prior.evaluate(MODEL, here)
    assert np.isfinite(found.value)
    assert np.isfinite(found.gradient.vector).all()
    assert np.isfinite(prior.hessian(MODEL, here)).all()
    assert np.isfinite(prior.log_constant(MODEL, here))
    around = GaussianAroundTruth(deviation)
    assert np.isfinite(around.evaluate(MODEL, here).value)
    assert np.isfinite(around.hessian(MODEL, here)).all()


def test_a_reference_that_is_no_distribution_and_negative_pair_weights_are_refused():
    at = blocks(np.zeros(9))
    with pytest.raises(SerdError, match="one number or 2, one per parameter of the block reward"):
        GaussianPrior((1.0, 2.0, 3.0), Block.REWARD).evaluate(MODEL, at)
    with pytest.raises(SerdError, match=r"^state_action_weights must have shape \(2, 1\)"):
        EntropyPrior(1.0, state_action_weights=np.ones(3)).evaluate(MODEL, at)
    with pytest.raises(SerdError, match=r"state 0, action 0 .* the row sums to 1.5"):
        KldPrior(1.0, np.array([[0.5, 0.5, 0.5]])).evaluate(MODEL, at)
    with pytest.raises(SerdError, match=r"state_action_weights\[1, 0\] must not be negative"):
        EntropyPrior(1.0, state_action_weights=np.array([[1.0], [-1.0]])).evaluate(MODEL, at)


@pytest.mark.parametrize(
    "prior", [DirichletPrior(2.0, Block.BELIEF), GaussianAroundTruth(0.8)], ids=["count", "around"]
)
def test_priors_of_dynamics_are_densities_over_energies_without_gauge(prior):
    """Integrated over the plane of energies that sum to 0."""
    beta = 0.5
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

    # Of what decays on either side, sums over a grid converge as fast as the spacing is small.
    grid = np.linspace(-14.0, 14.0, 57)
    whole = 0.25 * sum(density(second, first) for first in grid for second in grid)
    assert whole == pytest.approx(1.0, abs=1e-3)


def test_the_maximum_under_a_dirichlet_prior_is_its_mean():
    slope = DirichletPrior(0.7).evaluate(MODEL, blocks(np.zeros(9))).gradient.truth
    np.testing.assert_allclose(slope, 0.0, atol=1e-12)


PLANE = np.array([[1.0, -1.0, 0.0], [1.0, 1.0, -2.0]]) / np.sqrt([[2.0], [6.0]])


def two_models(beta):
    """Two outcome models of three outcomes, and energies of both that have no gauge."""
    model = OutcomeModels([[[0, 1, 0]], [[1, 0, 1]]], [[0], [1]], np.ones((2, 1), bool), 2, beta)
    coordinates = np.array([[0.4, -1.1], [0.9, 0.2]]), np.array([[-0.3, 0.5], [1.2, -0.7]])
    belief, truth = ((each @ PLANE).ravel() for each in coordinates)
    return model, Parameters(np.zeros(0), belief, truth, np.zeros(0)), coordinates


@pytest.mark.parametrize("beta", [1.0, 0.5])
@pytest.mark.parametrize("block", [Block.BELIEF, Block.TRUTH])
def test_a_dirichlet_prior_is_that_distribution_of_each_model_by_energies(block, beta):
    model, parameters, _ = two_models(beta)
    prior = DirichletPrior(0.7, block)
    found = prior.evaluate(model, parameters).value + prior.log_constant(model, parameters)
    volume = 2.0 * np.log(beta) + 0.5 * np.log(3.0)
    expected = 0.0
    for row in model.local_probabilities(parameters.block(block)):
        # By log-ratios the density has the factor prod P more than by probabilities.
        expected += scipy.stats.dirichlet.logpdf(row, [0.7] * 3) + np.sum(np.log(row)) + volume
    assert found == pytest.approx(expected)


@pytest.mark.parametrize("beta", [1.0, 0.5])
def test_a_belief_around_the_truth_is_normal_in_each_direction_of_energies(beta):
    model, parameters, (belief, truth) = two_models(beta)
    prior = GaussianAroundTruth(0.8)
    found = prior.evaluate(model, parameters).value + prior.log_constant(model, parameters)
    assert found == pytest.approx(scipy.stats.norm.logpdf(belief, truth, 0.8 / beta).sum())


def test_a_common_offset_of_the_energies_of_a_model_is_no_deviation_from_the_truth():
    model, parameters, _ = two_models(0.5)
    offset = np.repeat([3.0, -1.0], 3)
    moved = parameters.with_block(Block.BELIEF, parameters.belief + offset)
    here, there = (GaussianAroundTruth(0.8).evaluate(model, at) for at in (parameters, moved))
    assert there.value == pytest.approx(here.value)
    np.testing.assert_allclose(there.gradient.vector, here.gradient.vector, atol=1e-12)


def test_a_gaussian_prior_is_the_normal_density_of_each_number():
    place = at(reward=(1.3, -0.4))
    for deviation in (1.5, (0.5, 2.0)):
        prior = GaussianPrior(deviation, Block.REWARD, mean=0.3)
        found = prior.evaluate(MODEL, place).value + prior.log_constant(MODEL, place)
        assert found == pytest.approx(scipy.stats.norm.logpdf(place.reward, 0.3, deviation).sum())
    both = GaussianPrior(1.5, Block.REWARD) + DirichletPrior(0.7) + UniformPrior()
    assert both.log_constant(MODEL, place) == pytest.approx(
        GaussianPrior(1.5, Block.REWARD).log_constant(MODEL, place)
        + DirichletPrior(0.7).log_constant(MODEL, place)
    )
    assert both.blocks == (Block.REWARD, Block.TRUTH)


def listed_transitions():
    """State 0 stays or goes on, which is listed twice, state 1 stays: one parameter."""
    return sc.learned_transitions((2, 1), [0, 0, 0, 1], [0, 0, 0, 0], [1, 0, 1, 1])


@pytest.mark.parametrize("block", [Block.BELIEF, Block.TRUTH])
def test_a_dirichlet_prior_of_listed_transitions_counts_each_distinct_one(block):
    model, prior = listed_transitions(), DirichletPrior(0.7, block)
    vector = np.array([0.5, np.log(3.0), np.log(3.0)])

    def of(vector):
        return Parameters(vector[:1], vector[1:2], vector[2:], np.zeros(0))

    value = prior.evaluate(model, of(vector)).value
    assert value == pytest.approx(0.7 * (np.log(0.25) + np.log(0.75)))
    slopes = [
        (
            prior.evaluate(model, of(vector + step)).value
            - prior.evaluate(model, of(vector - step)).value
        )
        / 2e-5
        for step in 1e-5 * np.eye(3)
    ]
    np.testing.assert_allclose(prior.evaluate(model, of(vector)).gradient.vector, slopes, atol=1e-8)
    numeric = gradient_differences(lambda v: prior.evaluate(model, of(v)).gradient.vector, vector)
    np.testing.assert_allclose(prior.hessian(model, of(vector)), numeric, atol=1e-8)


def test_priors_of_outcome_models_name_what_they_are_given_instead():
    place = Parameters(np.zeros(1), np.zeros(1), np.zeros(1), np.zeros(0))
    dirichlet_prior, around_truth = DirichletPrior(1.0), GaussianAroundTruth(1.0)
    listed = listed_transitions()
    calls = [
        ("DirichletPrior", dirichlet_prior.log_constant, listed, "SparseModel"),
        ("DirichletPrior", dirichlet_prior.evaluate, None, "NoneType"),
        ("DirichletPrior", dirichlet_prior.hessian, None, "NoneType"),
        ("GaussianAroundTruth", around_truth.log_constant, listed, "SparseModel"),
        ("GaussianAroundTruth", around_truth.evaluate, listed, "SparseModel"),
        ("GaussianAroundTruth", around_truth.hessian, listed, "SparseModel"),
    ]
    for name, call, model, kind in calls:
        with pytest.raises(SerdError, match=f"^{name} is a prior of OutcomeModels, got {kind}"):
            call(model, place)


def test_priors_that_are_no_densities_have_no_constant():
    for prior in (NormPrior(1.0, Block.REWARD), KldPrior(1.0, REFERENCE), CouplingPrior(1.0)):
        name = type(prior).__name__
        with pytest.raises(SerdError, match=f"need priors that are densities, .* got {name}"):
            prior.log_constant(MODEL, at())
        with pytest.raises(SerdError, match=f"need priors that are densities, .* got {name}"):
            _ = prior.blocks


@pytest.mark.parametrize(
    ("value", "slope", "message"),
    [
        (np.nan, 0.0, "a LogPrior must hold numbers, got the value nan"),
        (0.0, np.nan, r"a LogPrior must hold numbers, got .* gradient \[nan"),
        (0.0, None, "gradient of a LogPrior must be a Parameters object, got None"),
    ],
)
def test_a_users_prior_that_returns_no_numbers_is_named(gridworld, value, slope, message):
    class Mine(Prior):
        def evaluate(self, model, parameters):
            del model
            length = len(parameters.vector)
            gradient = None if slope is None else parameters.with_vector(np.full(length, slope))
            return LogPrior(value, gradient)

    with pytest.raises(SerdError, match=message):
        sc.fit_mdce_irl_by_likelihood(
            gridworld.problem, gridworld.decisions, initial_weights=np.zeros(2), prior=Mine()
        )
