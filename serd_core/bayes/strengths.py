"""MDCE SERD with the prior whose strengths the evidence chooses: the default of `fit_mdce_serd`.

    w_f ~ Normal(0, (sigma / range of f)^2),      P_m ~ Dirichlet(c, ..., c rho, ..., c)

sigma, c and, where models have an intended outcome, the ratio rho of its pseudo-count to the others
maximise log P(D | strengths) plus the log of a wide log-normal density of each (MacKay 1992),
without which few decisions would drive strengths to infinity. By rho, a model that no decision
shows is expected to have the outcome that it intends about as often as the models that were seen; 1
is the symmetric prior.
The fit starts without chance: reward weights from zero under the dynamics of the start, then both
at once. From then on every change of the prior starts at the last maximum.
"""

from dataclasses import dataclass, field, replace

import numpy as np
import scipy.optimize

from serd_core.arrays import FloatArray
from serd_core.ascent.ascent import STOPPED, AscentResult, Step, StepCallback
from serd_core.ascent.trust_region import SHORT, NewtonAscent
from serd_core.bayes.hyperpriors import HYPERPRIORS
from serd_core.bayes.laplace import laplace_at
from serd_core.checks import require_positive
from serd_core.dynamics.outcome_models import OutcomeModels
from serd_core.dynamics.transition_model import TransitionModel
from serd_core.errors import SerdError
from serd_core.mdp.problem import Problem
from serd_core.posterior.beliefs import Belief, CoupledBelief, FixedBelief, TiedBelief
from serd_core.posterior.coordinates import Coordinates, LogPosterior, coordinates, feature_ranges
from serd_core.posterior.parameters import Block, Parameters
from serd_core.posterior.posterior import Posterior
from serd_core.priors.divergence import DirichletPrior
from serd_core.priors.prior import GaussianPrior, Prior, terms_of
from serd_core.semi_markov.dwell_likelihood import DwellPrior
from serd_core.semi_markov.models import has_laws

#: Name of rho.
INTENDED = "intended_ratio"


@dataclass(frozen=True)
class PriorByEvidence:
    """Proper priors whose strengths the decisions choose: normal on rewards, Dirichlet on dynamics.

    deviation: sigma of the weights, in nats over the range of a feature; pseudo_count: c of the
    outcomes; dwell_deviation: sd of log mean dwell times around a common one, where moves take time
    (`DwellPrior`); intended_ratio: rho, of models with an intended outcome. None for the one of
    highest evidence. Few laws hold hardly any evidence of their deviation, and a small one makes
    moves that nobody makes as fast as the others. Draws of the posterior have strengths of their
    own, for those not given: a scale of each weight, and a base measure of outcomes where none is
    intended (`serd_core.bayes.hyperpriors`).

        fit = sc.fit_mdce_serd(problem, decisions, prior=sc.PriorByEvidence(pseudo_count=1.0))
    """

    deviation: float | None = None
    pseudo_count: float | None = None
    dwell_deviation: float | None = 1.0
    intended_ratio: float | None = None

    def __post_init__(self) -> None:
        for name in HYPERPRIORS:
            if (value := getattr(self, name)) is not None:
                require_positive(f"{name} of PriorByEvidence", value, "use None to find it")

    def strengths(self, belief: Belief, model: TransitionModel) -> "Strengths":
        """The strengths that a fit of the model under the belief has."""
        given: dict[str, float | None] = {"deviation": self.deviation}
        if belief.learns_dynamics:
            given["pseudo_count"] = self.pseudo_count
            intends = isinstance(model.moves, OutcomeModels) and model.moves.intended is not None
            # To models without intended outcomes a given one is refused by the prior.
            if intends or self.intended_ratio is not None:
                given[INTENDED] = self.intended_ratio
            if has_laws(model):
                given["dwell_deviation"] = self.dwell_deviation
        if isinstance(belief, CoupledBelief):
            raise SerdError(
                "CoupledBelief has a prior that is no density, so it has no evidence; give"
                " fit_mdce_serd a prior"
            )
        return Strengths(belief, tuple(given.items()))


