"""From how many cells a learned policy never arrives, known before anything drives."""

from dataclasses import dataclass

import numpy as np

from serd_core.arrival.arriving_policy import NEVER_PERIODS, least_time_policy
from serd_core.arrival.trap_states import trap_states
from serd_core.demonstrations.decisions import Decisions
from serd_core.grid.navigation import NavigationProblem
from serd_core.learners.fit_result import FitResult
from serd_core.policies.solved_policy import optimal_policy


@dataclass(frozen=True)
class LearnedTraps:
    """Cells from which the actions of the learned policy never lead to the goal.

    n_looping_cells: of the n_reaching_cells, from which some policy reaches the goal among n_cells.
    n_looping_starts: of the n_starts cells in which the demonstrations begin.
    """

    n_looping_cells: int
    n_reaching_cells: int
    n_cells: int
    n_looping_starts: int
    n_starts: int

    def sentence(self) -> str:
        """The counts, and what the strategy does about them."""
        cut_off = self.n_cells - self.n_reaching_cells
        rest = f"; from {cut_off} further cells no policy does" if cut_off else ""
        if not self.n_looping_cells:
            return (
                f"the learned policy reaches the goal from all {self.n_reaching_cells} cells{rest}"
            )
        return (
            f"the learned policy never reaches the goal from {self.n_looping_cells} of"
            f" {self.n_reaching_cells} cells ({self.n_looping_cells / self.n_reaching_cells:.0%}),"
            f" {self.n_looping_starts} of the {self.n_starts} in which demonstrations begin among"
            f" them{rest}; a strategy takes the way of least expected time there"
        )


def learned_traps(problem: NavigationProblem, decisions: Decisions, fit: FitResult) -> LearnedTraps:
    """Count them for the optimum of the learned rewards and dynamics.

    decisions: in states of the problem, as the fit learned from them.
    """
    grid, outcomes = problem.grid, fit.outcome_probabilities
    greedy = optimal_policy(problem, fit.reward_weights, outcomes).greedy
    least = -least_time_policy(problem, outcomes).value
    reaching = least < 0.5 * NEVER_PERIODS
    looping = trap_states(grid.neighbours, greedy, problem.goal_states) & reaching
    first = np.unique(decisions.episode, return_index=True)[1]
    starts = np.unique(decisions.state[first])
    return LearnedTraps(
        n_looping_cells=int(looping.sum()),
        n_reaching_cells=int(reaching.sum()),
        n_cells=grid.n_states,
        n_looping_starts=int(looping[starts].sum()),
        n_starts=len(starts),
    )
