"""Whether the expert's belief is the truth: relations of belief and truth compared by evidence.

    P(relation | D) ~ P(D | relation) P(relation),     Bayes factor of two = ratio of their P(D)

P(D | relation) integrates over rewards, dynamics and the strengths of their priors (MacKay 1992;
Kass and Raftery 1995). Where no relation is sure, predictions are averaged over all, in shares of
their probability (Hoeting et al. 1999).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.special

from serd_core.arrays import FloatArray, require_count, require_generator, require_kind
from serd_core.ascent.ascent import StepCallback
from serd_core.bayes.draws import N_DRAWS, PosteriorDraws, draws_at
from serd_core.bayes.evidence_fit import EvidenceFit, evidence_start, fit_by_evidence
from serd_core.bayes.laplace import Laplace, laplace_at
from serd_core.bayes.strengths import PriorByEvidence
from serd_core.demonstrations.decisions import Decisions
from serd_core.demonstrations.observations import observe
from serd_core.errors import SerdError
from serd_core.learners.fit_result import FitResult
from serd_core.mdp.problem import Problem, require_problem
from serd_core.policies.policy_model import MdcePolicy
from serd_core.posterior.beliefs import (
    Belief,
    BeliefAroundTruth,
    FixedBelief,
    FreeBelief,
    TiedBelief,
)
from serd_core.posterior.posterior import Posterior
from serd_core.priors.prior import UniformPrior

#: Probability from which one relation stands for all.
DECIDED = 0.95
RELATIONS: tuple[Belief, ...] = (TiedBelief(), BeliefAroundTruth(), FreeBelief())
NAMES = {
    TiedBelief: "equal to the truth",
    FreeBelief: "independent of the truth",
    BeliefAroundTruth: "near the truth",
    FixedBelief: "as given",
}
BY_EVIDENCE = PriorByEvidence()


@dataclass(frozen=True, eq=False)
class BeliefComparison:
    """Fits under each relation, the most probable first.

    probabilities: (r,); log_evidences: (r,); approximations: Laplace's, of each. left_out: those
    that have no maximum of the posterior, with the reason.
    """

    problem: Problem
    relations: tuple[Belief, ...]
    fits: tuple[FitResult, ...]
    approximations: tuple[Laplace, ...]
    log_evidences: FloatArray
    probabilities: FloatArray
    left_out: tuple[str, ...] = ()

    @property
    def best(self) -> FitResult:
        """The fit under the most probable relation."""
        return self.fits[0]

    @property
    def decided(self) -> bool:
        """Whether one relation stands for all."""
        return bool(self.probabilities[0] >= DECIDED)

    def draws(self, rng: np.random.Generator, n: int = N_DRAWS) -> PosteriorDraws:
        """n draws of the best where it is decided, otherwise of all by their probability."""
        require_count("n", n, 2, f"{N_DRAWS}")
        require_generator(rng)
        shares = np.eye(len(self.probabilities))[0] if self.decided else self.probabilities
        parts = [
            draws_at(one.problem, one.coordinates, one.sample(int(count), rng))
            for one, count in zip(self.approximations, rng.multinomial(n, shares), strict=True)
            if count
        ]
        names = ("reward", "truth", "outcome_probabilities", "believed_outcome_probabilities")
        tables = [np.concatenate([getattr(part, name) for part in parts]) for name in names]
        # Coordinates differ from relation to relation.
        return PosteriorDraws(np.zeros((n, 0)), *tables)

    def sentence(self) -> str:
        """The result in one sentence, with the Bayes factor; another one for what was left out."""
        return " ".join([self._compared(), *(f"Not compared: {one}." for one in self.left_out)])

    def _compared(self) -> str:
        if len(self.relations) == 1:
            return f"The expert's belief is taken as {NAMES[type(self.relations[0])]}."
        first, second = (NAMES[type(one)] for one in self.relations[:2])
        factor = np.log10(np.e) * (self.log_evidences[0] - self.log_evidences[1])
        shown = f"{10**factor:.2g}" if factor < 4 else f"10^{factor:.0f}"
        share = f"probability {self.probabilities[0]:.3g}"
        if self.decided:
            return (
                f"The expert's belief is {first} ({share}, Bayes factor {shown} against {second})."
            )
        return (
            f"Undecided: the expert's belief is {first} ({share}) or {second} (Bayes factor"
            f" {shown}); predictions are averaged."
        )


def compare_beliefs(
    problem: Problem,
    decisions: Decisions,
    relations: Sequence[Belief] = RELATIONS,
    *,
    prior: PriorByEvidence = BY_EVIDENCE,
    dynamics: FloatArray | None = None,
    on_step: StepCallback | None = None,
) -> BeliefComparison:
    """Compare how the expert's belief relates to the truth, by the evidence of each relation.

    All relations are equally probable beforehand. dynamics: (M, K) known ones, which `FixedBelief`
    takes as they are; others start there. on_step: called after each step of each fit. A relation
    without a maximum is left out; SerdError where none has one.

        print(sc.compare_beliefs(problem, decisions).probabilities)
    """
    require_problem(problem)
    require_kind("prior", prior, (PriorByEvidence,), "PriorByEvidence()")
    if len(relations) < 2 or len(set(relations)) < len(relations):
        raise SerdError(
            f"relations must be at least two different beliefs, got {len(set(relations))}"
            "; pass for example TiedBelief() and FreeBelief()"
        )
    if dynamics is None and FixedBelief() in relations:
        raise SerdError(
            "FixedBelief can be compared for known dynamics only, got none; pass dynamics, as an"
            " estimate has seen the decisions already"
        )
    posterior = Posterior(problem, observe(problem.mdp, decisions), MdcePolicy(), UniformPrior())
    fits, evidences, left_out = [], [], []
    for relation in relations:
        start = evidence_start(posterior, decisions, relation, None, dynamics)
        found = fit_by_evidence(posterior, relation, prior, start, on_step, staged=True)
        try:
            evidences.append(_log_evidence(found))
            fits.append(found)
        except SerdError as error:
            left_out.append(f"{NAMES[type(relation)]} ({error})")
    if not fits:
        raise SerdError(
            "a relation of belief and truth must have a maximum of the posterior, got none for a"
            f" belief {', '.join(left_out)}; pass a PriorByEvidence with a lower deviation"
        )
    order = np.argsort(-np.array(evidences), kind="stable")
    ordered = [fits[i] for i in order]
    log_evidences = np.array(evidences)[order]
    return BeliefComparison(
        problem=problem,
        relations=tuple(one.belief for one in ordered),
        fits=tuple(one.result() for one in ordered),
        approximations=tuple(
            laplace_at(one.objective, one.objective.coordinates.of(one.parameters))
            for one in ordered
        ),
        log_evidences=log_evidences,
        probabilities=np.asarray(scipy.special.softmax(log_evidences)),
        left_out=tuple(left_out),
    )


def _log_evidence(found: EvidenceFit) -> float:
    """log P(D); SerdError where there is no maximum."""
    if not found.ascended.converged:
        raise SerdError(found.ascended.message)
    return found.log_evidence()
