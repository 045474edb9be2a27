"""What a live learner has seen and where its fit stands, kept on disk against a kill."""

from pathlib import Path

import numpy as np

from serd_app.demonstrations.demonstrations import Demonstrations
from serd_app.demonstrations.live import LiveDrive
from serd_app.learning.checkpoint import CheckpointFolder, LearnerCheckpoint
from serd_core.arrays import FloatArray
from serd_core.grid.navigation import FEATURE_NAMES
from serd_core.learners.fit_result import FitResult
from sim.scenario.grid import grid_of
from sim.scenario.scenario import Scenario


class LearnerMemory:
    """Demonstrations as they come, and the newest weights, from and to a checkpoint folder."""

    def __init__(self, scenario: Scenario, folder: Path) -> None:
        grid = grid_of(scenario)
        self.folder = CheckpointFolder(folder, scenario.name, grid)
        kept = self.folder.load()
        self._checkpoint, earlier = (self.folder.new(), None) if kept is None else kept
        self.demonstrations: Demonstrations | None = None
        if earlier is not None:
            self.demonstrations = Demonstrations(earlier, self._checkpoint.goal_entry_s)
        self.drive = LiveDrive(
            "live topics", grid, scenario.decision_period_s, earlier=self.demonstrations
        )

    @property
    def n_decisions(self) -> int:
        """Decisions there are."""
        return 0 if self.demonstrations is None else len(self.demonstrations.decisions)

    @property
    def unlearned(self) -> bool:
        """Whether there are decisions no finished fit has learned from."""
        return self.n_decisions != self._checkpoint.n_learned

    @property
    def warm_weights(self) -> FloatArray | None:
        """(F,) where the newest fit stood, None before the first."""
        weights = self._checkpoint.reward_weights
        if set(weights) != set(FEATURE_NAMES):
            return None
        return np.array([weights[name] for name in FEATURE_NAMES])

    def gather(self, *, unfinished: bool) -> Demonstrations:
        """Everything seen, which is kept; unfinished: see `LiveDrive.gathered`."""
        self.demonstrations = self.drive.gathered(unfinished=unfinished)
        self.folder.save_decisions(self.demonstrations.decisions)
        self._keep(goal_entry_s=self.demonstrations.goal_entry_s)
        return self.demonstrations

    def note_step(self, weights: FloatArray, step: int) -> None:
        """Keep where an unfinished fit stands."""
        self._keep(reward_weights=_named(weights), step=step)

    def note_learned(self, fit: FitResult) -> None:
        """Keep what a finished fit found; the next begins anew where this one found no end."""
        weights = _named(fit.reward_weights) if fit.converged else {}
        self._keep(reward_weights=weights, step=0, n_learned=fit.n_decisions)

    def _keep(self, **changes: object) -> None:
        self._checkpoint = LearnerCheckpoint(**(self._checkpoint.model_dump() | changes))
        self.folder.save(self._checkpoint)


def _named(weights: FloatArray) -> dict[str, float]:
    return dict(zip(FEATURE_NAMES, weights.tolist(), strict=True))
