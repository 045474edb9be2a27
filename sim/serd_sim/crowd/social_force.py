"""Social forces: how people push each other away without touching, as named models.

Every model is Helbing & Molnár's equation of motion (Physical Review E 51, 1995, Eq. 2-8)

    dv_i/dt = (v0_i e_i - v_i) / tau + sum_j f_ij + sum_w f_iw

with its own repulsion f_ij of people and f_iw of walls. All forces are per mass, in m/s2.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np

from serd_bag.nearest import choice_rule
from serd_core.arrays import FloatArray
from serd_sim.crowd.neighbours import Pairs
from serd_sim.errors import SimError


class WallGeometry:
    """dx_m, dy_m, distance_m, share: (n_people, W) for segments (W, 2, 2).

    share: 1 beside a wall, 1/2 beyond its end, so that a corner two walls share counts once.
    start_m, unit: (2, W) starts and directions of the walls; length_m: (W,).
    """

    def __init__(self, segments_m: FloatArray) -> None:
        start, along = segments_m[:, 0], segments_m[:, 1] - segments_m[:, 0]
        self.length_m = np.maximum(np.hypot(along[:, 0], along[:, 1]), 1e-9)
        self.start_m, self.unit = start.T.copy(), along.T / self.length_m

    def update(self, x_m: FloatArray, y_m: FloatArray) -> None:
        """Take people at (n_people,) positions."""
        dx_m, dy_m = x_m[:, None] - self.start_m[0], y_m[:, None] - self.start_m[1]
        position = dx_m * self.unit[0] + dy_m * self.unit[1]
        # np.clip takes as long as ten of these for so few numbers.
        clipped = np.minimum(np.maximum(position, 0.0), self.length_m)
        self.share = 0.5 * (1.0 + (position == clipped))
        self.dx_m, self.dy_m = dx_m - clipped * self.unit[0], dy_m - clipped * self.unit[1]
        self.distance_m = _lengths(self.dx_m, self.dy_m)

    def nearest_m(self, x_m: float, y_m: float) -> float:
        """Take a single body at a place; its distance to the nearest wall."""
        self.update(np.array([x_m]), np.array([y_m]))
        return float(self.distance_m.min())


def _lengths(dx_m: FloatArray, dy_m: FloatArray) -> FloatArray:
    lengths: FloatArray = np.sqrt(dx_m * dx_m + dy_m * dy_m)
    return lengths


Force = tuple[FloatArray, FloatArray]
_APART_M = 1e-3
_STANDING_M2PS2 = 1e-9


@dataclass(frozen=True, eq=False)
class Bodies:
    """People and, last, the robot that pushes them; (n_bodies,) arrays.

    heading: unit vector of the wanted direction; velocity: the present one.
    """

    heading_x: FloatArray
    heading_y: FloatArray
    velocity_x_mps: FloatArray
    velocity_y_mps: FloatArray
    robot_radius_m: float

    @property
    def speed_mps(self) -> FloatArray:
        """The present speeds."""
        speed: FloatArray = np.hypot(self.velocity_x_mps, self.velocity_y_mps)
        return speed


@dataclass(frozen=True)
class SocialForceModel(ABC):
    """The repulsion of one named model.

    relaxation_time_s: in which a walker takes up the wanted velocity. maximum_speed_ratio: highest
    speed relative to the wanted one. body_radius_m: of a person. evasion_clearance_m: to a robot in
    their way that people walk around; None: they walk straight. people_reach_m: distance beyond
    which people do not feel each other.
    """

    relaxation_time_s: float = 0.5
    maximum_speed_ratio: float = 1.3
    body_radius_m: float = 0.25
    evasion_clearance_m: float | None = None
    people_reach_m: float = 4.0

    @abstractmethod
    def people_force(self, pairs: Pairs, bodies: Bodies) -> Force:
        """(n_people,) x and y of the sum over j of f_ij."""

    @abstractmethod
    def wall_force(self, walls: WallGeometry) -> Force:
        """(n_people,) x and y of the sum over w of f_iw."""


@dataclass(frozen=True)
class HelbingMolnar1995(SocialForceModel):
    """The model as published in 1995, with its parameters.

    f_ij = -grad V0 exp(-b / sigma), with b the semi-minor axis of the ellipse
    2b = sqrt((|r| + |r - v_j dt e_j|)^2 - (v_j dt)^2), v_j the present speed of j; full weight
    within the angle of sight, `rear_weight` outside. Walls: U0 exp(-d / R).
    """

    people_reach_m: float = 6.0
    potential_m2ps2: float = 2.1
    decay_m: float = 0.3
    stride_s: float = 2.0
    half_angle_of_sight_rad: float = np.deg2rad(100.0)
    rear_weight: float = 0.5
    wall_potential_m2ps2: float = 10.0
    wall_decay_m: float = 0.2

    def people_force(self, pairs: Pairs, bodies: Bodies) -> Force:
        """Sum over the others of the elliptical repulsion, weighted by sight."""
        person, body, distance = pairs.person, pairs.body, pairs.distance_m
        # The stride of a person who is held up is short: with the wanted speed instead, people who
        # stand would push others metres ahead of them, and a hallway jams for good.
        stride = (bodies.speed_mps * self.stride_s)[body]
        ahead_x = pairs.dx_m - stride * bodies.heading_x[body]
        ahead_y = pairs.dy_m - stride * bodies.heading_y[body]
        ahead = np.maximum(np.hypot(ahead_x, ahead_y), 1e-9)
        both = distance + ahead
        semi_minor = 0.5 * np.sqrt(np.maximum(both**2 - stride**2, 1e-12))
        push = self.potential_m2ps2 / self.decay_m * np.exp(-semi_minor / self.decay_m)
        push *= both / (4.0 * semi_minor)
        force_x = push * (pairs.dx_m / distance + ahead_x / ahead)
        force_y = push * (pairs.dy_m / distance + ahead_y / ahead)
        towards = -bodies.heading_x[person] * force_x - bodies.heading_y[person] * force_y
        seen = towards >= np.hypot(force_x, force_y) * np.cos(self.half_angle_of_sight_rad)
        weight = np.where(seen, 1.0, self.rear_weight)
        return pairs.totals(force_x * weight), pairs.totals(force_y * weight)

    def wall_force(self, walls: WallGeometry) -> Force:
        """Sum over the walls of U0 / R exp(-d / R) n."""
        strength = self.wall_potential_m2ps2 / self.wall_decay_m
        return _exponential_wall_force(walls, strength, self.wall_decay_m, 0.0)


@dataclass(frozen=True)
class CollisionPrediction(SocialForceModel):
    """Repulsion from where others will be, so that oncoming people pass instead of stopping.

    After Zanlungo, Ikeda & Kanda (Europhysics Letters 93, 2011): f_ij = A exp((2 r - d') / B) n' w,
    with d' and n' at the time of closest approach, at most `foresight_s` ahead, and w the weight
    lambda + (1 - lambda) (1 + cos phi) / 2, where phi is the angle between where i wants to go and
    where j is; beside it C exp((2 c - d) / D) n, which keeps bodies apart. Both radii are smaller
    than a body, for people turn their shoulders. A robot does not: beside it 2 c is the sum of the
    radii of both bodies. People walk around a robot in their way (`robots.headings_around`) as far
    as they pass each other. Calibrated on recorded corridors (docs/crowd.md).
    """

    relaxation_time_s: float = 0.34
    people_reach_m: float = 5.5
    evasion_clearance_m: float | None = 0.1
    strength_mps2: float = 2.5
    decay_m: float = 0.52
    anisotropy: float = 0.07
    foresight_s: float = 0.77
    radius_m: float = 0.05
    core_strength_mps2: float = 21.0
    core_decay_m: float = 0.027
    core_radius_m: float = 0.08
    wall_strength_mps2: float = 4.0
    wall_decay_m: float = 0.2

    def people_force(self, pairs: Pairs, bodies: Bodies) -> Force:
        """Sum over the others of both repulsions."""
        person, body = pairs.person, pairs.body
        closing_x = bodies.velocity_x_mps[person] - bodies.velocity_x_mps[body]
        closing_y = bodies.velocity_y_mps[person] - bodies.velocity_y_mps[body]
        time_s = pairs.dx_m * closing_x
        time_s += pairs.dy_m * closing_y
        time_s /= -np.maximum(closing_x * closing_x + closing_y * closing_y, _STANDING_M2PS2)
        np.minimum(np.maximum(time_s, 0.0, out=time_s), self.foresight_s, out=time_s)
        closing_x *= time_s
        closing_y *= time_s
        away_x, away_y = pairs.dx_m + closing_x, pairs.dy_m + closing_y
        distance = np.maximum(np.sqrt(away_x * away_x + away_y * away_y), _APART_M)
        push = (2.0 * self.radius_m - distance) / self.decay_m
        np.exp(np.minimum(push, 3.0, out=push), out=push)
        push *= self.strength_mps2 / distance
        push *= _weight_by_direction(pairs, bodies, self.anisotropy)
        core = 2.0 * self.core_radius_m - pairs.distance_m
        touch_m = self.body_radius_m + bodies.robot_radius_m
        core[: pairs.n_robot] += touch_m - 2.0 * self.core_radius_m
        core /= self.core_decay_m
        np.exp(np.minimum(core, 3.0, out=core), out=core)
        core *= self.core_strength_mps2 / pairs.distance_m
        away_x *= push
        away_y *= push
        away_x += core * pairs.dx_m
        away_y += core * pairs.dy_m
        return pairs.totals(away_x), pairs.totals(away_y)

    def wall_force(self, walls: WallGeometry) -> Force:
        """Sum over the walls of A exp((r - d) / B) n."""
        return _exponential_wall_force(
            walls, self.wall_strength_mps2, self.wall_decay_m, self.radius_m
        )


_MODELS: dict[str, SocialForceModel] = {
    "collision_prediction": CollisionPrediction(),
    "helbing_molnar_1995": HelbingMolnar1995(),
}


def model_names() -> tuple[str, ...]:
    """Names a scenario may give as `pedestrians.model`."""
    return tuple(_MODELS)


def model_named(name: str) -> SocialForceModel:
    """The model of that name; SimError with the nearest name when there is none."""
    if name not in _MODELS:
        raise SimError(choice_rule("pedestrian model", name, _MODELS))
    return _MODELS[name]


def _weight_by_direction(pairs: Pairs, bodies: Bodies, anisotropy: float) -> FloatArray:
    """(pairs,) lambda + (1 - lambda) (1 + cos phi) / 2: 1 ahead, lambda behind."""
    cosine = pairs.dx_m * bodies.heading_x[pairs.person]
    cosine += pairs.dy_m * bodies.heading_y[pairs.person]
    cosine /= -pairs.distance_m
    weight: FloatArray = anisotropy + (1.0 - anisotropy) * 0.5 * (1.0 + cosine)
    return weight


def _exponential_wall_force(
    walls: WallGeometry, strength_mps2: float, decay_m: float, radius_m: float
) -> Force:
    distance = np.maximum(walls.distance_m, 1e-6)
    push = np.exp(np.minimum((radius_m - distance) / decay_m, 3.0))
    push *= strength_mps2 * walls.share / distance
    return np.einsum("ij,ij->i", push, walls.dx_m), np.einsum("ij,ij->i", push, walls.dy_m)
