"""What a table of decisions came from: the YAML file beside it that learning reads as well."""

from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field

from storage.files import atomic_write_text
from storage.yaml_config import StrictModel, load_yaml_model, model_yaml


class BagRecord(StrictModel):
    """What became of the intents of one bag; see `DiscretisationReport`.

    damage: sentences about what of the bag could not be read; n_lost: messages known to be lost by
    it; all_lost_known: whether no more than those can be.
    """

    bag: str
    n_decisions: int = Field(ge=0)
    n_episodes: int = Field(ge=0)
    n_diagonal: int = Field(ge=0)
    n_far: int = Field(ge=0)
    dropped: dict[str, int]
    n_bad_poses: int = Field(ge=0)
    n_unplaced_poses: int = Field(0, ge=0)
    n_bad_commands: int = Field(0, ge=0)
    damage: tuple[str, ...] = ()
    n_lost: int = Field(0, ge=0)
    all_lost_known: bool = True


class DemonstrationRecord(StrictModel):
    """scenario: empty where the grid was fitted; goal_entry_s: see `ModelFile`."""

    format: Literal["serd-demonstrations"] = "serd-demonstrations"
    format_version: Literal[1] = 1
    scenario: str
    grid_fingerprint: str
    decision_period_s: float = Field(gt=0)
    goal_entry_s: tuple[Annotated[float, Field(gt=0)], ...] = ()
    bags: tuple[BagRecord, ...]


def save_record(path: str | Path, record: DemonstrationRecord) -> None:
    """Write the record as YAML."""
    atomic_write_text(path, model_yaml(record))


def load_record(path: str | Path) -> DemonstrationRecord:
    """Read what `save_record` wrote."""
    return load_yaml_model(path, DemonstrationRecord)
