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
from serd_sim.scenario.cells import WALL_MARGIN_M
from serd_sim.scenario.occupancy import wall_distance_raster
from serd_sim.scenario.scenario import Scenario
from serd_sim.world.observation import Observation
from serd_sim.world.waypoint import Waypoint


def predict_nearby(
    observation: Observation, range_m: float, most: int, time_s: FloatArray
) -> FloatArray:
    """(K, 2, T) constant-velocity prediction of at most `most` people: the nearest within range_m.

    People without a finite position are left out; those without a finite velocity stand.
    """
    position_m, velocity_mps = observation.people_position_m, observation.people_velocity_mps
    away_x, away_y = position_m[:, 0] - observation.x_m, position_m[:, 1] - observation.y_m
    squared = away_x * away_x + away_y * away_y
    near = (squared < range_m * range_m).nonzero()[0]
    if len(near) > most:
        near = near[squared[near].argsort(kind="stable")[:most]]
    position_m, velocity_mps = position_m[near], velocity_mps[near]
    finite = np.isfinite(velocity_mps)
    if not finite.all():
        velocity_mps = np.where(finite.all(axis=1, keepdims=True), velocity_mps, 0.0)
    return np.asarray(position_m[..., None] + velocity_mps[..., None] * time_s)


def distance_to_nearest(x_m: FloatArray, y_m: FloatArray, people_m: FloatArray) -> FloatArray:
    """Distance from each point (..., T) to the nearest of K people, inf without any.

    people_m: (K, 2, T), or (K, 2, 1) for people who stand. A point (1,) is that of a robot that
    stands, at all times.
    """
    squared = np.full((*x_m.shape[:-1], max(x_m.shape[-1], people_m.shape[-1])), np.inf)
    for person_x, person_y in people_m:
        np.minimum(squared, np.square(x_m - person_x) + np.square(y_m - person_y), out=squared)
    distance: FloatArray = np.sqrt(squared, out=squared)
    return distance


_NO_NEARER_M = 1e-3
#: Heading of a robot whose heading does not matter.
_ANY: FloatArray = np.zeros(1)
#: Points along the outline of a robot that is not round are this far apart (m).
_OUTLINE_STEP_M = 0.05
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

    wall_margin_m: float = WALL_MARGIN_M
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


_COSTS = CostSettings()


@dataclass(frozen=True, eq=False)
class Surroundings:
    """The nearby people, and how near a rollout may bring the robot to them and to walls.

    now_m: (K, 2, 1) where people are, later_m: (K, 2, T) where they are expected. nearest_m: (T,)
    smallest gap allowed to the latter; nearest_now_m: (1,) to the former. Below zero where a person
    touches the robot. nearest_wall_m: distance from walls that is allowed to the centre of a round
    robot, or to the outline of another.
    """

    now_m: FloatArray
    later_m: FloatArray
    nearest_m: FloatArray
    nearest_now_m: FloatArray
    nearest_wall_m: float