@dataclass(frozen=True)
class Strengths:
    """The strengths of a prior; given: by name, None for those to find."""

    belief: Belief
    given: tuple[tuple[str, float | None], ...]

    @property
    def open(self) -> tuple[str, ...]:
        """Names of those to find."""
        return tuple(name for name, value in self.given if value is None)

    def with_given(self, name: str, value: float) -> "Strengths":
        """The same with one more that is given."""
        return Strengths(self.belief, tuple((dict(self.given) | {name: value}).items()))

    @property
    def start(self) -> FloatArray:
        """(h,) logs of the medians of those to find."""
        return np.log([HYPERPRIORS[name][0] for name in self.open])

    @property
    def spreads(self) -> FloatArray:
        """(h,) spreads of the hyperpriors of those to find."""
        return np.array([HYPERPRIORS[name][1] for name in self.open])

    def log_density(self, logs: FloatArray) -> tuple[float, FloatArray]:
        """Log density of the hyperprior at (h,) logs of those to find, and its gradient."""
        away = (logs - self.start) / self.spreads
        values = -0.5 * away**2 - np.log(self.spreads * np.sqrt(2.0 * np.pi))
        return float(values.sum()), -away / self.spreads

    def values(self, logs: FloatArray) -> dict[str, float]:
        """All strengths by name, for (h,) logs of those to find."""
        found = dict(zip(self.open, np.exp(logs).tolist(), strict=True))
        return {name: found[name] if value is None else value for name, value in self.given}

    def logs(self, values: dict[str, float]) -> FloatArray:
        """(h,) logs of those to find, at the given values and otherwise at their medians."""
        medians = {name: median for name, (median, _) in HYPERPRIORS.items()}
        return np.log([(medians | values)[name] for name in self.open])

    def prior(self, problem: Problem, logs: FloatArray) -> Prior:
        """The prior of these strengths."""
        values = self.values(logs)
        deviations = values["deviation"] / feature_ranges(problem)
        prior: Prior = GaussianPrior(tuple(deviations.tolist()), Block.REWARD)
        blocks = [Block.TRUTH] if "pseudo_count" in values else []
        if (Block.BELIEF,) in self.belief.groups:
            blocks.append(Block.BELIEF)
        for block in blocks:
            ratio = values.get(INTENDED, 1.0)
            prior = prior + DirichletPrior(values["pseudo_count"], block, ratio)
            if "dwell_deviation" in values:
                prior = prior + DwellPrior(values["dwell_deviation"], block)
        return prior


def strengths_of(prior: Prior, problem: Problem) -> dict[str, float]:
    """The strengths by name that a prior by evidence has."""
    found: dict[str, float] = {}
    for term in terms_of(prior):
        if isinstance(term, GaussianPrior):
            widths = np.atleast_1d(term.standard_deviation) * feature_ranges(problem)
            found["deviation"] = float(widths[0])
        elif isinstance(term, DirichletPrior):
            found |= {"pseudo_count": term.pseudo_count, INTENDED: term.intended_ratio}
        elif isinstance(term, DwellPrior):
            found["dwell_deviation"] = term.deviation
    return found


#: Width of differences by logs of strengths; slope of the log evidence at its maximum.
WIDTH, LEVEL = 0.002, 0.05
#: Unit of the logs in the search, about the inverse root of the curvature of the evidence.
SCALE = 0.3
#: Distance from the maximum, in standard errors, that changes the log evidence by 5e-7.
CLOSE = 1e-3
MAX_NEWTON_STEPS = 200
#: Slope at which strengths are still good enough, steps to find them, tolerance at a kink.
COARSE, MAX_STEPS, AT_A_KINK = 0.2, 40, 0.01
#: Strengths stay within so many spreads of their hyperprior's median.
FARTHEST = 4.0


