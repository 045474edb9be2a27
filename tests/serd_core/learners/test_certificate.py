"""`converged` holds at a maximum only, and its message names what is missing."""

import re

import numpy as np
import pytest

import serd_core as sc
from serd_core.ascent.ascent import FunctionObjective, Lbfgs
from serd_core.learners import certificate
from serd_core.learners.certificate import judged_weights, open_directions
from support.small_problems import apart

LIKELY = sc.fit_mdce_irl_by_likelihood


#: Converged wherever it starts.
STAYS = sc.Lbfgs(gradient_tolerance=1e6)


def test_a_saddle_is_left_and_named_where_no_step_leaves_it(minimum_example, monkeypatch):
    """At equal dynamics the gradient by the reward vanishes, and the log posterior bends up."""
    given = {
        "initial_weights": np.zeros(1),
        "dynamics": np.full((2, 2), 0.5),
        "prior": sc.GaussianPrior(2.0, sc.Block.REWARD) + sc.GaussianPrior(1.0, sc.Block.TRUTH),
    }
    decisions = apart(0, 0, [0, 1, 1] * 10)
    fit = sc.fit_mdce_serd(minimum_example, decisions, **given)
    assert fit.converged
    assert abs(fit.reward_weights[0]) > 0.1
    monkeypatch.setattr(certificate, "FINAL_STEPS", 0)
    fit = sc.fit_mdce_serd(minimum_example, decisions, ascent=STAYS, **given)
    assert not fit.converged
    assert re.search(r"bends up along .*\(a saddle point\)", fit.message)


def random_case(kind):
    """Decisions by weights 1 and -1; other kinds differ in one way.

    separable: the optimal policy's. avoided: a third feature of an action that is never taken.
    zero, constant, sum: a third feature of that value.
    """
    rng = np.random.default_rng(0)
    moves, features = rng.dirichlet(np.full(10, 0.3), size=(10, 3)), rng.normal(size=(10, 3, 2))
    mdp = sc.from_transitions(moves, features, discount=0.8).mdp
    problem = sc.TabularProblem(mdp, features, ("one", "two"))
    solve = sc.optimal_policy if kind == "separable" else sc.soft_policy
    policy = solve(problem, [1.0, -1.0]).probabilities
    third = {
        "avoided": np.tile([0.0, 0.0, 1.0], (10, 1)),
        "zero": np.zeros((10, 3)),
        "constant": np.ones((10, 3)),
        "sum": features @ [1.0, -2.0],
    }
    if kind in third:
        wider = np.concatenate([features, third[kind][:, :, None]], axis=2)
        problem = sc.TabularProblem(mdp, wider, ("one", "two", "third"))
    if kind == "avoided":
        policy = policy * [1.0, 1.0, 0.0]
        policy = policy / policy.sum(axis=1, keepdims=True)
    rng = np.random.default_rng(100)
    return problem, sc.sample_decisions(mdp, policy, n_episodes=40, n_steps=15, rng=rng)


#: Holds the scale that rewards and temperature have in common.
SCALE = sc.GaussianPrior(0.1, sc.Block.POLICY, 1.0)


def by_relative_entropy(problem, decisions, **start):
    uniform, rng = np.full((10, 3), 1 / 3), np.random.default_rng(9)
    samples = sc.sample_decisions(problem.mdp, uniform, n_episodes=1500, n_steps=15, rng=rng)
    given = {"samples": samples, "sampling_policy": uniform}
    given["thresholds"] = np.zeros(len(problem.feature_names))
    return sc.fit_relative_entropy_irl(problem, decisions, **given, **start)


def by_policy_matching_serd(problem, decisions, prior=SCALE, **start):
    return sc.fit_pm_serd(problem, decisions, belief=sc.FixedBelief(), prior=prior, **start)


def by_several_goals(problem, decisions, initial_weights):
    del initial_weights
    return sc.fit_several_goals([(problem, decisions)])


