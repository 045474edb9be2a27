"""Checks between fit and headline: they hold where the model is right, and fail where it is not."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.special import logsumexp
from scipy.stats import beta, binom

from serd_app.learning.criticism import (
    Criticised,
    _of_posterior,
    counted_dynamics,
    criticise,
    interval_text,
)
from serd_app.learning.outcome import learned_traps
from serd_app.learning.recipe import learn, plan_of
from serd_app.learning.settings import LearningSettings
from serd_core.bayes.laplace import laplace, laplace_draws
from serd_core.dynamics.estimation import estimate_dynamics
from serd_core.learners.serd import fit_mdce_serd
from serd_core.policies.solved_policy import optimal_policy, soft_policy
from serd_core.selection.evaluation import move_log_likelihood
from serd_core.semi_markov.models import require_timed
from serd_sim.drivers.strategy import Plan
from tests.serd_app.learning.test_durations import (
    MODEL,
    PROBLEM,
    TABLE,
    TASK,
    TRUTH,
    WEIGHTS,
    demonstrations,
)

KEYS = {
    "joint_dynamics",
    "rollouts",
    "ways",
    "arrival_times",
    "certainty",
    "outcomes",
    "dwell_times",
    "held_out_moves",
}
DRIVES = demonstrations(12)


def criticised(truth, decisions=DRIVES, weights=WEIGHTS, **changes):
    """A plan under (n, N) draws of the dynamics, tested on drives of the true ones."""
    tables = require_timed(PROBLEM.mdp.transitions).local_probabilities(truth)
    learned = optimal_policy(PROBLEM, weights, tables.mean(axis=0))
    plan = Plan(problem=PROBLEM, learned=learned, draws=truth, timeout_s=120.0)
    expert = soft_policy(PROBLEM, weights, tables.mean(axis=0)).probabilities
    traps = learned_traps(PROBLEM, decisions, weights, truth)
    found = Criticised(plan, decisions, decisions, PROBLEM, None, expert, traps)
    return replace(found, **changes)


def marks(found):
    return {each.key: each.mark for each in criticise(found, np.random.default_rng(3))}


def table_with(forward):
    """Dynamics whose moves lead where they are for with a probability, else stay."""
    table = TABLE.copy()
    table[:3] = [1.0 - forward - 0.06, forward, 0.02, 0.02, 0.02]
    return MODEL.parameters_from(table, [1.0, 2.5, 1.4], 5.0)[None]


def test_all_checks_of_a_right_model_hold_and_its_file_carries_them():
    outcome = learn(TASK, demonstrations(20), LearningSettings(discount=0.97))
    checks = outcome.model.checks
    assert {each.key for each in checks} == KEYS
    assert {each.mark for each in checks} == {"holds"}, checks
    assert all("\n" not in each.sentence for each in checks)


def test_choices_that_contradict_the_moves_leave_dynamics_to_the_counts():
    swapped = TABLE.copy()
    swapped[[0, 1]] = swapped[0, [0, 4, 2, 3, 1]], np.roll(swapped[1], 2)
    believed = MODEL.parameters_from(swapped, [1.0, 2.5, 1.4], 5.0)
    drives = demonstrations(20, believed=believed)
    outcome = learn(TASK, drives, LearningSettings(discount=0.97))
    (check,) = (each for each in outcome.model.checks if each.key == "joint_dynamics")
    assert check.sentence.startswith(("dynamics are counted", "no reward is claimed"))
    assert check.mark == ("holds" if check.sentence.startswith("dynamics") else "fails")
    assert "counted from the moves alone" in outcome.model.prior
    counts = estimate_dynamics(PROBLEM, drives)
    table = MODEL.outcomes.local_probabilities(counts[: MODEL.outcomes.n_energies])
    np.testing.assert_allclose(outcome.model.outcome_probabilities, table, atol=0.1)
    shown = np.array([row.counted for row in outcome.both]).reshape(table.shape)
    used = PROBLEM.outcome_models.model_of[drives.state, drives.action]
    well_known = np.bincount(used, minlength=len(table)) >= 20
    np.testing.assert_allclose(shown[well_known], table[well_known], atol=0.1)
    assert all(row.joint_lower < row.joint < row.joint_upper for row in outcome.both)
    known = outcome.knowledge  # of moves and choices apart
    assert known is not None
    assert {row.known_from for row in known.outcomes} <= {"counts", "prior only"}
    assert known.weights[0].known_from == "choices"
    assert np.isfinite([row.lower for row in known.weights]).all()
    assert known.gain_nats.max() > 0.0
    # What moves leave open stays open.
    assert np.std(outcome.model.draws.learned, axis=0)[0].max() > 0.0


def test_fewer_than_three_drives_support_the_counts_alone():
    one = demonstrations(1)
    (check,) = learn(TASK, one, LearningSettings(discount=0.97, minimum_decisions=1)).model.checks
    moves = (one.censored == 0) & (one.action != 0)
    aimed_at = PROBLEM.grid.neighbours[one.state, one.action]
    moves &= aimed_at != one.state
    n, k = int(moves.sum()), int((aimed_at == one.next_state)[moves].sum())
    assert (check.key, check.mark) == ("counts", "fails")
    assert (
        f"{k} of {n} moves led to the cell they were for ({interval_text(k, n)})" in check.sentence
    )
    low, high = beta.ppf([0.05, 0.95], k + 0.5, n - k + 0.5)
    assert interval_text(k, n) == f"{100 * low:.0f} to {100 * high:.0f} %"


@pytest.mark.parametrize(("forward", "mark"), [(0.9, "holds"), (0.35, "fails")])
def test_counts_that_the_posterior_does_not_expect_fail(forward, mark):
    found = criticised(table_with(forward))
    outcomes = next(
        each for each in criticise(found, np.random.default_rng(3)) if each.key == "outcomes"
    )
    # The same tail for one draw in closed form, of the worst of the models.
    assert outcomes.mark == mark
    decisions = found.decisions
    of_model = PROBLEM.outcome_models.model_of[decisions.state, decisions.action]
    aimed_at = PROBLEM.grid.neighbours[decisions.state, decisions.action]
    moves = (decisions.censored == 0) & (decisions.action != 0) & (aimed_at != decisions.state)
    tails = []
    for m in np.unique(of_model[moves]):
        rows = moves & (of_model == m)
        law = binom(rows.sum(), forward)  # away from walls
        k = (decisions.next_state == aimed_at)[rows].sum()
        tails.append(min(1.0, 2 * len(np.unique(of_model[moves])) * min(law.cdf(k), law.sf(k - 1))))
    stated = float(outcomes.sentence.rsplit("probability ", 1)[1].rstrip(")"))
    assert stated == pytest.approx(min(tails), abs=0.1)


def test_a_claim_to_arrive_fails_where_counted_moves_do_not_lead_there():
    still = replace(DRIVES, next_state=DRIVES.state)  # nothing that was tried led anywhere
    assert marks(criticised(TRUTH[None]))["rollouts"] == "holds"
    found = marks(criticised(TRUTH[None], decisions=still))
    assert (found["rollouts"], found["arrival_times"]) == ("fails", "fails")


@pytest.mark.parametrize(("late", "mark"), [(0, "holds"), (1, "holds"), (2, "fails")])
def test_a_forecast_of_which_draws_are_far_off_is_not_certain(late, mark):
    laws = np.repeat(TRUTH[None], 12, axis=0)
    laws[:late, MODEL.means] += np.log(1.5)
    assert marks(criticised(laws))["certainty"] == mark
    assert marks(criticised(TRUTH[None]))["certainty"] == "unknown"


def test_a_policy_that_shuns_the_goal_has_no_way_and_its_forecast_no_recorded_times():
    found = marks(criticised(TRUTH[None], weights=np.array([-3.0, 0.0, 0.0])))
    assert found["ways"] == "fails"
    slow = replace(DRIVES, dwell_s=10 * DRIVES.dwell_s, time_s=10 * DRIVES.time_s)
    found = marks(criticised(TRUTH[None], decisions=slow))
    assert found["arrival_times"] == "fails"


@pytest.fixture(scope="module")
def fitted():
    """A fit to all drives, and draws of its posterior."""
    fit = fit_mdce_serd(PROBLEM, DRIVES)
    return fit, laplace_draws(laplace(PROBLEM, DRIVES, fit), np.random.default_rng(1), 64)


def left_out(found):
    (check,) = (
        each for each in criticise(found, np.random.default_rng(3)) if each.key == "held_out_moves"
    )
    return check


def test_moves_are_predicted_as_by_fits_without_their_drives(fitted):
    scores = np.zeros(len(DRIVES))
    for number in range(6):
        out = DRIVES.episode % 6 == number
        fit = fit_mdce_serd(PROBLEM, DRIVES.select(~out))
        found = laplace(PROBLEM, DRIVES.select(~out), fit)
        draws = laplace_draws(found, np.random.default_rng(2), 64)
        moves = DRIVES.select(out).with_hidden_actions()
        each = [
            move_log_likelihood(
                PROBLEM.by_decisions,
                moves,
                soft_policy(PROBLEM, weights, believed).probabilities,
                MODEL.outcomes.local_probabilities(truth[: MODEL.means.start]),
            )
            for weights, believed, truth in zip(
                draws.reward, draws.believed_outcome_probabilities, draws.truth, strict=True
            )
        ]
        scores[out] = logsumexp(each, axis=0) - np.log(len(each))
    found = criticised(TRUTH[None], draws=fitted[1])
    again = _of_posterior(found, fitted[1], DRIVES.episode % 6)
    assert again.sum() == pytest.approx(scores.sum(), rel=0.04)
    by_group = [np.bincount(DRIVES.episode % 6, weights=each) for each in (again, scores)]
    np.testing.assert_allclose(*by_group, rtol=0.15)


def test_moves_that_a_model_makes_unlikely_fail_against_chance(fitted):
    draws = fitted[1]
    assert left_out(criticised(TRUTH[None], draws=draws)).mark == "holds"
    shuns = replace(draws, reward=np.tile([-6.0, 0.0, 0.0], (len(draws), 1)))
    assert left_out(criticised(TRUTH[None], draws=shuns)).mark == "fails"
    assert left_out(criticised(TRUTH[None])).mark == "unknown"


def test_counted_dynamics_are_the_frequencies_of_many_moves():
    found = criticised(TRUTH[None], decisions=demonstrations(300, seed=5))
    drawn = counted_dynamics(found, np.random.default_rng(0))
    tables = MODEL.outcomes.local_probabilities(drawn)
    np.testing.assert_allclose(tables.mean(axis=0)[0], TABLE[0], atol=0.03)
    assert (
        plan_of(
            PROBLEM,
            learn(TASK, DRIVES, LearningSettings(discount=0.97)).fit,
            drawn,
            60.0,
        ).timeout_s
        == 60.0
    )