@dataclass(eq=False)
class EvidenceSearch:
    """Maxima of the posterior under priors of changing strength, each started at the last.

    posterior: with any prior; on_step: as in `fit_mdce_serd`, with J per decision; mode: where the
    last ascent ended, in the coordinates of what is free; information: (d, d) minus the Hessian of
    the log likelihood there; value: (S,) where the next Bellman solve starts.
    """

    posterior: Posterior
    on_step: StepCallback | None
    space: Coordinates
    mode: FloatArray
    information: FloatArray | None = None
    value: FloatArray | None = None
    trace: list[float] = field(default_factory=list)
    n_evaluations: int = 0
    stopped: bool = False

    def free(self, belief: Belief) -> None:
        """Go on from where the last ascent ended with the numbers that a belief leaves free."""
        at = self.space.parameters(self.mode)
        self.space = coordinates(self.posterior.problem, belief, at)
        self.mode, self.information = self.space.of(at), None

    def objective(self, prior: Prior) -> LogPosterior:
        """The log posterior under a prior."""
        posterior = replace(self.posterior, prior=prior)
        return LogPosterior(posterior, self.space, self.value)

    def maximise(self, objective: LogPosterior, short: float = SHORT) -> AscentResult:
        """Its maximum, from the last one; no step where a callback has stopped the fit."""
        near = self.information
        if near is not None:
            near = near + objective.prior_information(self.mode)
        ascent = NewtonAscent(short, max_steps=0 if self.stopped else MAX_NEWTON_STEPS)
        found = ascent.maximise(objective, self.mode, self._after_step, near)
        self.n_evaluations += found.n_evaluations
        self.value, self.mode = objective.last_value, found.vector
        if found.converged:
            of_prior = objective.prior_information(self.mode)
            self.information = -objective.hessian(self.mode) - of_prior
        if self.stopped:
            return replace(found, converged=False, message=STOPPED)
        return found

    def _after_step(self, step: Step) -> bool:
        """Count the step; whether to stop there."""
        self.trace.append(step.objective)
        if self.on_step is not None:
            mean = step.objective / self.posterior.observations.n_decisions
            vector, number = self.space.table @ step.vector, len(self.trace)
            called = replace(step, number=number, vector=vector, objective=mean)
            self.stopped = bool(self.on_step(called))
        return self.stopped


@dataclass(eq=False)
class EvidenceOfStrengths:
    """Log evidence and log hyperprior as a function of (h,) logs of strengths.

    The maximum u* of the posterior moves by du*/dlog = M^-1 d2J / du dlog. So the slope of the
    evidence takes one more Hessian per strength, and no search. Where the posterior has several
    maxima, the value depends on the one that a search comes from; best: the least loss, with the
    logs and the maximum it was found at.
    """

    search: EvidenceSearch
    strengths: Strengths
    last: tuple[FloatArray, FloatArray] | None = None
    best: tuple[float, FloatArray, FloatArray] | None = None

    def loss(self, logs: FloatArray) -> tuple[float, FloatArray]:
        """Minus the sum, and its (h,) gradient."""
        search, strengths = self.search, self.strengths
        if self.last is not None:
            before, moves = self.last
            search.mode = search.mode + (logs - before) @ moves
        problem = search.posterior.problem
        objective = search.objective(strengths.prior(problem, logs))
        ended = search.maximise(objective, CLOSE)
        if not ended.converged:
            raise SerdError(ended.message)
        here = laplace_at(objective, search.mode)
        pull = self._prior_pull(objective, here.mode)
        slope, moves = np.zeros(len(logs)), np.zeros((len(logs), len(here.mode)))
        for number, unit in enumerate(np.eye(len(logs)) * WIDTH):
            side = search.objective(strengths.prior(problem, logs + unit))
            move = here.root @ (here.root.T @ (self._prior_pull(side, here.mode) - pull))
            beside = self._evidence_near(side, here.mode, move)
            slope[number] = (beside - here.log_evidence) / WIDTH
            moves[number] = move / WIDTH
        self.last = (logs.copy(), moves)
        value, hyper_slope = strengths.log_density(logs)
        loss = -here.log_evidence - value
        if self.best is None or loss < self.best[0]:
            self.best = loss, logs.copy(), here.mode
        return loss, -slope - hyper_slope

    def _evidence_near(self, side: LogPosterior, mode: FloatArray, move: FloatArray) -> float:
        """Log evidence where the tangent leads; where that is no maximum, after a search."""
        try:
            return laplace_at(side, mode + move, require_maximum=False).log_evidence
        except SerdError:
            self.search.mode = mode
            self.search.maximise(side)
            found = laplace_at(side, self.search.mode, require_maximum=False)
            self.search.mode = mode
            return found.log_evidence

    def _prior_pull(self, objective: LogPosterior, mode: FloatArray) -> FloatArray:
        """(d,) gradient of the prior alone."""
        space, posterior = objective.coordinates, objective.posterior
        at = space.parameters(mode)
        gradient = posterior.prior.evaluate(posterior.problem.mdp.transitions, at).gradient
        return np.asarray(space.table.T @ space.belief.pull_back(gradient, at))


