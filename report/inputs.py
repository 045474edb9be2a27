"""Everything a report is made of: one frozen record, checked for agreement of its parts."""

from dataclasses import dataclass

from report.checks import finite_number
from report.episode_row import EpisodeRow
from report.errors import ReportError
from report.run_facts import FileLink, PhaseTiming, RunFacts
from report.snapshot import CrowdSnapshot
from serd_core.arrays import FloatArray, float_array, require_index
from serd_core.arrival.law import ArrivalLaw
from serd_core.demonstrations.decisions import Decisions
from serd_core.grid.navigation import NavigationProblem
from serd_core.learners.fit_result import FitResult
from serd_core.policies.solved_policy import Policy
from sim.scenario.scenario import Scenario

__all__ = ["FileLink", "PhaseTiming", "ReportInputs", "RunFacts"]


@dataclass(frozen=True, eq=False)
class ReportInputs:
    """One run of the loop: demonstrations, what was learned from them, and how it then drove.

    demonstration_tracks_m: (T, 2) recorded x, y of each demonstration, may be empty.
    policy: the one that drove; predicted: its arrival, up to `timeout_s`.
    """

    title: str
    scenario: Scenario
    problem: NavigationProblem
    demonstrations: Decisions
    demonstration_tracks_m: tuple[FloatArray, ...]
    fit: FitResult
    policy: Policy
    episodes: tuple[EpisodeRow, ...]
    predicted: ArrivalLaw
    timeout_s: float
    snapshot: CrowdSnapshot
    run: RunFacts
    files: tuple[FileLink, ...] = ()

    def __post_init__(self) -> None:
        if not self.episodes:
            raise ReportError("episodes must have at least one row, got none; drive the policy")
        if not finite_number("timeout_s", self.timeout_s) > 0:
            raise ReportError(f"timeout_s must be above 0, got {self.timeout_s}; use seconds")
        self._check_learned()
        tracks = tuple(
            float_array(f"demonstration_tracks_m[{i}]", track, (None, 2))
            for i, track in enumerate(self.demonstration_tracks_m)
        )
        object.__setattr__(self, "demonstration_tracks_m", tracks)

    def _check_learned(self) -> None:
        states, models = self.problem.grid.n_states, len(self.problem.model_names)
        require_index("demonstrations.state", self.demonstrations.state, states, "a state")
        float_array("policy.value", self.policy.value, (states,))
        float_array("fit.reward_weights", self.fit.reward_weights, (None,))
        float_array("fit.objective_trace", self.fit.objective_trace, (None,))
        for name in ("outcome_probabilities", "initial_outcome_probabilities"):
            float_array(f"fit.{name}", getattr(self.fit, name), (models, None))
        float_array("predicted.cdf", self.predicted.cdf, (len(self.predicted.times_s),))
        if self.fit.feature_names != self.problem.feature_names:
            raise ReportError(
                f"fit.feature_names must be those of the problem {self.problem.feature_names}, "
                f"got {self.fit.feature_names}; pass the problem the fit was made on"
            )
