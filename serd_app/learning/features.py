"""Which features of the reward take part, by place and data, and own features of a file.

A feature takes part where it is defined, varies, and is no alias of others: over the decisions that
are available, its column is not a combination of those before it and a constant. An own feature is
a name and one of a polygon (its value inside, 0 outside), a point (the distance to it, as a share
of the farthest cell's) or a raster (the blackness of a map of ROS at the middle of each cell).

    features:
      lawn: {polygon_m: [[0, 0], [4, 0], [4, 3]], value: 1}
      desk: {point_m: [2.5, 1]}
      floor: {raster: floor.yaml}
"""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
from pydantic import Field, model_validator

from serd_app.places.ros_map import read_shades
from serd_bag.errors import FileError
from serd_core.arrays import FloatArray
from serd_core.grid.grid import Grid
from serd_core.grid.navigation import SOCIAL_NORM, WALL_DISTANCE, NavigationProblem
from serd_files.yaml_config import StrictModel, load_yaml_model
from serd_sim.scenario.polygon import contains

#: Share of a column that others do not explain, above which it is no alias.
_OWN_SHARE = 1e-4
_FEWEST_CORNERS = 3


class OwnFeature(StrictModel):
    """A value per cell: inside of a polygon, by distance to a point, or of a raster."""

    polygon_m: tuple[tuple[float, float], ...] = ()
    value: float = Field(default=1.0, ge=-1, le=1)
    point_m: tuple[float, float] | None = None
    raster: str = ""

    @model_validator(mode="after")
    def _is_one(self) -> "OwnFeature":
        given = bool(self.polygon_m), self.point_m is not None, bool(self.raster)
        if sum(given) != 1:
            raise ValueError(f"must have one of polygon_m, point_m and raster, got {sum(given)}")
        if self.polygon_m and len(self.polygon_m) < _FEWEST_CORNERS:
            raise ValueError(
                f"polygon_m must have three corners or more, got {len(self.polygon_m)}"
            )
        return self

    def values(self, grid: Grid, folder: Path) -> FloatArray:
        """(S,) of each cell; folder: of the file that names a raster."""
        if self.polygon_m:
            return self.value * contains(self.polygon_m, grid.centers_m).astype(np.float64)
        if self.point_m is not None:
            away_m = np.linalg.norm(grid.centers_m - np.array(self.point_m), axis=1)
            return np.asarray(away_m / away_m.max(initial=1e-9))
        return read_shades(folder / self.raster, grid.centers_m)


class FeatureFile(StrictModel):
    """Own features by their names."""

    features: dict[str, OwnFeature] = Field(min_length=1)


def read_own_features(path: Path, grid: Grid, known: tuple[str, ...]) -> dict[str, FloatArray]:
    """Return the (S,) values of each own feature of a file; FileError where it is wrong."""
    described = load_yaml_model(path, FeatureFile).features
    for name in described:
        if name in known:
            raise FileError(f"{path}: features must not be named as the usual ones, got {name!r}")
    return {name: each.values(grid, path.parent) for name, each in described.items()}


def with_chosen_features(
    problem: NavigationProblem, own: Mapping[str, FloatArray], *, walls_seen: bool
) -> tuple[NavigationProblem, dict[str, str]]:
    """Return the problem with the features that take part, and why others do not, by name.

    own: (S,) of each. walls_seen: whether the walls are those of a map, a scenario or scans.
    """
    table = dict(zip(problem.feature_names, np.moveaxis(problem.features, 2, 0), strict=True))
    left_out = {}
    if SOCIAL_NORM not in table:
        left_out[SOCIAL_NORM] = "no flow of people is known"
    if not walls_seen and table.pop(WALL_DISTANCE, None) is not None:
        left_out[WALL_DISTANCE] = "no walls were seen: the edge of the visited cells is none"
    shape = problem.features.shape[:2]
    table |= {name: np.broadcast_to(each[:, None], shape) for name, each in own.items()}
    available = problem.outcome_models.available
    columns: dict[str, FloatArray] = {"a constant": np.ones(int(available.sum()))}
    for name, values in table.items():
        column = values[available]
        if reason := _alias_of(column, columns):
            left_out[name] = reason
        else:
            columns[name] = column
    names = tuple(name for name in table if name in columns)
    features = np.stack([table[name] for name in names], axis=2)
    return replace(problem, features=features, feature_names=names), left_out


def _alias_of(column: FloatArray, columns: Mapping[str, FloatArray]) -> str:
    """Return why a column adds nothing to others, empty where it does."""
    if np.ptp(column) < _OWN_SHARE * max(1.0, float(np.abs(column).max())):
        return "it is the same for all decisions"
    basis = np.stack(list(columns.values()), axis=1)
    weights = np.linalg.lstsq(basis, column, rcond=None)[0]
    spread = np.linalg.norm(column - column.mean())
    if np.linalg.norm(column - basis @ weights) > _OWN_SHARE * spread:
        return ""
    others = list(zip(columns, weights, strict=True))[1:]
    named = " and ".join(name for name, weight in others if abs(weight) > _OWN_SHARE)
    return f"it is another name of {named.replace('_', ' ')}"
