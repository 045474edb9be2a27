"""Independent random streams, each derived from the one seed of a run."""

import numpy as np

#: What a stream is for; part of its key, so that no two of them share numbers.
CROWD, START, EXPERT, POLICY, LIDAR, ODOMETRY, FAULT = range(7)


def episode_rng(seed: int, episode: int, purpose: int, *more: int) -> np.random.Generator:
    """Generator for one purpose in one episode: the same for the same numbers, always."""
    return np.random.default_rng(np.random.SeedSequence([seed, episode, purpose, *more]))
