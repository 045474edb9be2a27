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
from serd_sim.errors import SimError

_COINCIDENT_M = 1e-6


class PairGeometry:
    """dx_m, dy_m, distance_m: (n_people, n_bodies); the first n_people bodies are the people.

    period_m: length after which the world repeats in x (a ring corridor), 0 for a plain world.
    """

    def __init__(self, n_people: int, n_bodies: int, period_m: float = 0.0) -> None:
        self._period_m = period_m
        self._own = (np.arange(n_people), np.arange(n_people))
        rank = np.arange(n_people)[:, None] - np.arange(n_bodies)[None, :]
        self._separation_m = _COINCIDENT_M * np.sign(rank)

    def update(self, x_m: FloatArray, y_m: FloatArray) -> None:
        """Take bodies at (n_bodies,) positions.

        Two bodies at one point are taken to be a micrometre apart, in opposite directions for the
        two, so that they part. The distance of a person to themselves is infinite.
        """
        n_people = len(self._separation_m)
        self.dx_m, self.dy_m = x_m[:n_people, None] - x_m, y_m[:n_people, None] - y_m
        if self._period_m > 0.0:
            self.dx_m -= np.rint(self.dx_m / self._period_m) * self._period_m
        self.distance_m = _lengths(self.dx_m, self.dy_m)
        near = self.distance_m < _COINCIDENT_M
        if np.count_nonzero(near) > n_people:
            self.dx_m[near] = self._separation_m[near]
            self.distance_m = _lengths(self.dx_m, self.dy_m)
        self.distance_m[self._own] = np.inf


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
    """People and, after them, the other bodies that push them; (n_bodies,) arrays.

    heading: unit vector of the wanted direction; velocity: the present one; radius: of the body.
    """

    heading_x: FloatArray
    heading_y: FloatArray
    velocity_x_mps: FloatArray
    velocity_y_mps: FloatArray
    radius_m: FloatArray

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
    their way that people walk around; None: they walk straight.
    """

    relaxation_time_s: float = 0.5
    maximum_speed_ratio: float = 1.3
    body_radius_m: float = 0.25
    evasion_clearance_m: float | None = None

    @abstractmethod
    def people_force(self, pairs: PairGeometry, bodies: Bodies) -> Force:
        """(n_people,) x and y of the sum over j of f_ij."""

    @abstractmethod
    def wall_force(self, walls: WallGeometry) -> Force:
        """(n_people,) x and y of the sum over w of f_iw."""


@dataclass(frozen=True)
class CircularAnisotropic(SocialForceModel):
    """Circular repulsion, weaker from behind (Helbing, Farkas & Vicsek, Nature 407, 2000).

    f_ij = A exp((r_i + r_j - d) / B) n (lambda + (1 - lambda) (1 + cos phi) / 2), where phi is the
    angle between where i wants to go and where j is. Fits Weidmann's speed-density curve.
    """

    strength_mps2: float = 4.0
    decay_m: float = 0.25
    anisotropy: float = 0.45
    wall_strength_mps2: float = 4.0
    wall_decay_m: float = 0.2

    def people_force(self, pairs: PairGeometry, bodies: Bodies) -> Force:
        """Sum over the others of the circular repulsion."""
        n_people = len(pairs.dx_m)
        reach = bodies.radius_m[:n_people, None] + bodies.radius_m - pairs.distance_m
        push = self.strength_mps2 * np.exp(np.minimum(reach / self.decay_m, 3.0))
        push /= pairs.distance_m
        towards_x = push * pairs.dx_m
        towards_y = push * pairs.dy_m
        weight = _weight_by_direction(pairs, bodies, self.anisotropy)
        return np.einsum("ij,ij->i", towards_x, weight), np.einsum("ij,ij->i", towards_y, weight)

    def wall_force(self, walls: WallGeometry) -> Force:
        """Sum over the walls of A exp((r - d) / B) n."""
        return _exponential_wall_force(
            walls, self.wall_strength_mps2, self.wall_decay_m, self.body_radius_m
        )


@dataclass(frozen=True)
class HelbingMolnar1995(SocialForceModel):
    """The model as published in 1995, with its parameters.

    f_ij = -grad V0 exp(-b / sigma), with b the semi-minor axis of the ellipse
    2b = sqrt((|r| + |r - v_j dt e_j|)^2 - (v_j dt)^2), v_j the present speed of j; full weight
    within the angle of sight, `rear_weight` outside. Walls: U0 exp(-d / R).
    """

    potential_m2ps2: float = 2.1
    decay_m: float = 0.3
    stride_s: float = 2.0
    half_angle_of_sight_rad: float = np.deg2rad(100.0)
    rear_weight: float = 0.5
    wall_potential_m2ps2: float = 10.0
    wall_decay_m: float = 0.2

    def people_force(self, pairs: PairGeometry, bodies: Bodies) -> Force:
        """Sum over the others of the elliptical repulsion, weighted by sight."""
        n_people = len(pairs.dx_m)
        distance = np.where(np.isfinite(pairs.distance_m), pairs.distance_m, 1.0)
        # The stride of a person who is held up is short: with the wanted speed instead, people who
        # stand would push others metres ahead of them, and a hallway jams for good.
        stride = bodies.speed_mps * self.stride_s
        ahead_x = pairs.dx_m - stride * bodies.heading_x
        ahead_y = pairs.dy_m - stride * bodies.heading_y
        ahead = np.maximum(np.hypot(ahead_x, ahead_y), 1e-9)
        both = distance + ahead
        semi_minor = 0.5 * np.sqrt(np.maximum(both**2 - stride**2, 1e-12))
        push = self.potential_m2ps2 / self.decay_m * np.exp(-semi_minor / self.decay_m)
        push *= both / (4.0 * semi_minor)
        force_x = push * (pairs.dx_m / distance + ahead_x / ahead)
        force_y = push * (pairs.dy_m / distance + ahead_y / ahead)
        heading_x, heading_y = bodies.heading_x[:n_people, None], bodies.heading_y[:n_people, None]
        seen = heading_x * -force_x + heading_y * -force_y >= np.hypot(force_x, force_y) * np.cos(
            self.half_angle_of_sight_rad
        )
        weight = np.where(seen, 1.0, self.rear_weight) * np.isfinite(pairs.distance_m)
        return np.einsum("ij,ij->i", force_x, weight), np.einsum("ij,ij->i", force_y, weight)

    def wall_force(self, walls: WallGeometry) -> Force:
        """Sum over the walls of U0 / R exp(-d / R) n."""
        strength = self.wall_potential_m2ps2 / self.wall_decay_m
        return _exponential_wall_force(walls, strength, self.wall_decay_m, 0.0)


@dataclass(frozen=True)
class CollisionPrediction(SocialForceModel):
    """Repulsion from where others will be, so that oncoming people pass instead of stopping.

    After Zanlungo, Ikeda & Kanda (Europhysics Letters 93, 2011): f_ij = A exp((r_i + r_j - d') / B)
    n' w, with d' and n' at the time of closest approach, at most `foresight_s` ahead, and w as in
    `CircularAnisotropic`; beside it C exp((2 c - d) / D) n, which keeps bodies apart. The radii of
    both among people are smaller than a body, for people turn their shoulders. Past a robot, which
    does not, r_i + r_j is the sum of the radii of the bodies and a clearance, and 2 c that sum.
    People walk around a robot in their way (`robots.headings_around`); without that it pushes them
    back. Calibrated on recorded corridors (docs/crowd.md).
    """

    evasion_clearance_m: float | None = 0.2
    strength_mps2: float = 3.9
    decay_m: float = 0.21
    anisotropy: float = 0.3
    foresight_s: float = 0.62
    radius_m: float = 0.2
    core_strength_mps2: float = 10.0
    core_decay_m: float = 0.06
    core_radius_m: float = 0.18
    robot_clearance_m: float = 0.1
    wall_strength_mps2: float = 4.0
    wall_decay_m: float = 0.2

    def people_force(self, pairs: PairGeometry, bodies: Bodies) -> Force:
        """Sum over the others of both repulsions."""
        n_people = len(pairs.dx_m)
        velocity_x, velocity_y = bodies.velocity_x_mps, bodies.velocity_y_mps
        closing_x = velocity_x[:n_people, None] - velocity_x
        closing_y = velocity_y[:n_people, None] - velocity_y
        squared = np.maximum(closing_x**2 + closing_y**2, _STANDING_M2PS2)
        time_s = -(pairs.dx_m * closing_x + pairs.dy_m * closing_y) / squared
        np.minimum(np.maximum(time_s, 0.0, out=time_s), self.foresight_s, out=time_s)
        away_x, away_y = pairs.dx_m + time_s * closing_x, pairs.dy_m + time_s * closing_y
        distance = np.maximum(np.sqrt(away_x**2 + away_y**2), _APART_M)
        reach_m = self._reach_m(self.radius_m, n_people, bodies, self.robot_clearance_m)
        push = np.exp(np.minimum((reach_m - distance) / self.decay_m, 3.0))
        push *= self.strength_mps2
        push *= _weight_by_direction(pairs, bodies, self.anisotropy)
        push *= np.isfinite(pairs.distance_m) / distance
        core_reach_m = self._reach_m(self.core_radius_m, n_people, bodies)
        core = np.exp(np.minimum((core_reach_m - pairs.distance_m) / self.core_decay_m, 3.0))
        core /= pairs.distance_m
        core *= self.core_strength_mps2
        return (
            np.einsum("ij,ij->i", push, away_x) + np.einsum("ij,ij->i", core, pairs.dx_m),
            np.einsum("ij,ij->i", push, away_y) + np.einsum("ij,ij->i", core, pairs.dy_m),
        )

    def _reach_m(
        self, radius_m: float, n_people: int, bodies: Bodies, clearance_m: float = 0.0
    ) -> FloatArray:
        """(n_bodies,) sums of radii, of that radius for people; clearance_m: to the robot."""
        reach_m = np.full(len(bodies.radius_m), 2.0 * radius_m)
        reach_m[n_people:] = self.body_radius_m + bodies.radius_m[n_people:] + clearance_m
        return reach_m

    def wall_force(self, walls: WallGeometry) -> Force:
        """Sum over the walls of A exp((r - d) / B) n."""
        return _exponential_wall_force(
            walls, self.wall_strength_mps2, self.wall_decay_m, self.radius_m
        )


_MODELS: dict[str, SocialForceModel] = {
    "circular_anisotropic": CircularAnisotropic(),
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


def _weight_by_direction(pairs: PairGeometry, bodies: Bodies, anisotropy: float) -> FloatArray:
    """(n_people, n_bodies) lambda + (1 - lambda) (1 + cos phi) / 2: 1 ahead, lambda behind."""
    n_people = len(pairs.dx_m)
    heading_x, heading_y = bodies.heading_x[:n_people, None], bodies.heading_y[:n_people, None]
    cosine = -(pairs.dx_m * heading_x + pairs.dy_m * heading_y) / pairs.distance_m
    weight: FloatArray = anisotropy + (1.0 - anisotropy) * 0.5 * (1.0 + cosine)
    return weight


def _exponential_wall_force(
    walls: WallGeometry, strength_mps2: float, decay_m: float, radius_m: float
) -> Force:
    distance = np.maximum(walls.distance_m, 1e-6)
    push = np.exp(np.minimum((radius_m - distance) / decay_m, 3.0))
    push *= strength_mps2 * walls.share / distance
    return np.einsum("ij,ij->i", push, walls.dx_m), np.einsum("ij,ij->i", push, walls.dy_m)