def started(learner, problem, decisions, **options):
    start = np.full(len(problem.feature_names), 0.1)
    return learner(problem, decisions, initial_weights=start, **options)


LIKELIHOODS = (LIKELY, by_policy_matching_serd, by_several_goals)
MATCHING = (sc.fit_mdce_irl_by_entropy, sc.fit_maxent_irl, by_relative_entropy)
LEARNERS = (*LIKELIHOODS, *MATCHING, sc.fit_policy_matching)


@pytest.mark.parametrize("learner", LEARNERS)
def test_learners_converge_where_decisions_determine_all_weights(learner):
    fit = started(learner, *random_case("plain"))
    assert fit.converged, fit.message
    if learner is by_policy_matching_serd:
        assert np.isnan(fit.newton_decrement)  # its objective has kinks
    elif learner is not by_several_goals:
        assert 0.0 <= fit.newton_decrement < 0.02


@pytest.mark.parametrize("learner", [LIKELY, sc.fit_maxent_irl, sc.fit_mdce_irl_by_entropy])
def test_the_newton_step_of_an_ascent_that_ends_early_counts_standard_errors(learner):
    """Its length is the distance to the maximum in the metric of the information at the end."""
    case = random_case("plain")
    tolerant = {"ascent": sc.Lbfgs(gradient_tolerance=0.03)}
    early, end = started(learner, *case, **tolerant), started(learner, *case)
    if learner is LIKELY:  # goes on to the maximum
        errors = sc.standard_errors(case[0], sc.fit_information(*case, end))
        move = early.reward_weights - end.reward_weights
        assert np.sqrt(move @ np.linalg.inv(errors.covariance) @ move) < 1e-3
        return
    assert early.newton_decrement > 0.01
    assert end.newton_decrement < 1e-2 * early.newton_decrement


#: Where some learners have finite maxima, as thresholds, squares and samples bound what they match.
BOUNDED = {
    (sc.fit_maxent_irl, "separable"),
    (by_relative_entropy, "separable"),
    (sc.fit_policy_matching, "avoided"),
}
KINDS = ("separable", "avoided", "zero", "constant", "sum")


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("learner", LEARNERS)
def test_no_learner_converges_where_weights_run_away_or_are_not_determined(learner, kind):
    """The message names the direction; decisions by the optimal policy are in that of the truth."""
    fit = started(learner, *random_case(kind))
    if (learner, kind) in BOUNDED and fit.converged:
        assert np.all(np.abs(fit.reward_weights) < 50.0)
        assert fit.newton_decrement < 0.02
        return
    assert not fit.converged
    parts = re.findall(r"([-+]\d\.\d\d) reward (one|two|third)", fit.message)
    signs = {name: np.sign(float(part)) for part, name in parts}
    if kind == "separable":
        assert signs.get("one", 1.0) == 1.0, fit.message
        assert signs.get("two", -1.0) == -1.0, fit.message
        assert signs, fit.message
    elif kind == "avoided":
        assert signs["third"] == -1.0, fit.message
    else:
        assert "third" in signs, fit.message
        if learner is not by_several_goals:
            assert any("reward third" in direction for direction in fit.undetermined)


@pytest.mark.parametrize("kind", ["zero", "constant", "sum", "plain"])
@pytest.mark.parametrize("prior", [None, sc.GaussianPrior(2.0, sc.Block.REWARD)])
def test_weights_that_only_their_prior_determines_are_named_and_have_no_error(kind, prior):
    problem, decisions = random_case(kind)
    zeros = np.zeros(len(problem.feature_names))
    fit = sc.fit_mdce_serd(problem, decisions, initial_weights=zeros, prior=prior)
    errors = sc.standard_errors(problem, sc.fit_information(problem, decisions, fit))
    assert fit.converged
    assert ("converged: yes" in fit.summary(errors)) == (kind == "plain")
    assert ("the prior alone determines" in fit.message) == (kind != "plain")
    assert np.isfinite(errors.reward[:2]).all() == (kind != "sum")
    if kind != "plain":
        assert "reward third" in " ".join(fit.undetermined)
        assert errors.reward[2] == np.inf


