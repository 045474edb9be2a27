"""Seeds of the study: every recording has a world of its own, given by one number.

The same number makes the same recording through ROS: `serd launch demonstrate seed:=NUMBER ...`.
"""

from enum import IntEnum

from experiments.study.recordings.experts import EXPERTS

_PER_EXPERT, _PER_REPETITION = 10_000, 10


class Purpose(IntEnum):
    """What a recording is for."""

    TRAINING = 0
    TEST = 1
    TRANSFER = 2
    MEASUREMENT = 3
    REFERENCE_EXPERTS = 5
    REFERENCE_AGAINST_FLOW = 6
    REFERENCE_EXPLORING = 7


def world_seed(seed: int, expert: str, repetition: int, purpose: Purpose) -> int:
    """Seed of the world (and of the driver) of one recording."""
    return seed + _PER_EXPERT * EXPERTS.index(expert) + _PER_REPETITION * repetition + int(purpose)
