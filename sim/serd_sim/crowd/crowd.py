"""A crowd that walks its loops under social forces, with the robot as one more body.

One step of length dt is semi-implicit Euler: v += a dt, limited to the maximum speed; x += v dt;
then people who are too close to a wall are put back, so that no one passes it.
"""

import numpy as np

from serd_core.arrays import FloatArray
from serd_sim.crowd.neighbours import Neighbours
from serd_sim.crowd.robots import RobotBody, headings_around
from serd_sim.crowd.routes import Routes, offset_loop
from serd_sim.crowd.social_force import (
    Bodies,
    Force,
    SocialForceModel,
    WallGeometry,
    model_named,
)
from serd_sim.scenario.settings import Loop, PedestrianSettings

_CLOSEST_TO_WALL = 0.6
#: Less than the distance kept to walls, so that a push never carries a person through one.
_LARGEST_PUSH_M = 0.1
#: People who stand walk back to their place slower when nearer than this (m).
_AT_PLACE_M = 0.5
_BACK_TO_PLACE_MPS = 0.5
_COINCIDENT_M = 1e-6


#: Stands in for the robot where people see none.
_NO_ROBOT = RobotBody(1e6, 1e6, 0.0, 0.0, 0.0)


class Crowd:
    """N people; (N,) arrays x_m, y_m, velocity_x_mps, velocity_y_mps, desired_speed_mps."""

    def __init__(
        self,
        *,
        model: SocialForceModel,
        routes: Routes,
        x_m: FloatArray,
        y_m: FloatArray,
        desired_speed_mps: FloatArray,
        walls_m: FloatArray,
        fluctuation_mps2: float,
        rng: np.random.Generator,
        period_m: float = 0.0,
        standing_m: FloatArray | None = None,
    ) -> None:
        """standing_m: (S, 2) places of the last S people, whose routes are not used."""
        count = len(x_m)
        self.desired_speed_mps = desired_speed_mps
        self.body_radius_m = model.body_radius_m
        self._model, self._routes, self._rng = model, routes, rng
        self._fluctuation_mps2, self._period_m = fluctuation_mps2, period_m
        self.x_m, self.y_m = x_m.copy(), y_m.copy()
        self._standing_m = np.zeros((0, 2)) if standing_m is None else standing_m
        self._neighbours = Neighbours(count, model.people_reach_m, period_m)
        self._walls = WallGeometry(walls_m)
        heading_x, heading_y = self._headings(None)
        self.velocity_x_mps = desired_speed_mps * heading_x
        self.velocity_y_mps = desired_speed_mps * heading_y

    def __len__(self) -> int:
        return len(self.x_m)

    @property
    def position_m(self) -> FloatArray:
        """(N, 2) where the people are."""
        return np.stack([self.x_m, self.y_m], axis=1)

    @property
    def velocity_mps(self) -> FloatArray:
        """(N, 2) how they move."""
        return np.stack([self.velocity_x_mps, self.velocity_y_mps], axis=1)

    def step(self, step_s: float, robot: RobotBody | None = None) -> None:
        """Move all people by one step. robot: None where they see none."""
        if not len(self):
            return
        force_x, force_y = self._forces(robot)
        velocity_x, velocity_y = self.velocity_x_mps, self.velocity_y_mps
        velocity_x += step_s * force_x
        velocity_y += step_s * force_y
        speed_mps = np.sqrt(velocity_x * velocity_x + velocity_y * velocity_y)
        fastest_mps = self._model.maximum_speed_ratio * self.desired_speed_mps
        scale = np.minimum(1.0, fastest_mps / np.maximum(speed_mps, 1e-9))
        velocity_x *= scale
        velocity_y *= scale
        self.x_m += step_s * velocity_x
        self.y_m += step_s * velocity_y
        if self._period_m > 0.0:
            np.mod(self.x_m, self._period_m, out=self.x_m)
        if self._walls.distance_m.size and self._walls.distance_m.min() < 2.0 * self.body_radius_m:
            self._leave_walls()

    def move(
        self, person: int, place_m: tuple[float, float], velocity_mps: tuple[float, float]
    ) -> None:
        """Set where a person is and how fast, after a push."""
        self.x_m[person], self.y_m[person] = place_m
        self.velocity_x_mps[person], self.velocity_y_mps[person] = velocity_mps

    def push_out_of(self, robot: RobotBody) -> None:
        """Move people who overlap the robot's footprint towards its edge; it does not move."""
        away_x, away_y = self.x_m - robot.x_m, self.y_m - robot.y_m
        distance = np.sqrt(away_x**2 + away_y**2)
        reach = self.body_radius_m + robot.radius_m
        inside = distance < reach
        if not inside.any():
            return
        apart = np.maximum(distance[inside], 1e-6)
        share = np.minimum(reach - apart, _LARGEST_PUSH_M) / apart
        self.x_m[inside] += share * np.where(distance[inside] > 1e-6, away_x[inside], 1e-6)
        self.y_m[inside] += share * away_y[inside]
        self._walls.update(self.x_m, self.y_m)
        self._leave_walls()

    def _forces(self, seen: RobotBody | None) -> tuple[FloatArray, FloatArray]:
        """(N,) x and y of dv/dt: relaxation, people, walls, fluctuation."""
        robot = seen or _NO_ROBOT
        self._walls.update(self.x_m, self.y_m)
        heading_x, heading_y = self._headings(seen)
        bodies = self._bodies(heading_x, heading_y, robot)
        people_x, people_y = np.zeros((2, len(self)))
        places = np.append(self.x_m, robot.x_m), np.append(self.y_m, robot.y_m)
        for pairs in self._neighbours.blocks(*places):
            push_x, push_y = self._model.people_force(pairs, bodies)
            people_x += push_x
            people_y += push_y
        wall_x, wall_y = self._model.wall_force(self._walls)
        noise = self._fluctuation_mps2 * self._rng.standard_normal((2, len(self)))
        rate, speed_mps = 1.0 / self._model.relaxation_time_s, self.desired_speed_mps
        lacks_x_mps = speed_mps * heading_x - self.velocity_x_mps
        lacks_y_mps = speed_mps * heading_y - self.velocity_y_mps
        return (
            rate * lacks_x_mps + people_x + wall_x + noise[0],
            rate * lacks_y_mps + people_y + wall_y + noise[1],
        )

    def _headings(self, robot: RobotBody | None) -> Force:
        """(N,) x and y of where people want to go; at most 1 for those who stand, past no robot."""
        headings = self._routes.headings(self.x_m, self.y_m)
        clearance_m = self._model.evasion_clearance_m
        if robot is not None and clearance_m is not None:
            to_x, to_y = robot.x_m - self.x_m, robot.y_m - self.y_m
            if self._period_m > 0.0:
                to_x -= np.rint(to_x / self._period_m) * self._period_m
            to_robot_m = to_x, to_y, np.maximum(np.hypot(to_x, to_y), _COINCIDENT_M)
            given = headings, self.desired_speed_mps, self._walls, self.body_radius_m
            headings = headings_around(robot, to_robot_m, *given, clearance_m)
        heading_x, heading_y = headings
        count = len(self._standing_m)
        if count:
            back_m = self._standing_m - self.position_m[-count:]
            way_m = np.maximum(np.hypot(back_m[:, 0], back_m[:, 1]), _AT_PLACE_M)
            heading_x[-count:], heading_y[-count:] = (back_m / way_m[:, None]).T
        return heading_x, heading_y

    def _bodies(self, heading_x: FloatArray, heading_y: FloatArray, robot: RobotBody) -> Bodies:
        """The people and, last, the robot; a robot at rest has no heading."""
        robot_x, robot_y = robot.velocity_x_mps, robot.velocity_y_mps
        robot_heading_x, robot_heading_y = _heading_of((robot_x, robot_y))
        return Bodies(
            heading_x=np.concatenate([heading_x, [robot_heading_x]]),
            heading_y=np.concatenate([heading_y, [robot_heading_y]]),
            velocity_x_mps=np.concatenate([self.velocity_x_mps, [robot_x]]),
            velocity_y_mps=np.concatenate([self.velocity_y_mps, [robot_y]]),
            robot_radius_m=robot.radius_m,
        )

    def _leave_walls(self) -> None:
        """Put back people who are too close to a wall, and take the velocity towards it."""
        self._walls.update(self.x_m, self.y_m)
        nearest = np.argmin(self._walls.distance_m, axis=1)
        rows = np.arange(len(self))
        distance = self._walls.distance_m[rows, nearest]
        closest = _CLOSEST_TO_WALL * self.body_radius_m
        close = distance < closest
        if not close.any():
            return
        rows, nearest, distance = rows[close], nearest[close], np.maximum(distance[close], 1e-9)
        away_x = self._walls.dx_m[rows, nearest] / distance
        away_y = self._walls.dy_m[rows, nearest] / distance
        self.x_m[rows] += (closest - distance) * away_x
        self.y_m[rows] += (closest - distance) * away_y
        inwards = self.velocity_x_mps[rows] * away_x + self.velocity_y_mps[rows] * away_y
        inwards = np.minimum(inwards, 0.0)
        self.velocity_x_mps[rows] -= inwards * away_x
        self.velocity_y_mps[rows] -= inwards * away_y


