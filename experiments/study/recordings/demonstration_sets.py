"""Training, test and transfer: the three sets of one expert and repetition."""

from dataclasses import dataclass

from experiments.study.recordings.seeds import Purpose
from serd_core.demonstrations.decisions import Decisions

ROLES = {"training": Purpose.TRAINING, "test": Purpose.TEST, "transfer": Purpose.TRANSFER}


@dataclass(frozen=True, eq=False)
class DemonstrationSets:
    """Decisions of each set."""

    training: Decisions
    test: Decisions
    transfer: Decisions
