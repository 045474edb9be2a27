"""Whether the data support what a model claims: eight checks between the fit and the headline.

| key | question | fails where |
| --- | --- | --- |
| joint_dynamics | do choices contradict the moves? | they do, and counts do not explain them |
| rollouts | does the policy arrive under counted dynamics? | less often, or at other times |
| ways | is there a way to the goal? | none from a start, or a quarter of the cells |
| arrival_times | do drives arrive as forecast, or as the model has the driver? | they do not |
| certainty | does the posterior know when half arrive? | in a tenth of the draws a quarter off |
| dwell_times | do moves take as long in all places? | the forecast may be a tenth off, or is
|  |  | of cells without moves |
| outcomes | do moves end as often as the posterior expects? | tail probability below 5 % |
| held_out_moves | are moves of left-out drives likelier than under simpler models? | they are not |

Simpler models of moves are the shortest way with counted dynamics, rewards learned under counted
dynamics by the same prior, and chance. Counted dynamics are draws of Dirichlet distributions around
the frequencies of all moves (Rubin, Annals of Statistics 12, 1984, for the tail probability). Fewer
than three drives support no claim but the counts.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from scipy.special import betaincinv, logsumexp, stdtrit

from serd_app.learning.dwell_places import check_dwell_times
from serd_app.learning.outcome import LearnedTraps
from serd_bag.quantities import counted, seconds_in_words
from serd_core.arrays import BoolArray, FloatArray, IntArray
from serd_core.arrival.arriving_policy import least_time_policy
from serd_core.arrival.chain import ArrivalByState, timed_arrival
from serd_core.arrival.law import SAME_TIME_S, ArrivalLaw, binomial_tail, steps_within
from serd_core.bayes.laplace import PosteriorDraws, laplace, laplace_draws, policies_under
from serd_core.demonstrations.decisions import TimedDecisions
from serd_core.dynamics.estimation import estimate_dynamics
from serd_core.errors import SerdError
from serd_core.grid.grid import Action
from serd_core.grid.navigation import WAITING, NavigationProblem
from serd_core.selection.evaluation import move_log_likelihood
from serd_core.selection.joint_dynamics import fit_under_counts
from serd_core.semi_markov.models import SemiMarkovModels, require_timed
from serd_files.model_file import Check
from serd_sim.drivers.strategy import MOST_DRAWS, STEP_S, Plan

#: Drives that a prediction takes.
FEWEST_DRIVES = 3
#: Shares between which nine in ten arrive.
BAND = 0.05, 0.95
#: Chance of a check to fail where the model is right.
LEVEL = 0.05
#: Largest share of cells without a way.
MOST_WITHOUT_A_WAY = 0.25
#: By which left-out moves must be less likely than under a simpler model for that to count.
FEWEST_NATS = 3.0
#: Pseudo-decisions of the frequencies of all moves in each counted model, and replicates.
_WORTH, _REPLICATES = 2.0, 400
_CHANCE = 0.01
#: Factor by which half of the drives may arrive earlier or later than by counts.
_MARGIN = 1.1
#: Factor by which they may do so in a draw of the posterior, and share of draws beyond it.
_FAR, _MOST_FAR = 1.25, 0.1
#: Groups of drives that are left out, one after another.
_GROUPS = 10


@dataclass(frozen=True, eq=False)
class Criticised:
    """What is tested.

    plan: what the robot would drive. decisions: what it was learned from, up to the goal; seen:
    those with known actions, where a hidden one that moved was for the cell it led to.
    fitted: the problem on which the method learned, and draws of what it learned, None where it
    has no posterior. policy: (S, A) the soft one of its point estimate. joint: the check of which
    dynamics were taken, None where they were not judged.
    """

    plan: Plan
    decisions: TimedDecisions
    seen: TimedDecisions
    fitted: NavigationProblem
    draws: PosteriorDraws | None
    policy: FloatArray
    traps: LearnedTraps
    joint: Check | None = None

    @cached_property
    def policies(self) -> FloatArray:
        """(n, S, A) soft policies of the draws, else that of the point estimate."""
        if self.draws is None:
            return self.policy[None]
        return _policies_of(self.fitted, self.draws)

    @property
    def demonstrator(self) -> FloatArray:
        """(S, A) the soft policy that the model has of who drove."""
        return np.asarray(self.policies.mean(axis=0))

    @property
    def problem(self) -> NavigationProblem:
        """The problem of the plan, whose decisions take time."""
        return self.plan.problem

    @property
    def starts(self) -> IntArray:
        """(E,) state in which each drive begins."""
        first = np.unique(self.decisions.episode, return_index=True)[1]
        return self.decisions.state[first]


def criticise(found: Criticised, rng: np.random.Generator) -> tuple[Check, ...]:
    """Make all checks; fewer than three drives give one, which states the counts."""
    n_drives = len(found.decisions.episodes)
    if n_drives < FEWEST_DRIVES:
        return (_counts_alone(found, n_drives),)
    try:
        dynamics = counted_dynamics(found, rng)
        checks = [
            *([] if found.joint is None else [found.joint]),
            _rollouts(found, dynamics),
            _ways(found),
            _arrival_times(found),
            _certainty(found),
            _outcomes(found, rng),
            check_dwell_times(
                found.plan, found.seen, found.starts, rng, level=LEVEL, margin=_MARGIN
            ),
            _held_out_moves(found),
        ]
    except SerdError as error:  # as of a law that does not fit into memory
        sentence = f"the data could not be tested: {error}"
        return (Check(key="checks", mark="unknown", sentence=sentence),)
    return tuple(checks)


def _counts_alone(found: Criticised, n_drives: int) -> Check:
    moves, succeeded = _intended(found)
    what = f"{counted(n_drives, 'drive')} support{'s' if n_drives == 1 else ''} no claim but counts"
    if not moves.any():
        return Check(key="counts", mark="fails", sentence=f"{what}, and no action was recorded")
    n, k = int(moves.sum()), int(succeeded[moves].sum())
    return Check(
        key="counts",
        mark="fails",
        sentence=f"{what}: {k} of {counted(n, 'move')} led to the cell they were for"
        f" ({interval_text(k, n)})",
    )


def interval_text(k: int, n: int) -> str:
    """Return the 90 % interval of a share by Jeffreys' prior, as text.

    >>> interval_text(14, 21)
    '49 to 81 %'
    """
    low, high = betaincinv(k + 0.5, n - k + 0.5, BAND)
    return f"{100 * low:.0f} to {100 * high:.0f} %"


def _intended(found: Criticised) -> tuple[BoolArray, BoolArray]:
    """(N,) whether a shown decision was a move with an outcome, and whether it led where meant."""
    decisions, grid = found.decisions, found.problem.grid
    moves = ~decisions.hidden & (decisions.censored == 0) & (decisions.action != Action.WAIT)
    aimed_at = grid.neighbours[decisions.state, np.maximum(decisions.action, 0)]
    moves &= aimed_at != decisions.state
    return moves, decisions.next_state == aimed_at


def outside_band(law: ArrivalLaw, times_s: FloatArray) -> BoolArray:
    """Whether times, inf without an arrival, are outside the central 90 %.

    An end of the band that is never reached is at infinity.
    """
    low_s, high_s = (law.quantile_s(share) for share in BAND)
    times = np.asarray(times_s, dtype=np.float64)
    below = times < (np.inf if low_s is None else low_s) - SAME_TIME_S
    above = times > (np.inf if high_s is None else high_s) + SAME_TIME_S
    return np.asarray(below | above)


@dataclass(frozen=True, eq=False)
class RecordedTimes:
    """When the recorded drives that reach the goal did so, since they began.

    times_s: (N,); outside: (N,) whether that is outside the band predicted from where they began.
    early, late: (N,) whether it is a tenth before or after half are predicted to arrive.
    """

    times_s: FloatArray
    outside: BoolArray
    early: BoolArray = field(default_factory=lambda: np.zeros(0, dtype=np.bool_))
    late: BoolArray = field(default_factory=lambda: np.zeros(0, dtype=np.bool_))

    @property
    def contradict(self) -> bool:
        """Whether more are outside the band, or on one side of its middle, than chance explains."""
        on_one_side = max(int(self.early.sum()), int(self.late.sum()))
        one_side = binomial_tail(on_one_side, len(self.early), 0.5)
        return too_many(self.outside) or one_side <= LEVEL / 2


def recorded_times(plan: Plan, decisions: TimedDecisions, reaching: IntArray) -> RecordedTimes:
    """The times of arrival of the recorded episodes that reach the goal, beside their prediction.

    decisions: up to the goal; reaching: (E,) numbers of these episodes, which arrive where their
    last decision ends.
    """
    return _times_beside(plan.law_of_cell, decisions, reaching)


def _times_beside(
    law_of: Callable[[int], ArrivalLaw], decisions: TimedDecisions, reaching: IntArray
) -> RecordedTimes:
    times_s, outside, early, late = [], [], [], []
    for episode in reaching:
        rows = np.flatnonzero(decisions.episode == episode)
        ends_s = decisions.time_s[rows[-1]] + decisions.dwell_s[rows[-1]]
        time_s = float(ends_s - decisions.time_s[rows[0]])
        law = law_of(int(decisions.state[rows[0]]))
        times_s.append(time_s)
        outside.append(bool(outside_band(law, np.array(time_s))))
        half_s = law.quantile_s(0.5) or np.inf
        early.append(time_s < half_s / _MARGIN)
        late.append(time_s > half_s * _MARGIN)
    return RecordedTimes(np.array(times_s), *np.array([outside, early, late], dtype=np.bool_))


def too_many(outside: BoolArray) -> bool:
    """Whether more times are outside the band than chance explains."""
    chance = 1.0 - BAND[1] + BAND[0]
    return binomial_tail(int(outside.sum()), len(outside), chance) <= LEVEL


def _arrival_times(found: Criticised) -> Check:
    decisions, goals = found.decisions, found.problem.goal_states
    arriving = np.unique(decisions.episode[np.isin(decisions.next_state, goals)])
    recorded = recorded_times(found.plan, decisions, arriving)
    outside, n = recorded.outside, len(recorded.outside)
    if not n:
        return Check(key="arrival_times", mark="fails", sentence="no recorded drive arrives")
    low_s, high_s = (seconds_in_words(float(each(recorded.times_s))) for each in (np.min, np.max))
    span = f"after {low_s}" if low_s == high_s else f"after {low_s} to {high_s}"
    sentence = (
        f"{_off(recorded)} of {counted(n, 'recorded drive')}, which arrived {span}, did so a tenth"
        f" before or after half are predicted to, {int((~outside).sum())} within the 90 % band of"
        " the forecast"
    )
    fails = recorded.contradict
    if fails:  # a soft expert takes longer than the robot, which the model may know
        beside = _times_of_demonstrator(found, arriving)
        fails = beside.contradict
        sentence += (
            f"; for a driver as the model has it {_off(beside)} and {int((~beside.outside).sum())}"
        )
    return Check(key="arrival_times", mark="fails" if fails else "holds", sentence=sentence)


def _off(recorded: RecordedTimes) -> str:
    """How many are early and how many late, as text."""
    return f"{int(recorded.early.sum())} and {int(recorded.late.sum())}"


def _times_of_demonstrator(found: Criticised, arriving: IntArray) -> RecordedTimes:
    """The recorded times beside those of the soft policy that the model has of who drove."""
    plan = found.plan
    arrival = ArrivalByState.average(
        timed_arrival(plan.problem, found.demonstrator, each, STEP_S, plan.n_steps)
        for each in plan.draws[:MOST_DRAWS]
    )

    def law_of(state: int) -> ArrivalLaw:
        times_s = np.asarray(STEP_S * np.arange(plan.n_steps + 1), dtype=np.float64)
        return ArrivalLaw(times_s, arrival.cdf[:, state], float(arrival.arrival_probability[state]))

    return _times_beside(law_of, found.decisions, arriving)


def _held_out_moves(found: Criticised) -> Check:
    """The difference to each simpler model, summed by drive, with its 90 % interval."""
    key = "held_out_moves"
    if found.draws is None:
        sentence = "moves of left-out drives are not tested: the method has no posterior"
        return Check(key=key, mark="unknown", sentence=sentence)
    try:
        table = _by_drive(found, found.draws)
    except SerdError as error:
        return Check(
            key=key, mark="unknown", sentence=f"left-out drives could not be tested: {error}"
        )
    n_moves = table[-1].sum()
    texts, fails = [], False
    for name, simpler in zip(
        ("the shortest way", "rewards alone", "chance"), table[1:], strict=False
    ):
        mean, half = _mean_with_half_width(table[0] - simpler, n_moves)
        fails |= mean + half < 0 and mean * n_moves < -FEWEST_NATS
        fails |= name == "chance" and mean <= 0
        texts.append(f"{mean:+.2f} ± {half:.2f} against {name}")
    return Check(
        key=key,
        mark="fails" if fails else "holds",
        sentence=f"log-likelihood of {n_moves:.0f} moves of left-out drives, per move:"
        f" {', '.join(texts)}",
    )


def _mean_with_half_width(difference: FloatArray, n_moves: float) -> tuple[float, float]:
    """Return the mean per move of differences summed by drive, and half its 90 % interval."""
    n = len(difference)
    spread = float(difference.std(ddof=1)) * np.sqrt(n) if n > 1 else np.inf
    return float(difference.sum() / n_moves), float(stdtrit(n - 1, BAND[1]) * spread / n_moves)


def _by_drive(found: Criticised, draws: PosteriorDraws) -> FloatArray:
    """(5, E) of each drive: sums of log-likelihoods by the model, the shortest way, rewards alone
    and chance, each without the group of the drive, and the number of moves."""
    problem, decisions = found.problem, found.decisions.with_hidden_actions()
    episodes, drive = np.unique(decisions.episode, return_inverse=True)
    group, known = drive % min(_GROUPS, len(episodes)), decisions.censored == 0
    seen_group = np.searchsorted(episodes, found.seen.episode) % min(_GROUPS, len(episodes))
    scores = np.zeros((3, len(decisions)))
    scores[0] = _of_posterior(found, draws, group)
    alone = _RewardsAlone.of(found)
    for number in np.unique(group[known]):
        rows = np.flatnonzero((group == number) & known)
        counts, moves = found.seen.select(seen_group != number), decisions.select(rows)
        model = require_timed(problem.mdp.transitions)
        table = model.outcomes.local_probabilities(estimate_dynamics(problem, counts))
        policies = _shortest_way(problem, counts, table), alone.without(seen_group == number)
        for row, policy in enumerate(policies, start=1):
            scores[row, rows] = move_log_likelihood(problem.by_decisions, moves, policy, table)
        if not np.ptp(draws.truth, axis=0).any():  # dynamics that are counted leave moves out here
            policy = found.demonstrator
            scores[0, rows] = move_log_likelihood(problem.by_decisions, moves, policy, table)
    mixed = [_mixed(each, problem, decisions) for each in scores]
    every = np.stack([*mixed, _chance(problem, decisions), np.ones(len(decisions))])[:, known]
    return np.stack([np.bincount(drive[known], weights=each) for each in every])


def _policies_of(problem: NavigationProblem, draws: PosteriorDraws) -> FloatArray:
    """(n, S, A) soft policies of draws."""
    tables = draws.believed_outcome_probabilities
    return np.stack(list(policies_under(problem, draws.reward, tables)))


def _of_posterior(found: Criticised, draws: PosteriorDraws, group: IntArray) -> FloatArray:
    """(N,) log-likelihood of each move under the posterior without the drives of its group."""
    fitted, models = found.fitted, found.fitted.outcome_models
    by_decisions = fitted
    if isinstance(fitted.mdp.transitions, SemiMarkovModels):
        by_decisions = fitted.by_decisions
    hidden = found.decisions.with_hidden_actions()
    seen, moves = list[FloatArray](), list[FloatArray]()
    for policy, truth in zip(found.policies, draws.truth, strict=True):
        table = models.local_probabilities(truth[: models.n_energies])
        for scores, of in ((seen, found.decisions), (moves, hidden)):
            scores.append(move_log_likelihood(by_decisions, of, policy, table))
    log_weights = _without_group(np.array(seen), group)
    return np.asarray(logsumexp(np.array(moves) + log_weights[:, group], axis=0))


def _without_group(scores: FloatArray, group: IntArray) -> FloatArray:
    """(n, G) logs of the weights by which n draws are of the posterior without a group.

    scores: (n, N) log-likelihood of each decision under each draw. A draw of the whole posterior is
    worth the inverse of the likelihood of what is left out (Gelfand, Dey and Chang 1992), but no
    more than root n times the mean (Ionides, J. Comp. Graph. Stat. 17, 2008).
    """
    left_out = np.stack([np.bincount(group, weights=row) for row in scores])
    weights = -left_out - logsumexp(-left_out, axis=0)
    weights = np.minimum(weights, -0.5 * np.log(len(scores)))
    return np.asarray(weights - logsumexp(weights, axis=0))


@dataclass(frozen=True, eq=False)
class _RewardsAlone:
    """Rewards under counted dynamics: (n, S, A) policies of their posterior, and (n, N)
    log-likelihoods of the shown choices."""

    policies: FloatArray
    scores: FloatArray

    @classmethod
    def of(cls, found: Criticised) -> "_RewardsAlone":
        """Learn from all drives, by a prior by evidence as the model has it."""
        problem, seen = found.problem, found.seen
        posterior = laplace(problem, seen, fit_under_counts(problem, seen))
        draws = laplace_draws(posterior, np.random.default_rng(0))
        policies = _policies_of(problem, draws)
        return cls(policies, np.log(policies[:, seen.state, seen.action]))

    def without(self, left_out: BoolArray) -> FloatArray:
        """(S, A) policy of the posterior without some of the choices."""
        weights = np.exp(_without_group(self.scores, left_out.astype(np.int64))[:, 1])
        return np.asarray(np.einsum("d,dsa->sa", weights, self.policies))


def _chance(problem: NavigationProblem, moves: TimedDecisions) -> FloatArray:
    """(N,) log-likelihood where each of the cells around and the own one is equally likely."""
    around = problem.grid.neighbours[moves.state]
    same = (around == moves.next_state[:, None]).sum(axis=1)
    with np.errstate(divide="ignore"):
        return np.asarray(np.log(same / around.shape[1]))


def _mixed(scores: FloatArray, problem: NavigationProblem, moves: TimedDecisions) -> FloatArray:
    """(N,) log-likelihoods of a model that is chance once in a hundred: none is infinite."""
    return np.asarray(
        np.logaddexp(np.log1p(-_CHANCE) + scores, np.log(_CHANCE) + _chance(problem, moves))
    )


def _shortest_way(
    problem: NavigationProblem, counts: TimedDecisions, table: FloatArray
) -> FloatArray:
    """(S, A) the way of least time under counted dynamics, as often as the drives take it."""
    model = require_timed(problem.mdp.transitions)
    seconds = model.expected_seconds(estimate_dynamics(problem, counts))
    best = least_time_policy(problem, table, seconds).probabilities
    taken = best[counts.state, counts.action] > 0
    share = (taken.sum() + 1.0) / (len(taken) + 2.0)
    available = problem.outcome_models.available
    return np.asarray(
        share * best + (1.0 - share) * available / available.sum(axis=1, keepdims=True)
    )


def _outcomes(found: Criticised, rng: np.random.Generator) -> Check:
    """The tail probability of the counts by posterior prediction, of the worst model."""
    moves, succeeded = _intended(found)
    if not moves.any():
        return Check(
            key="outcomes", mark="unknown", sentence="outcomes are not tested: actions are hidden"
        )
    models, decisions = found.problem.outcome_models, found.decisions
    of_model = models.model_of[decisions.state, np.maximum(decisions.action, 0)]
    worst = None
    used = np.unique(of_model[moves])
    for m in used.tolist():
        rows = np.flatnonzero(moves & (of_model == m))
        n, k = len(rows), int(succeeded[rows].sum())
        expected = _expected_successes(found, rows)  # (draws, n)
        drawn = expected[rng.integers(len(expected), size=_REPLICATES)]
        replicates = (rng.random(drawn.shape) < drawn).sum(axis=1)
        tail = min((replicates <= k).mean(), (replicates >= k).mean())
        tail = min(1.0, 2.0 * float(tail) * len(used))
        if worst is None or tail < worst[0]:
            low, high = np.quantile(drawn.mean(axis=1), BAND)
            worst = tail, m, n, k, low, high
    assert worst is not None
    tail, m, n, k, low, high = worst
    name = found.problem.model_names[m].replace("_", " ")
    return Check(
        key="outcomes",
        mark="fails" if tail < LEVEL else "holds",
        sentence=f"{k} of {counted(n, 'move')} {name} led to the cell they were for"
        f" ({interval_text(k, n)}), where the model expects {100 * low:.0f} to {100 * high:.0f} %"
        f" (tail probability {tail:.2f})",
    )


def _expected_successes(found: Criticised, rows: IntArray) -> FloatArray:
    """(draws, n) probability that a move leads to the cell that it is for."""
    decisions, models = found.decisions, found.problem.outcome_models
    state, action = decisions.state[rows], decisions.action[rows]
    aimed_at = found.problem.grid.neighbours[state, action]
    leads = models.successors[state, action] == aimed_at[:, None]
    model = require_timed(found.problem.mdp.transitions)
    tables = model.outcomes.local_probabilities(found.plan.draws)
    return np.asarray((tables[:, models.model_of[state, action]] * leads).sum(axis=2))


def counted_dynamics(found: Criticised, rng: np.random.Generator) -> FloatArray:
    """(n, N) draws of the dynamics that counts alone give, with counted dwell times."""
    problem, model = found.problem, require_timed(found.problem.mdp.transitions)
    seen = found.seen
    counted_once = estimate_dynamics(problem, seen, 0.1)
    table = model.outcomes.local_probabilities(counted_once)
    with_outcome = seen.select(seen.censored == 0)
    of_model = problem.outcome_models.model_of[with_outcome.state, with_outcome.action]
    n = np.bincount(of_model, minlength=len(table)).astype(np.float64)
    moves = np.arange(len(table)) != WAITING
    counts = table * n[:, None]
    pooled = counts[moves].sum(axis=0) + 1.0 / table.shape[1]
    base = np.where(moves[:, None], pooled / pooled.sum(), 1.0 / table.shape[1])
    means, shapes = np.exp(counted_once[model.means]), np.exp(counted_once[model.shapes])
    drawn = np.maximum([rng.dirichlet(row, MOST_DRAWS) for row in counts + _WORTH * base], 1e-9)
    tables = (drawn / drawn.sum(axis=2, keepdims=True)).swapaxes(0, 1)
    return np.stack([model.parameters_from(table, means, shapes) for table in tables])


def _rollouts(found: Criticised, dynamics: FloatArray) -> Check:
    """The arrival of the driven policy under counted dynamics, beside that of its own."""
    plan, starts = found.plan, found.starts
    n_steps = steps_within(plan.timeout_s, STEP_S)
    own = plan.arrival_of_draws(plan.policy)
    policy = plan.policy.probabilities
    under = [timed_arrival(found.problem, policy, each, STEP_S, n_steps) for each in dynamics]
    claimed, counts = (_arriving(each, starts) for each in (own, under))
    disagree = np.quantile(counts, BAND[1]) < np.quantile(claimed, BAND[0]) - 0.01
    halves = np.array([_median_s([each], starts) for each in under])
    half_s, low_s = _median_s(own, starts), float(np.quantile(halves, BAND[0], method="lower"))
    high_s = float(np.quantile(halves, BAND[1], method="higher"))
    early_or_late = not low_s / _MARGIN - STEP_S <= half_s <= high_s * _MARGIN + STEP_S
    fails = disagree or early_or_late or counts.mean() < 0.5 <= claimed.mean()
    low, high = np.quantile(counts, BAND)
    return Check(
        key="rollouts",
        mark="fails" if fails else "holds",
        sentence=f"under counted dynamics the learned policy arrives in {100 * counts.mean():.0f} %"
        f" ({100 * low:.0f} to {100 * high:.0f} %) of drives within"
        f" {seconds_in_words(plan.timeout_s)}{_half_text(_median_s(under, starts))}; the model says"
        f" {100 * claimed.mean():.0f} %{_half_text(half_s)}",
    )


def _certainty(found: Criticised) -> Check:
    """When half of the drives arrive in each draw of the posterior, beside their average."""
    own, key = found.plan.arrival_of_draws(found.plan.policy), "certainty"
    if len(own) == 1:
        sentence = "how certain the forecast is, is not known: the method has no posterior"
        return Check(key=key, mark="unknown", sentence=sentence)
    each_s = np.array([_median_s([each], found.starts) for each in own])
    half_s = _median_s(own, found.starts)
    near = (each_s <= _FAR * half_s) & (half_s <= _FAR * each_s) | (each_s == half_s)
    n_far, arriving_s = int(np.sum(~near)), each_s[np.isfinite(each_s)]
    span = "never"
    if len(arriving_s):
        low_s, high_s = (seconds_in_words(float(of(arriving_s))) for of in (np.min, np.max))
        span = f"by {low_s} to {high_s}" + " or never" * (len(arriving_s) < len(each_s))
    return Check(
        key=key,
        mark="fails" if n_far > _MOST_FAR * len(each_s) else "holds",
        sentence=f"in {len(each_s)} draws of the posterior half of the drives arrive {span};"
        f" {n_far} of these times are a quarter or more off the forecast",
    )


def _half_text(half_s: float) -> str:
    return f", half of them by {seconds_in_words(half_s)}" if np.isfinite(half_s) else ""


def _arriving(arrivals: Sequence[ArrivalByState], starts: IntArray) -> FloatArray:
    """(n,) share of drives from the starts that arrive until the time-out."""
    return np.array([each.cdf[-1, starts].mean() for each in arrivals])


def _median_s(arrivals: Sequence[ArrivalByState], starts: IntArray) -> float:
    cdf = np.mean([each.cdf[:, starts].mean(axis=1) for each in arrivals], axis=0)
    reached = np.flatnonzero(cdf >= 0.5)
    return float(STEP_S * reached[0]) if len(reached) else float("inf")


def _ways(found: Criticised) -> Check:
    traps = found.traps
    without, starts = traps.n_looping_cells, traps.n_looping_starts
    fails = starts > 0 or without > MOST_WITHOUT_A_WAY * traps.n_reaching_cells
    return Check(
        key="ways",
        mark="fails" if fails else "holds",
        sentence=f"the learned policy has no way to the goal from {without} of"
        f" {traps.n_reaching_cells} cells, among them {starts} of {traps.n_starts} where drives"
        " begin",
    )
