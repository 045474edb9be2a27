"""Costs of rollouts: distance to the waypoint, nearness of walls and people.

Positions are (..., T) arrays, costs (...). A rollout is `too close` at a time when the robot would
come nearer than a small margin to a wall or to a person: to one who walks straight on, or to one
who stops, since people do both. A wall or person within the margin does not keep the robot from
leaving: a rollout is too close only where it is nearer than standing still would be.
"""

from dataclasses import dataclass

import numpy as np

from serd_core.arrays import BoolArray, FloatArray
from serd_sim.crowd.social_force import model_named
from serd_sim.errors import SimError
from serd_sim.planning.nearby_people import (
    PredictedPeople,
    gap_to_people_m,
    near_box,
    predict_nearby,
)
from serd_sim.scenario.occupancy import values_at, wall_distance_raster
from serd_sim.scenario.scenario import Scenario
from serd_sim.world.observation import Observation
from serd_sim.world.waypoint import Waypoint

_NO_NEARER_M = 1e-3
#: Side (m) of a cell of the wall raster, where cells of the grid have 1 m.
_RASTER_M = 0.05
#: At least (about) so many raster cells would take more than a second to make.
_MOST_RASTER_CELLS = 1e6


@dataclass(frozen=True)
class CostSettings:
    """Margins in metres between surfaces; weights of the terms; foresight_s: how soon matters.

    wall_margin_m, wall_decay_m: in cells of 1 m and more; in smaller ones less in proportion,
    because otherwise a robot that fits into a cell beside a wall would be too close to it there.
    The margin is more than half the diagonal of a cell of the wall raster.
    person_margin_m, stopped_margin_m: to a person who walks straight on, and who stops.
    """

    wall_margin_m: float = 0.05
    person_margin_m: float = 0.08
    stopped_margin_m: float = 0.02
    people_range_m: float = 3.5
    max_people: int = 8
    progress_weight: float = 1.0
    staying_weight: float = 0.3
    heading_weight: float = 0.25
    people_weight: float = 1.2
    people_decay_m: float = 0.25
    foresight_s: float = 0.8
    wall_weight: float = 0.3
    wall_decay_m: float = 0.12

    def __post_init__(self) -> None:
        for name in ("people_decay_m", "foresight_s", "wall_decay_m", "people_range_m"):
            if not getattr(self, name) > 0:
                raise SimError(f"{name} must be above 0, got {getattr(self, name)}; raise it")


@dataclass(frozen=True, eq=False)
class Surroundings:
    """The nearby people, and how near a rollout may bring the robot to them and to walls.

    nearest_m: (T,) smallest gap allowed to the predicted people; nearest_now_m: (1,) to where they
    are now. Below zero where a person touches the robot. nearest_wall_m: distance from the centre
    of the robot that is allowed to walls.
    """

    people: PredictedPeople
    nearest_m: FloatArray
    nearest_now_m: FloatArray
    nearest_wall_m: float


class RolloutCosts:
    """Costs of rollouts in one scenario, at the times (T,) of their points."""

    def __init__(self, scenario: Scenario, settings: CostSettings, time_s: FloatArray) -> None:
        self.settings = settings
        self._time_s = time_s
        person_radius_m = model_named(scenario.pedestrians.model).body_radius_m
        self._reach_m = scenario.robot.radius_m + person_radius_m
        scale = _wall_scale(scenario)
        self._walls = wall_distance_raster(scenario, scale * _RASTER_M)
        self._least_wall_m = scenario.robot.radius_m + scale * settings.wall_margin_m
        self._wall_decay_m = scale * settings.wall_decay_m
        self._foresight: FloatArray = np.exp(-time_s / settings.foresight_s)

    def progress(self, x_m: FloatArray, y_m: FloatArray, waypoint: Waypoint) -> FloatArray:
        """Mean over time of the smallest distance to the waypoint so far, and the last one.

        The smallest distance rewards speed; the last one keeps the robot at the waypoint.
        """
        shortest, last = shortest_so_far(x_m, y_m, waypoint.x_m, waypoint.y_m)
        cost: FloatArray = self.settings.progress_weight * shortest.mean(axis=-1)
        return cost + self.settings.staying_weight * last

    def heading(self, error_rad: FloatArray, distance_m: float | FloatArray) -> FloatArray:
        """Not facing the waypoint, the less the nearer it is."""
        error = np.abs((error_rad + np.pi) % (2.0 * np.pi) - np.pi)
        cost: FloatArray = self.settings.heading_weight * error * np.minimum(1.0, 2.0 * distance_m)
        return cost

    def walls(
        self, x_m: FloatArray, y_m: FloatArray, around: Surroundings, n_soon: int
    ) -> tuple[FloatArray, BoolArray]:
        """Nearness of walls (...), and where (..., n_soon) one is too close."""
        away_m, too_close = self._nearest_wall(x_m, y_m, around.nearest_wall_m, n_soon)
        nearness = np.exp(-np.maximum(away_m - self._least_wall_m, 0.0) / self._wall_decay_m)
        return self.settings.wall_weight * nearness, too_close

    def look(self, observation: Observation) -> Surroundings:
        """What all rollouts from here share: the nearby people, and the gaps of a robot at rest."""
        settings = self.settings
        people = predict_nearby(
            observation, settings.people_range_m, settings.max_people, self._time_s
        )
        here_x, here_y = np.array(observation.pose[:2])[:, None]
        here = here_x, here_y
        standing = gap_to_people_m(*here, people.x_m, people.y_m, self._reach_m)
        standing_now = gap_to_people_m(*here, people.now_x_m, people.now_y_m, self._reach_m)
        return Surroundings(
            people,
            np.minimum(settings.person_margin_m, standing - _NO_NEARER_M),
            np.minimum(settings.stopped_margin_m, standing_now - _NO_NEARER_M),
            min(self._least_wall_m, float(self._nearest_wall(here_x, here_y, 0.0, 0)[0])),
        )

    def people(
        self, x_m: FloatArray, y_m: FloatArray, around: Surroundings, n_soon: int
    ) -> tuple[FloatArray, BoolArray]:
        """Nearness of people (...), sooner counting more, and where (..., n_soon) one is too close.

        n_soon: how many of the first times a robot cannot stop before; later ones forbid nothing.
        """
        if not len(around.people):
            shape = x_m.shape[:-1]
            return np.zeros(shape), np.zeros((*shape, n_soon), dtype=np.bool_)
        exponent, too_close = nearest_person(
            x_m,
            y_m,
            around.people.x_m,
            around.people.y_m,
            self._reach_m,
            around.nearest_m[:n_soon],
            self.settings.people_decay_m,
        )
        if n_soon:
            too_close |= nearest_now(
                x_m[..., :n_soon],
                y_m[..., :n_soon],
                around.people.now_x_m,
                around.people.now_y_m,
                self._reach_m,
                self.settings.stopped_margin_m,
                around.nearest_now_m,
            )
        nearness = np.exp(exponent, out=exponent)
        return self.settings.people_weight * largest_product(nearness, self._foresight), too_close

    def _nearest_wall(
        self, x_m: FloatArray, y_m: FloatArray, nearest_m: float, n_soon: int
    ) -> tuple[FloatArray, BoolArray]:
        raster = self._walls
        scale = 1.0 / raster.resolution_m
        return nearest_wall(raster.distance_m, x_m, y_m, raster.origin_m, scale, nearest_m, n_soon)


