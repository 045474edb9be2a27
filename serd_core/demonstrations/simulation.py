"""Sample demonstrations from a policy, and see decisions as trajectories tau with their features.

    phi(tau) = sum_t gamma^t f(s_t, a_t)

Time counts in decisions from the first of each trajectory: an episode, or where decisions of it
are missing each piece in between (`serd_core.demonstrations.decisions.rows_by_trajectory`).
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from serd_core.arrays import FloatArray, IntArray, weighted_counts
from serd_core.checks import float_array, require_count, require_generator, require_kind
from serd_core.demonstrations.decisions import (
    TIMED_COLUMNS,
    Decisions,
    TimedDecisions,
    require_shown,
    rows_by_trajectory,
)
from serd_core.dynamics.transition_model import Transitions, transitions_of
from serd_core.errors import SerdError
from serd_core.mdp.mdp import Mdp, checked_distribution, checked_policy
from serd_core.mdp.problem import Problem
from serd_core.policies.solved_policy import Policy
from serd_core.semi_markov.models import require_timed


def sample_decisions(
    mdp: Mdp,
    policy: Policy | FloatArray,
    outcome_probabilities: FloatArray | None = None,
    start_distribution: FloatArray | None = None,
    *,
    n_episodes: int,
    n_steps: int,
    rng: np.random.Generator,
    source: str = "sampled",
) -> Decisions:
    """Draw episodes of a policy in an MDP, which end in a final state or after `n_steps`.

    policy: what `soft_policy` returns, or (S, A); outcome_probabilities: (M, K), None for
    transitions without parameters. start_distribution: (S,); None for a uniform one over the states
    that are not final. Time counts in decisions. Episodes that start in a final state have none.

        decisions = sc.sample_decisions(
            problem.mdp, policy, table, n_episodes=20, n_steps=50, rng=rng)
    """
    require_kind("mdp", mdp, (Mdp,), "problem.mdp")
    require_count("n_episodes", n_episodes, 1, "100")
    require_count("n_steps", n_steps, 1, "50")
    require_generator(rng)
    choice = checked_policy("policy", policy, mdp)
    if start_distribution is None:
        if mdp.final.all():
            raise SerdError(
                f"mdp must have a state that is not final to start in, got {mdp.n_states} final"
                " ones; give one of them a transition that leaves it"
            )
        start_distribution = np.where(mdp.final, 0.0, 1.0 / np.sum(~mdp.final))
    starts = checked_distribution("start_distribution", start_distribution, mdp.n_states)
    transitions = transitions_of(mdp.transitions, outcome_probabilities)
    cumulative = np.cumsum(starts)
    level = rng.random(n_episodes) * cumulative[-1]
    state = np.searchsorted(cumulative, level, side="right")
    moving = np.flatnonzero(~mdp.final[state])
    rows: list[tuple[IntArray, ...]] = [(np.zeros(0, dtype=np.int64),) * 5]
    for step in range(n_steps):
        if not moving.size:
            break
        present = state[moving]
        action = _draw(choice[present], rng)
        following = _successors(transitions, present * mdp.n_actions + action, rng)
        rows.append((moving, np.full(len(moving), step), present, action, following))
        state[moving] = following
        moving = moving[~mdp.final[following]]
    columns: list[Any] = [np.concatenate(column) for column in zip(*rows, strict=True)]
    order = np.lexsort((columns[1], columns[0]))
    episode, time_s, present, action, following = (column[order] for column in columns)
    return Decisions(episode, time_s, present, action, following, source)


def _draw(probabilities: FloatArray, rng: np.random.Generator) -> IntArray:
    """One index per row of a table of probabilities."""
    cumulative = np.cumsum(probabilities, axis=1)
    level = rng.random(len(cumulative)) * cumulative[:, -1]
    return np.asarray(np.sum(cumulative <= level[:, None], axis=1), dtype=np.int64)


def _successors(transitions: Transitions, row: IntArray, rng: np.random.Generator) -> IntArray:
    model = transitions.model
    length = model.row_length.ravel()[row]
    last = np.cumsum(length)
    first = last - length
    entry = np.repeat(model.row_start[row] - first, length) + np.arange(last[-1])
    probabilities = transitions.entries[entry]
    cumulative = np.concatenate([[0.0], np.cumsum(probabilities)])
    level = cumulative[first] + rng.random(len(row)) * (cumulative[last] - cumulative[first])
    place = np.searchsorted(cumulative, level, side="right") - 1
    return np.asarray(model.successor[entry[np.clip(place, first, last - 1)]])


#: Shortest dwell time (s).
SHORTEST_S = 1e-6


def sample_timed_decisions(
    mdp: Mdp,
    policy: Policy | FloatArray,
    parameters: FloatArray,
    start_distribution: FloatArray,
    *,
    n_episodes: int,
    n_steps: int,
    rng: np.random.Generator,
    mean_until_command_s: float = np.inf,
    source: str = "sampled",
) -> TimedDecisions:
    """Draw episodes of a policy whose moves take time, which end as those of `sample_decisions`.

    policy: (S, A); parameters: (N,) of the dynamics, as `parameters_from` below makes them;
    start_distribution: (S,). mean_until_command_s: mean of the exponential time after which another
    command ends a decision without outcome, and the policy decides anew there; inf for never.

        truth = timed.mdp.transitions.parameters_from(table, mean_s=[1.0, 3.0], shape=6.0)
        table = timed.mdp.transitions.local_probabilities(truth)
        policy = sc.soft_policy(timed, weights, table).probabilities
        decisions = sc.sample_timed_decisions(
            timed.mdp, policy, truth, starts, n_episodes=10, n_steps=99, rng=rng)
    """
    require_kind("mdp", mdp, (Mdp,), "problem.mdp")
    require_count("n_episodes", n_episodes, 1, "100")
    require_count("n_steps", n_steps, 1, "50")
    require_generator(rng)
    model = require_timed(mdp.transitions)
    choice = checked_policy("policy", policy, mdp)
    starts = checked_distribution("start_distribution", start_distribution, mdp.n_states)
    laws = model.laws(float_array("parameters", parameters, (model.n_parameters,)))
    given = np.isinf(laws.shape)
    rows: list[tuple[Any, ...]] = []
    for episode in range(n_episodes):
        state, now = int(rng.choice(mdp.n_states, p=starts)), 0.0
        for _ in range(n_steps):
            if mdp.final[state]:
                break
            action = int(rng.choice(mdp.n_actions, p=choice[state] / choice[state].sum()))
            row = model.model_of[state, action]
            outcome = int(rng.choice(model.n_outcomes, p=laws.probability[row]))
            dwell = mean_s = laws.mean_s[row, outcome]
            if not given[row, outcome]:
                shape = laws.shape[row, outcome]
                dwell = max(float(rng.gamma(shape, mean_s / shape)), SHORTEST_S)
            until = dwell
            if np.isfinite(mean_until_command_s):
                until = max(float(rng.exponential(mean_until_command_s)), SHORTEST_S)
            censored, lasted = until < dwell, min(until, dwell)
            following = state if censored else int(model.successors[state, action, outcome])
            rows.append((episode, now, state, action, following, lasted, censored))
            state, now = following, now + lasted
    table = list(zip(*rows, strict=True)) or [()] * len(TIMED_COLUMNS)
    columns: dict[str, Any] = dict(zip(TIMED_COLUMNS, map(np.array, table), strict=True))
    return TimedDecisions(**columns, source=source)


@dataclass(frozen=True, eq=False)
class Trajectories:
    """N trajectories, in the order of their episodes and times.

    of_decision, step: (n,) index of the trajectory and time step of each decision.
    episode: (N,) number of the episode each is (a piece) of.
    start, end: (N,) first state and state after the last decision; length: (N,) decisions.
    """

    of_decision: IntArray
    step: IntArray
    episode: IntArray
    start: IntArray
    end: IntArray
    length: IntArray

    def __len__(self) -> int:
        return len(self.start)


def trajectories_of(decisions: Decisions) -> Trajectories:
    """Decisions in the order of their times, split into episodes and where some are missing."""
    rows, begins = rows_by_trajectory(decisions)
    first = np.flatnonzero(begins)
    length = np.diff(np.append(first, len(rows)))
    of_decision, step = np.empty((2, len(rows)), dtype=np.int64)
    of_decision[rows] = np.cumsum(begins) - 1
    step[rows] = np.arange(len(rows)) - np.repeat(first, length)
    return Trajectories(
        of_decision=of_decision,
        step=step,
        episode=decisions.episode[rows[first]],
        start=decisions.state[rows[first]],
        end=decisions.next_state[rows[first + length - 1]],
        length=length.astype(np.int64),
    )


def absorption_features(problem: Problem) -> FloatArray:
    """(S, F) what a final state (`Mdp.final`) collects forever: f / (1 - gamma)."""
    mdp = problem.mdp
    only_action = mdp.available.argmax(axis=1)
    forever = problem.features[np.arange(mdp.n_states), only_action] / (1.0 - mdp.discount)
    return np.asarray(forever * mdp.final[:, None])


def cut_off_ends(problem: Problem, decisions: Decisions) -> FloatArray:
    """(S,) mean over trajectories of gamma^T at the state after their T decisions, where it is no
    final state: where trajectories were cut off."""
    mdp, episodes = problem.mdp, trajectories_of(decisions)
    weight = mdp.discount ** episodes.length.astype(np.float64) / len(episodes)
    return np.where(mdp.final, 0.0, weighted_counts(episodes.end, weight, mdp.n_states))


def feature_counts(problem: Problem, decisions: Decisions) -> FloatArray:
    """(N, F) phi of each trajectory, with what follows where it ended in a final state."""
    require_shown(decisions, "features of trajectories")
    episodes, discount = trajectories_of(decisions), problem.mdp.discount
    weight = discount ** episodes.step.astype(np.float64)
    observed = problem.features[decisions.state, decisions.action] * weight[:, None]
    counts = np.zeros((len(episodes), observed.shape[1]))
    np.add.at(counts, episodes.of_decision, observed)
    reached = discount ** episodes.length.astype(np.float64)
    return np.asarray(counts + absorption_features(problem)[episodes.end] * reached[:, None])