def fit_by_evidence(
    posterior: Posterior,
    belief: Belief,
    by_evidence: PriorByEvidence,
    start: Parameters,
    on_step: StepCallback | None = None,
    *,
    staged: bool,
) -> tuple[LogPosterior, Parameters, AscentResult]:
    """The posterior under the strengths of highest evidence, its maximum, and the way to there.

    posterior: with any prior; start: parameters to begin with. staged: whether to look for the
    reward weights first, under the dynamics of the start, and for equal belief and truth before
    they part. Steps and evaluations are those of all ascents, each step under the prior it had.
    Where no maximum is found, or on_step stops, the last point did not converge.
    """
    if len(start.policy):
        raise SerdError(
            "evidence is that of MdcePolicy, got a policy model with a temperature, whose posterior"
            " has kinks; use fit_mdce_serd, or give a prior that is not PriorByEvidence"
        )
    space = coordinates(posterior.problem, belief, start)
    search = EvidenceSearch(posterior, on_step, space, space.of(start))
    model = posterior.problem.mdp.transitions
    strengths = by_evidence.strengths(belief, model)
    logs = strengths.start
    if staged and belief.learns_dynamics:
        stages = [FixedBelief()] if belief == TiedBelief() else [FixedBelief(), TiedBelief()]
        for stage in stages:
            search.free(stage)
            prepared = by_evidence.strengths(stage, model)
            if stage.learns_dynamics:
                found = best_strengths(search, prepared, prepared.start)[0]
                logs = strengths.logs(prepared.values(found))
            else:
                search.maximise(search.objective(prepared.prior(posterior.problem, prepared.start)))
            search.free(belief)
    logs, failure = best_strengths(search, strengths, logs)
    objective = search.objective(strengths.prior(posterior.problem, logs))
    ascended = search.maximise(objective)
    if failure:
        ascended = replace(ascended, converged=False, message=failure)
    trace, n = np.array(search.trace), search.n_evaluations
    counted = replace(ascended, objective_trace=trace, n_steps=len(trace), n_evaluations=n)
    return objective, search.space.parameters(search.mode), counted


def best_strengths(
    search: EvidenceSearch, strengths: Strengths, start: FloatArray
) -> tuple[FloatArray, str]:
    """(h,) logs of the strengths of highest evidence, and why they are not, where they are not.

    A ratio of the intended outcome is looked for from the best symmetric prior on, and is 1 where
    that search fails.
    """
    if not strengths.open:
        return start, ""
    if INTENDED not in strengths.open:
        return _searched(search, strengths, start)
    symmetric = strengths.with_given(INTENDED, 1.0)
    logs, failure = best_strengths(search, symmetric, symmetric.logs(strengths.values(start)))
    mode, start = search.mode, strengths.logs(symmetric.values(logs))
    found, failed = _searched(search, strengths, start)
    if not failed:
        return found, ""
    search.mode = mode
    return start, failure


def _searched(
    search: EvidenceSearch, strengths: Strengths, start: FloatArray
) -> tuple[FloatArray, str]:
    """The same for strengths that are looked for together, of which one is open at least."""
    evidence = EvidenceOfStrengths(search, strengths)
    middle, reach, failure = strengths.start, FARTHEST * strengths.spreads, ""
    bounds = np.stack([middle - reach, middle + reach], axis=1)

    def scaled(logs: FloatArray) -> tuple[float, FloatArray]:
        value, slope = evidence.loss(logs * SCALE)
        return value, slope * SCALE

    try:
        found = scipy.optimize.minimize(
            scaled,
            start / SCALE,
            jac=True,
            method="L-BFGS-B",
            bounds=bounds / SCALE,
            options={"gtol": LEVEL * SCALE, "ftol": 0.0, "maxiter": MAX_STEPS},
        )
        found.x = found.x * SCALE
        inside = np.abs(found.x - middle) < reach
        if np.any(np.abs(found.jac)[inside] > COARSE * SCALE):
            # Where one maximum gives way to another the evidence has a kink.
            found = scipy.optimize.minimize(
                lambda logs: evidence.loss(logs)[0],
                found.x,
                method="Nelder-Mead",
                bounds=bounds,
                options={"xatol": AT_A_KINK, "fatol": AT_A_KINK, "maxiter": MAX_STEPS},
            )
            if not found.success:
                failure = "not converged: out of steps for the strengths of the prior"
    except SerdError as error:
        last = start if evidence.last is None else evidence.last[0]
        return last, str(error)
    if evidence.best is not None and evidence.best[0] < found.fun - AT_A_KINK:
        _, found.x, search.mode = evidence.best
    return np.asarray(found.x), failure