def _heading_of(velocity: tuple[float, float]) -> tuple[float, float]:
    speed = float(np.hypot(*velocity))
    return (velocity[0] / speed, velocity[1] / speed) if speed > 1e-6 else (0.0, 0.0)


#: Stands in for the loop of a person who stands.
_UNUSED_LOOP = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
_SPEED_DEVIATIONS = 2.0
_SLOWEST_MPS = 0.3


def people_per_loop(loops: tuple[Loop, ...], count: int) -> list[int]:
    """How many of `count` people walk each loop, by largest remainder of their shares."""
    wanted = np.array([loop.share for loop in loops])
    wanted = wanted / wanted.sum() * count
    people = np.floor(wanted).astype(int)
    for loop in np.argsort(people - wanted, kind="stable")[: count - int(people.sum())]:
        people[loop] += 1
    return [int(number) for number in people]


def start_crowd(
    settings: PedestrianSettings,
    loops: tuple[Loop, ...],
    walls_m: FloatArray,
    rng: np.random.Generator,
) -> Crowd:
    """Crowd spread over its loops, each walker at a random place, offset and wanted speed.

    Those who stand come last.
    """
    lines, shares = [], []
    for loop, people in zip(loops, people_per_loop(loops, settings.count), strict=True):
        corners = np.array(loop.waypoints_m)
        for place in range(people):
            offset = rng.uniform(-loop.lane_half_width_m, loop.lane_half_width_m)
            lines.append(offset_loop(corners, offset))
            shares.append((place + rng.uniform(0.0, 0.9)) / people)
    standing_m = np.array(settings.standing_m, dtype=np.float64).reshape(-1, 2)
    lines += [place + _UNUSED_LOOP for place in standing_m]
    routes = Routes(lines)
    x_m, y_m = routes.place(np.append(shares, np.zeros(len(standing_m))))
    walk = len(shares)
    x_m[walk:], y_m[walk:] = standing_m.T
    speeds = _truncated_speeds(settings, rng)
    return Crowd(
        model=model_named(settings.model),
        routes=routes,
        x_m=x_m,
        y_m=y_m,
        desired_speed_mps=np.append(speeds, np.full(len(standing_m), _BACK_TO_PLACE_MPS)),
        walls_m=walls_m,
        fluctuation_mps2=settings.fluctuation_mps2,
        rng=rng,
        standing_m=standing_m,
    )


def _truncated_speeds(settings: PedestrianSettings, rng: np.random.Generator) -> FloatArray:
    """(N,) wanted speeds from N(mean, deviation), drawn again beyond two deviations."""
    standard = rng.standard_normal(settings.count)
    while (beyond := np.abs(standard) > _SPEED_DEVIATIONS).any():
        standard[beyond] = rng.standard_normal(int(beyond.sum()))
    speed = settings.desired_speed_mean_mps + settings.desired_speed_deviation_mps * standard
    return np.maximum(speed, _SLOWEST_MPS)