class RolloutCosts:
    """Costs of rollouts in one scenario, at the times (T,) of their points."""

    def __init__(
        self, scenario: Scenario, time_s: FloatArray, settings: CostSettings = _COSTS
    ) -> None:
        self.settings = settings
        self._time_s = time_s
        person_radius_m = model_named(scenario.pedestrians.model).body_radius_m
        self._body, self._person_radius_m = scenario.robot.outline, person_radius_m
        self._reach_m = scenario.robot.radius_m + person_radius_m
        self._outline_m = self._body.outline_m(_OUTLINE_STEP_M)
        scale = _wall_scale(scenario)
        self._walls = wall_distance_raster(scenario, scale * _RASTER_M)
        radius_m = self._body.radius_m if self._body.is_round else 0.0
        self._least_wall_m = radius_m + scale * settings.wall_margin_m
        self._wall_decay_m = scale * settings.wall_decay_m
        self._foresight: FloatArray = np.exp(-time_s / settings.foresight_s)

    def progress(self, x_m: FloatArray, y_m: FloatArray, waypoint: Waypoint) -> FloatArray:
        """Mean over time of the smallest distance to the waypoint so far, and the last one.

        The smallest distance rewards speed; the last one keeps the robot at the waypoint.
        """
        away_m = np.sqrt(np.square(x_m - waypoint.x_m) + np.square(y_m - waypoint.y_m))
        shortest_m = np.minimum.accumulate(away_m, axis=-1)
        cost: FloatArray = self.settings.progress_weight * shortest_m.mean(axis=-1)
        last_m: FloatArray = away_m[..., -1]
        return cost + self.settings.staying_weight * last_m

    def heading(self, error_rad: FloatArray, distance_m: float | FloatArray) -> FloatArray:
        """Not facing the waypoint, the less the nearer it is."""
        error = np.abs((error_rad + np.pi) % (2.0 * np.pi) - np.pi)
        cost: FloatArray = self.settings.heading_weight * error * np.minimum(1.0, 2.0 * distance_m)
        return cost

    def walls(
        self,
        x_m: FloatArray,
        y_m: FloatArray,
        around: Surroundings,
        n_soon: int,
        yaw_rad: FloatArray = _ANY,
    ) -> tuple[FloatArray, BoolArray]:
        """Nearness of walls (...), and where (..., n_soon) one is too close.

        yaw_rad: headings at the points, which matter where the robot is not round.
        """
        away_m = self._wall_distance_m(x_m, y_m, yaw_rad)
        gap_m = away_m.min(axis=-1) - self._least_wall_m
        nearness = np.exp(-np.maximum(gap_m, 0.0) / self._wall_decay_m)
        return self.settings.wall_weight * nearness, away_m[..., :n_soon] < around.nearest_wall_m

    def look(self, observation: Observation) -> Surroundings:
        """What all rollouts from here share: the nearby people, and the gaps of a robot at rest."""
        settings = self.settings
        times_s = np.append(0.0, self._time_s)
        people_m = predict_nearby(
            observation, settings.people_range_m, settings.max_people, times_s
        )
        x_m, y_m, yaw_rad = np.array(observation.pose)[:, None]
        now_m, later_m = people_m[..., :1], people_m[..., 1:]
        standing_m, standing_now_m = (
            self._gap_m(x_m, y_m, yaw_rad, each) for each in (later_m, now_m)
        )
        return Surroundings(
            now_m,
            later_m,
            np.minimum(settings.person_margin_m, standing_m - _NO_NEARER_M),
            np.minimum(settings.stopped_margin_m, standing_now_m - _NO_NEARER_M),
            min(self._least_wall_m, float(self._wall_distance_m(x_m, y_m, yaw_rad)[0])),
        )

    def people(
        self,
        x_m: FloatArray,
        y_m: FloatArray,
        around: Surroundings,
        n_soon: int,
        yaw_rad: FloatArray = _ANY,
    ) -> tuple[FloatArray, BoolArray]:
        """Nearness of people (...), sooner counting more, and where (..., n_soon) one is too close.

        n_soon: how many of the first times a robot cannot stop before; later ones forbid nothing.
        yaw_rad: as of `walls`.
        """
        if not len(around.now_m):
            shape = x_m.shape[:-1]
            return np.zeros(shape), np.zeros((*shape, n_soon), dtype=np.bool_)
        decay_m = self.settings.people_decay_m
        gap_m = self._gap_m(x_m, y_m, yaw_rad, around.later_m)
        too_close = gap_m[..., :n_soon] < around.nearest_m[:n_soon]
        if n_soon:
            soon_x, soon_y, soon_rad = (each[..., :n_soon] for each in (x_m, y_m, yaw_rad))
            gap_now_m = self._gap_m(soon_x, soon_y, soon_rad, around.now_m)
            too_close |= gap_now_m < around.nearest_now_m
        np.maximum(gap_m, -decay_m, out=gap_m)
        gap_m /= -decay_m
        nearness = np.exp(gap_m, out=gap_m)
        return self.settings.people_weight * (nearness * self._foresight).max(axis=-1), too_close

    def _wall_distance_m(self, x_m: FloatArray, y_m: FloatArray, yaw_rad: FloatArray) -> FloatArray:
        """Distance of walls from the centre of a round robot, or from the outline of another."""
        if self._body.is_round:
            return self._walls.at(x_m, y_m)
        cos, sin = np.cos(yaw_rad), np.sin(yaw_rad)
        nearest_m: FloatArray = np.full(x_m.shape, np.inf)
        for ahead_m, aside_m in self._outline_m:
            corner_m = self._walls.at(
                x_m + cos * ahead_m - sin * aside_m, y_m + sin * ahead_m + cos * aside_m
            )
            np.minimum(nearest_m, corner_m, out=nearest_m)
        return nearest_m

    def _gap_m(
        self, x_m: FloatArray, y_m: FloatArray, yaw_rad: FloatArray, people_m: FloatArray
    ) -> FloatArray:
        """Gap between the robot at each point and the nearest person."""
        if self._body.is_round:
            return distance_to_nearest(x_m, y_m, people_m) - self._reach_m
        shape = np.broadcast_shapes(x_m.shape, people_m.shape[-1:])
        poses = np.stack([np.broadcast_to(each, shape).ravel() for each in (x_m, y_m, yaw_rad)], 1)
        places_m = np.moveaxis(np.broadcast_to(people_m, (*people_m.shape[:2], shape[-1])), 2, 0)
        places_m = np.tile(places_m, (len(poses) // shape[-1], 1, 1))
        gaps_m = self._body.gaps_m(poses, places_m) - self._person_radius_m
        nearest_m: FloatArray = gaps_m.min(axis=1, initial=np.inf).reshape(shape)
        return nearest_m


def _wall_scale(scenario: Scenario) -> float:
    """Lengths beside walls relative to those in cells of 1 m; the finer, the more raster cells."""
    sides_m = np.ptp(np.array(scenario.wall_polygons_m[0]), axis=0) + 1.0
    finest_m = float(np.sqrt(sides_m.prod() / _MOST_RASTER_CELLS))
    return min(1.0, max(scenario.cell_size_m, finest_m / _RASTER_M))