def shortest_so_far(
    x_m: FloatArray, y_m: FloatArray, to_x_m: float, to_y_m: float
) -> tuple[FloatArray, FloatArray]:
    """(..., T) smallest distance to a point until each time, and (...) the last distance."""
    away_x, away_y = x_m - to_x_m, y_m - to_y_m
    away_x *= away_x
    away_y *= away_y
    away_x += away_y
    distance = np.sqrt(away_x, out=away_x)
    last = distance[..., -1].copy()
    return np.minimum.accumulate(distance, axis=-1, out=distance), last


def nearest_wall(
    distance_m: FloatArray,
    x_m: FloatArray,
    y_m: FloatArray,
    origin_m: tuple[float, float],
    scale: float,
    nearest_m: float,
    n_soon: int,
) -> tuple[FloatArray, BoolArray]:
    """(...) smallest distance by a raster, and (..., n_soon) where it is below the nearest."""
    away_m = values_at(distance_m, x_m, y_m, origin_m, scale)
    return away_m.min(axis=-1), away_m[..., :n_soon] < nearest_m


def nearest_person(
    x_m: FloatArray,
    y_m: FloatArray,
    people_x_m: FloatArray,
    people_y_m: FloatArray,
    reach_m: float,
    nearest_m: FloatArray,
    decay_m: float,
) -> tuple[FloatArray, BoolArray]:
    """(..., T) -gap / decay, at most 1, and (..., n) where the gap is below the nearest (n,)."""
    gap_m = gap_to_people_m(x_m, y_m, people_x_m, people_y_m, reach_m)
    too_close = gap_m[..., : len(nearest_m)] < nearest_m
    np.maximum(gap_m, -decay_m, out=gap_m)
    gap_m /= -decay_m
    return gap_m, too_close


def nearest_now(
    x_m: FloatArray,
    y_m: FloatArray,
    people_x_m: FloatArray,
    people_y_m: FloatArray,
    reach_m: float,
    largest_m: float,
    nearest_m: FloatArray,
) -> BoolArray:
    """(..., n) where the gap to people at (K, 1) is below the nearest (1,), at most the largest."""
    box_m = x_m.min(), x_m.max(), y_m.min(), y_m.max()
    near = near_box(people_x_m[:, 0], people_y_m[:, 0], box_m, reach_m + largest_m)
    if not near.any():
        return np.zeros(x_m.shape, dtype=np.bool_)
    gap_m = gap_to_people_m(x_m, y_m, people_x_m[near], people_y_m[near], reach_m)
    too_close: BoolArray = gap_m < nearest_m
    return too_close


def largest_product(values: FloatArray, factors: FloatArray) -> FloatArray:
    """(...) maximum over the last axis of values times factors (T,)."""
    largest: FloatArray = (values * factors).max(axis=-1)
    return largest


def any_before(at_wall: BoolArray, at_person: BoolArray, soon: BoolArray) -> BoolArray:
    """(...) whether a rollout is too close to a wall or a person at one of its times `soon`."""
    found: BoolArray = np.any((at_wall | at_person) & soon, axis=-1)
    return found


def _wall_scale(scenario: Scenario) -> float:
    """Lengths beside walls relative to those in cells of 1 m; the finer, the more raster cells."""
    sides_m = np.ptp(np.array(scenario.wall_polygons_m[0]), axis=0) + 1.0
    finest_m = float(np.sqrt(sides_m.prod() / _MOST_RASTER_CELLS))
    return min(1.0, max(scenario.cell_size_m, finest_m / _RASTER_M))
