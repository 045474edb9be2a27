"""Tasks of recorded decisions, whose truth nobody knows: read from public files, split by seed.

`--data` names a folder with a folder of each (`SOURCES` has what to fetch):

    rust1987/       the odometer files of Rust (1987)
    routes/         link incidence, times, turn angles, observations (`python -m lab routes`)
    pedestrians/    ways of people in corridors, as the archives of Juelich have them
    robots/         tables or bags of a robot among people, as `serd demos` reads them

A part of the episodes is learned from, and others are predicted: decisions by their log-likelihood,
moves by their log loss.
"""

from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from lab.bench.case import Case, RouteCase, Target, decision_shares
from lab.experiments.routes import RoutesConfig, read_routes
from lab.experiments.rust import RustConfig, as_decisions, bus_months, rust_problem
from lab.experiments.study.people.people import People, evenly
from lab.experiments.study.people.settings import people_settings
from lab.routes.network import Trips
from serd_app.journeys.demonstrate import PlaceChoice, demonstrate
from serd_app.learning.learning_files import read_learning_files
from serd_app.learning.recipe import with_moves_as_actions
from serd_core.arrays import IntArray
from serd_core.demonstrations.decisions import Decisions, TimedDecisions, reached
from serd_core.errors import SerdError
from serd_core.grid.grid import Grid
from serd_core.grid.navigation import NavigationProblem
from serd_core.mdp.problem import TabularProblem

#: The public files by folder.
SOURCES = {
    "rust1987": "a530875.asc of github.com/OpenSourceEconomics/zurcher-data",
    "routes": "linkIncidence.txt, ATTRIBUTEestimatedtime.txt, ATTRIBUTEturnangles.txt and"
    " observationsForEstimBAI.txt from Input of github.com/maitien86/RecursiveLogit.Classical.V2"
    " (Borlaenge)",
    "pedestrians": "bi_corr_400_b_03.txt of BaSiGo, in github.com/PedestrianDynamics/PedPy",
    "robots": "bags of drives to one goal, such as those of SCAND, doi.org/10.18738/T8/0PRYRH, or"
    " tables of them",
}
#: Share of its decisions that a recording's discount leaves to the next one.
DISCOUNT = 0.97
#: Episodes that are predicted.
N_TEST = 100


def case_of_rust(data: Path, size: int, rng: np.random.Generator) -> Case:
    """Rust's group 4: some of the 37 buses are learned from, the others predicted."""
    _files(data / "rust1987", "a530875.asc")
    config = RustConfig(data=data / "rust1987")
    increments, rows = bus_months(config)
    problem = rust_problem(config.n_bins, int(increments.max()) + 1, config.discount)
    return split(problem, as_decisions(rows, increments, config.n_bins), size, rng)


def case_of_crowds(data: Path, size: int, rng: np.random.Generator) -> Case:
    """People in two directions through a corridor, the cell that each entered as its action."""
    return split(*_crowds(data / "pedestrians"), size, rng)


@lru_cache(maxsize=1)
def _crowds(folder: Path) -> tuple[TabularProblem, Decisions]:
    people = People.read(people_settings(_files(folder, "bi_corr_400_b_03*.txt")[:1]))
    flow_of = people.decisions_of(evenly(np.ones(len(people.walkers), bool), N_TEST))
    flow = people.place.flow(flow_of, people.signs_of(flow_of))
    return _plain(people.place.grid, people.place.problem(flow), people.decisions)


def case_of_robots(data: Path, size: int, rng: np.random.Generator) -> Case:
    """Drives of a robot among people to where most of them end."""
    return split(*_robots(data / "robots"), size, rng)


@lru_cache(maxsize=1)
def _robots(folder: Path) -> tuple[TabularProblem, Decisions]:
    files = _files(folder, "*")
    with TemporaryDirectory() as there:
        table = Path(there) / "decisions.csv"
        demonstrate(files, table, PlaceChoice())
        read = read_learning_files(table, discount=DISCOUNT)
    return _plain(read.task.problem.grid, read.task.problem, read.decisions)


def _plain(
    grid: Grid, problem: NavigationProblem, decisions: TimedDecisions
) -> tuple[TabularProblem, Decisions]:
    """The problem by decisions, and those that ended in an outcome, without times."""
    shown = with_moves_as_actions(grid, decisions)
    kept = shown.select(reached(shown))
    columns = {name: getattr(kept, name) for name in Decisions.__dataclass_fields__}
    by_decisions = problem.by_decisions
    plain = TabularProblem(by_decisions.mdp, by_decisions.features, by_decisions.feature_names)
    return plain, Decisions(**columns)


def _files(folder: Path, pattern: str) -> list[Path]:
    found = sorted(folder.glob(pattern)) if folder.is_dir() else []
    if not found:
        raise SerdError(
            f"--data must hold {folder.name}/{pattern}, but does not; put there"
            f" {SOURCES[folder.name]}"
        )
    return found


def split(
    problem: TabularProblem, decisions: Decisions, size: int, rng: np.random.Generator
) -> Case:
    """Learn from `size` random episodes, and predict up to N_TEST others."""
    learned, tested = _chosen(decisions.episodes, size, rng)
    held_out = decisions.select_episodes(tested)
    target = Target(decision_shares(problem, held_out))
    return Case(problem, decisions.select_episodes(learned), target, held_out=held_out)


def _chosen(
    numbers: IntArray | Sequence[int], size: int, rng: np.random.Generator
) -> tuple[IntArray, IntArray]:
    if len(numbers) <= size:
        raise SerdError(
            f"more than {size} episodes must be there to learn from {size} and predict others, got"
            f" {len(numbers)}; record more"
        )
    order = rng.permutation(numbers)
    return order[:size], order[size : size + N_TEST]


def case_of_routes(data: Path, size: int, rng: np.random.Generator) -> RouteCase:
    """Trips on a road network to many destinations; left turns begin at 30 degrees, as stated."""
    _files(data / "routes", "*.txt")
    network, trips = read_routes(RoutesConfig(data=data / "routes"))
    learned, tested = _chosen(np.arange(len(trips)), size, rng)
    return RouteCase(network, some_of(trips, learned), some_of(trips, tested))


def some_of(trips: Trips, rows: IntArray) -> Trips:
    """The trips of the given rows, with the destinations that these have."""
    goals, to = np.unique(trips.destinations[trips.to[rows]], return_inverse=True)
    return Trips(trips.origin[rows], goals, to, trips.features[rows])
