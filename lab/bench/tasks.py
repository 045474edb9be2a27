"""The ten tasks by name: what each is about, its numbers of demonstrations, and how it is made."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lab.bench import recorded, worlds
from lab.bench.case import Case, RouteCase

Maker = Callable[[Path, int, np.random.Generator], Case | RouteCase]


@dataclass(frozen=True)
class Task:
    """about: a line for the page; sizes: demonstrations that are learned from.

    most_seeds: splits of one recording overlap, so that many say no more than these.
    """

    about: str
    sizes: tuple[int, ...]
    make: Maker
    most_seeds: int | None = None

    def case(self, data: Path, size: int, seed: int) -> Case | RouteCase:
        """The case of a seed; SerdError where files are missing in the folder of data."""
        return self.make(data, size, np.random.default_rng([size, seed]))


def _of_worlds(family: worlds.Family) -> Maker:
    def make(_: Path, size: int, rng: np.random.Generator) -> Case:
        return worlds.case_of_world(family, size, rng)

    return make


_FEW, _SPLITS = (3, 25), 20
TASKS = {
    "rust": Task(
        "bus engine replacement, Rust (1987), group 4", (5, 18), recorded.case_of_rust, _SPLITS
    ),
    "routes": Task("route choice with many destinations", (900,), recorded.case_of_routes, _SPLITS),
    "crowds": Task(
        "people in a corridor, two directions", (10, 100), recorded.case_of_crowds, _SPLITS
    ),
    "robots": Task("a robot among people", (3, 10), recorded.case_of_robots, _SPLITS),
    "borders": Task("gridworlds, 64 cells, 3 terrains", _FEW, _of_worlds(worlds.grid_world)),
    "aliased": Task("three of four outcomes stay", _FEW, _of_worlds(worlds.aliased_world)),
    "hazard": Task("a chain with a rare, costly fall", _FEW, _of_worlds(worlds.hazard_world)),
    "confounded": Task("a way disliked or slow", _FEW, _of_worlds(worlds.confounded_world)),
    "misspecified": Task("other experts", _FEW, _of_worlds(worlds.misspecified_world)),
    "durations": Task("a ring where moves take time", _FEW, worlds.case_of_durations),
}
