"""Where a learner stands, so that one that was killed goes on instead of beginning again.

The folder holds `decisions.csv`, every decision learned from or still to learn from, and
`checkpoint.yaml`, where the newest fit stood.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field

from serd_app.demonstrations.decision_table import load_decisions, save_decisions
from serd_core.demonstrations.decisions import Decisions
from serd_core.grid.grid import Grid
from storage.errors import FileError
from storage.files import atomic_write_text
from storage.yaml_config import StrictModel, load_yaml_model, model_yaml


class LearnerCheckpoint(StrictModel):
    """reward_weights: by name, where the newest fit stood after `step` steps; none before it.

    n_learned: decisions the newest finished fit had learned from.
    goal_entry_s: see `storage.model_file.ModelFile`.
    """

    format: Literal["serd-learner"] = "serd-learner"
    format_version: Literal[1] = 1
    scenario: str
    grid_fingerprint: str
    reward_weights: dict[str, float] = Field(default_factory=dict)
    step: int = Field(default=0, ge=0)
    n_learned: int = Field(default=0, ge=0)
    goal_entry_s: tuple[Annotated[float, Field(gt=0)], ...] = ()


@dataclass(frozen=True)
class CheckpointFolder:
    """Reads and writes the two files; each is replaced whole."""

    path: Path
    scenario: str
    grid: Grid

    def new(self) -> LearnerCheckpoint:
        """That of a learner that knows nothing."""
        return LearnerCheckpoint(scenario=self.scenario, grid_fingerprint=self.grid.fingerprint())

    def load(self) -> tuple[LearnerCheckpoint, Decisions] | None:
        """What was kept, None where nothing was; FileError where it is of another grid."""
        if not self._decisions.exists() or not self._checkpoint.exists():
            return None
        checkpoint = load_yaml_model(self._checkpoint, LearnerCheckpoint)
        if checkpoint.grid_fingerprint != self.grid.fingerprint():
            raise FileError(
                f"{self.path}: was kept on the grid of scenario {checkpoint.scenario!r}, not on "
                f"that of {self.scenario!r}; choose another folder or move this one away"
            )
        return checkpoint, load_decisions(self._decisions)

    def save_decisions(self, decisions: Decisions) -> None:
        """Keep the decisions."""
        save_decisions(self._decisions, decisions)

    def save(self, checkpoint: LearnerCheckpoint) -> None:
        """Keep where the fit stands."""
        atomic_write_text(self._checkpoint, model_yaml(checkpoint))

    @property
    def _decisions(self) -> Path:
        return self.path / "decisions.csv"

    @property
    def _checkpoint(self) -> Path:
        return self.path / "checkpoint.yaml"
