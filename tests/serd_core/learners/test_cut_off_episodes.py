"""Features of episodes that were cut off, which do not hold what would have followed."""

import numpy as np
import pytest

import serd_core as sc
from serd_core.demonstrations.trajectories import cut_off_ends, feature_counts
from serd_core.learners.relative_entropy_irl import sample_from_estimates

TRUE = np.array([1.0, -1.0])


def random_problem(seed=1, n_states=12, discount=0.95, concentration=0.3):
    rng = np.random.default_rng(seed)
    moves = rng.dirichlet(np.full(n_states, concentration), size=(n_states, 3))
    features = rng.normal(size=(n_states, 3, 2))
    return sc.from_transitions(moves, features, discount=discount)


def demonstrations(problem, n_steps, n_decisions=20_000, seed=2):
    expert = sc.soft_policy(problem, TRUE).probabilities
    return sc.sample_decisions(
        problem.mdp,
        expert,
        n_episodes=n_decisions // n_steps,
        n_steps=n_steps,
        rng=np.random.default_rng(seed),
    )


@pytest.mark.parametrize(("n_steps", "seed"), [(1, 1), (2, 2), (20, 1), (60, 2)])
def test_the_weights_do_not_depend_on_where_episodes_were_cut_off(n_steps, seed):
    problem = random_problem(seed)
    decisions = demonstrations(problem, n_steps)
    fit = sc.fit_mdce_irl_by_entropy(problem, decisions, initial_weights=np.zeros(2))
    assert fit.converged
    np.testing.assert_allclose(fit.reward_weights, TRUE, atol=0.35)


def test_episodes_of_different_lengths_are_matched_together():
    problem = random_problem()
    short, long = demonstrations(problem, 3, 6000), demonstrations(problem, 40, 6000, seed=3)
    later = {"episode": long.episode + len(short)}
    names = ("episode", "time_s", "state", "action", "next_state")
    columns = [(getattr(short, name), later.get(name, getattr(long, name))) for name in names]
    both = sc.Decisions(**dict(zip(names, map(np.concatenate, columns), strict=True)), source="two")
    fit = sc.fit_mdce_irl_by_entropy(problem, both, initial_weights=np.zeros(2))
    np.testing.assert_allclose(fit.reward_weights, TRUE, atol=0.35)


def test_under_certain_dynamics_the_objective_is_the_discounted_log_likelihood():
    """Then V(s_t) - gamma V(s_{t+1}) is what the choice of a_t leaves of its reward."""
    problem = random_problem(concentration=1e-4, discount=0.8)
    decisions = demonstrations(problem, 6, 1200)
    step = decisions.time_s - decisions.time_s.min()
    discounted = 0.8 ** (step % 6)

    def objective(weights):
        policy = sc.soft_policy(problem, weights).probabilities
        chosen = np.log(policy[decisions.state, decisions.action])
        return discounted @ chosen / len(decisions.episodes)

    fit = sc.fit_mdce_irl_by_entropy(problem, decisions, initial_weights=np.zeros(2))
    shift = 1e-4 * np.eye(2)
    slopes = [
        (objective(fit.reward_weights + each) - objective(fit.reward_weights - each)) / 2e-4
        for each in shift
    ]
    np.testing.assert_allclose(slopes, 0.0, atol=2e-3)
    assert objective(fit.reward_weights) > objective(1.1 * fit.reward_weights)


def test_the_gradient_is_that_of_the_objective_with_the_values_at_the_ends():
    problem = random_problem()
    decisions = demonstrations(problem, 5, 2000)
    wanted = feature_counts(problem, decisions).mean(axis=0)
    starts = np.bincount(decisions.state[::5], minlength=12) / len(decisions.episodes)
    ends = cut_off_ends(problem, decisions)
    assert ends.sum() == pytest.approx(0.95**5)

    def objective(weights):
        return weights @ wanted + (ends - starts) @ sc.soft_policy(problem, weights).value

    fit = sc.fit_mdce_irl_by_entropy(problem, decisions, initial_weights=np.zeros(2))
    for each in 1e-4 * np.eye(2):
        slope = objective(fit.reward_weights + each) - objective(fit.reward_weights - each)
        assert slope / 2e-4 == pytest.approx(0.0, abs=1e-4)


def test_relative_entropy_compares_with_samples_that_are_cut_off_at_the_same_time():
    problem = random_problem()
    decisions = demonstrations(problem, 5, 3000)

    def fitted(n_steps):
        samples, policy = sample_from_estimates(
            problem, decisions, n_episodes=4000, n_steps=n_steps, rng=np.random.default_rng(0)
        )
        return sc.fit_relative_entropy_irl(
            problem,
            decisions,
            samples=samples,
            sampling_policy=policy,
            thresholds=np.zeros(2),
            initial_weights=np.zeros(2),
        ).reward_weights

    np.testing.assert_allclose(fitted(40), fitted(5), atol=0.1)
    with pytest.raises(sc.SerdError, match=r"cut off after 5 decisions, got 3; sample 5 decisions"):
        fitted(3)