def test_the_scale_that_rewards_and_temperature_have_in_common_is_named():
    fit = started(by_policy_matching_serd, *random_case("plain"), prior=sc.UniformPrior())
    assert not fit.converged
    assert "log temperature" in fit.undetermined[0]
    assert "reward one" in fit.undetermined[0]


NAMES = ("first", "second", "third")
ROWS = np.random.default_rng(0).normal(size=(40, 2))
SEPARABLE = ROWS @ [1.0, -2.0] > 0
NOISY = ROWS @ [1.0, -2.0] + np.random.default_rng(1).logistic(size=40) > 0


def logistic(rows, labels, precision=0.0):
    """Mean log-likelihood of a logistic model with a normal prior, and where its ascent ends."""
    signed = np.where(np.array(labels)[:, None], 1.0, -1.0) * np.array(rows, dtype=float)

    def evaluate(w):
        margin = signed @ w
        value = -np.mean(np.logaddexp(0.0, -margin)) - 0.5 * precision * w @ w
        return value, signed.T @ (1 / (1 + np.exp(margin))) / len(signed) - precision * w

    objective = FunctionObjective(evaluate)
    return objective, Lbfgs().maximise(objective, np.zeros(signed.shape[1]))


@pytest.mark.parametrize(
    ("labels", "precision"), [(NOISY, 0.0), (SEPARABLE, 1.0), (SEPARABLE, 1e-6)]
)
def test_a_maximum_has_no_open_direction_and_a_prior_bounds_separable_data(labels, precision):
    objective, end = logistic(ROWS, labels, precision)
    found = open_directions(objective, end.vector)
    assert len(found.growing) == len(found.flat) == 0


@pytest.mark.parametrize("weights", [(0.0, 0.0), (2.0, -1.0)])
def test_what_nothing_depends_on_is_flat(weights):
    """A number that is in no row, and two that are in all rows as their sum."""
    objective, end = logistic(np.column_stack([ROWS, ROWS @ weights]), NOISY)
    found = open_directions(objective, end.vector)
    assert len(found.growing) == 0
    (way,) = found.flat
    known = np.array([*weights, -1.0]) / np.linalg.norm([*weights, -1.0])
    assert abs(way @ known) == pytest.approx(1.0, abs=1e-6)
    judged, undetermined = judged_weights(objective, end, np.ones(3), NAMES, "leave it out")
    assert judged.message == f"not converged: nothing determines {undetermined[0]}; leave it out"
    assert "third" in undetermined[0]


def test_kinks_and_other_maxima_are_no_open_directions():
    kink = FunctionObjective(lambda x: (-float(np.abs(x).sum()), -np.sign(x)))
    assert len(open_directions(kink, np.zeros(2), kinked=True).growing) == 0

    def higher_farther_on(x):
        value = float(-np.sum((x**2 - 25.0) ** 2) / 100 + 0.1 * x.sum())
        return value, -4 * x * (x**2 - 25.0) / 100 + 0.1

    two = FunctionObjective(higher_farther_on)
    end = Lbfgs().maximise(two, np.full(1, -6.0))
    assert end.converged
    found = open_directions(two, end.vector)
    assert len(found.growing) == len(found.flat) == 0


def test_an_ascent_that_was_stopped_or_is_far_from_its_end_stays_as_it_is():
    objective, _ = logistic(ROWS, SEPARABLE)
    stopped = Lbfgs().maximise(objective, np.zeros(2), lambda step: step.number == 2)
    short = Lbfgs(max_steps=1).maximise(objective, np.zeros(2))
    for end in (stopped, short):
        assert judged_weights(objective, end, np.ones(2), NAMES[:2], "stop") == (end, ())
