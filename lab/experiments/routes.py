"""Route choice on a road network, from the public format of recursive logit data (Borlänge).

A folder has tables of `row column value`, counted from 1: incidence (link, next link or place, 1),
time (link, next link, time of the next link), angles (link, next link, radians; may be missing) and
observations (trip, position, number). The first number of a trip is its destination, the others are
its links and the destination again. Columns of the incidence beyond its rows are places where trips
end. Features are those of Fosgerau, Frejinger and Karlstrom (2013): time, left turns, a constant
per link and u-turns.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from lab.experiments.running.experiment import Findings, Session
from lab.routes.network import RouteNetwork, Trips, trips_on
from lab.routes.recursive_logit import fit_routes
from serd_core.arrays import FloatArray, IntArray
from serd_core.errors import SerdError
from serd_files.settings import setting
from serd_files.yaml_config import StrictModel


class RoutesConfig(StrictModel):
    """Settings of route choice on a road network."""

    data: Path = setting(..., "the folder of incidence, time, angle and observation files")
    left_turn_degrees: float = setting(30.0, "turns to the left from this angle on", gt=0, lt=180)
    u_turn_degrees: float = setting(177.0, "turns that are u-turns, either way", gt=0, le=180)


@dataclass(frozen=True, eq=False)
class Triples:
    """(n,) rows and columns from 0, and numbers."""

    row: IntArray
    column: IntArray
    value: FloatArray


def run_routes(config: RoutesConfig, session: Session) -> Findings:
    """The weights with their errors."""
    network, trips = read_routes(config)
    fit = fit_routes(network, trips)
    session.progress(1, 1)
    table = pd.DataFrame(
        {
            "name": [*fit.feature_names, "log-likelihood"],
            "estimate": [*fit.weights, fit.log_likelihood],
            "error": [*fit.standard_errors, np.nan],
            "robust error": [*fit.robust_errors, np.nan],
            "converged": fit.converged,
        }
    )
    return Findings(table, {"estimates.csv": table})


def read_routes(config: RoutesConfig) -> tuple[RouteNetwork, Trips]:
    """Network and trips of a folder."""
    incidence = _triples(config.data, "incidence")
    n_links = int(incidence.row.max()) + 1
    present = incidence.value != 0
    inside = present & (incidence.column < n_links)
    places = present & (incidence.column >= n_links)
    first, second = incidence.row[inside], incidence.column[inside]
    features = _features(config, first, second)
    own = np.repeat(np.arange(n_links)[:, None], 2, axis=1)
    ends = np.stack([incidence.row[places], incidence.column[places]], axis=1)
    exits = np.concatenate([own, ends])
    network = RouteNetwork(
        n_links, first, second, np.stack(list(features.values()), axis=1), tuple(features), exits
    )
    observed = _triples(config.data, "observation")
    kept = observed.value > 0
    trip, position = observed.row[kept], observed.column[kept]
    number = observed.value[kept].astype(np.int64) - 1
    order = np.lexsort((position, trip))
    whole = np.split(number[order], np.flatnonzero(np.diff(trip[order])) + 1)
    goals = np.array([each[0] for each in whole])
    # A place is no link: the trip ends on the link before.
    links = [each[1:-1] if each[0] >= n_links else each[1:] for each in whole]
    return network, trips_on(network, goals, links)


def _features(config: RoutesConfig, first: IntArray, second: IntArray) -> dict[str, FloatArray]:
    time = _at(_triples(config.data, "time"), first, second)
    features = {"time": time, "link constant": (time > 0).astype(np.float64)}
    if not _files(config.data, "angle"):
        return features
    degrees = np.degrees(_at(_triples(config.data, "angle"), first, second))
    u_turn = np.abs(degrees) >= config.u_turn_degrees
    left = (degrees <= -config.left_turn_degrees) & ~u_turn
    return {**features, "left turn": left.astype(np.float64), "u-turn": u_turn.astype(np.float64)}


def _at(table: Triples, first: IntArray, second: IntArray) -> FloatArray:
    """(n,) number of each pair, 0 where the table has none."""
    size = 1 + max(int(table.column.max()), int(second.max()))
    keys = table.row * size + table.column
    order = np.argsort(keys)
    place = np.minimum(np.searchsorted(keys[order], first * size + second), len(keys) - 1)
    found = keys[order][place] == first * size + second
    return np.where(found, table.value[order][place], 0.0)


def _files(folder: Path, part: str) -> list[Path]:
    return sorted(path for path in folder.glob("*.txt") if part in path.name.lower())


def _triples(folder: Path, part: str) -> Triples:
    files = _files(folder, part)
    if len(files) != 1:
        names = ", ".join(path.name for path in files) or "none"
        raise SerdError(
            f"{folder} must have one .txt file with {part!r} in its name, got {names}; add it or"
            " move the others"
        )
    try:
        table = np.loadtxt(files[0], ndmin=2)
    except ValueError as error:
        raise SerdError(f"{files[0]} must have rows of three numbers, got: {error}") from error
    if not len(table) or table.shape[1] != 3 or np.any(table[:, :2] < 1):
        raise SerdError(
            f"{files[0]} must have rows of row, column and value, counted from 1, got a table of"
            f" shape {table.shape}; write it so"
        )
    row, column = (table[:, :2].astype(np.int64) - 1).T
    return Triples(row, column, table[:, 2])
