"""The functions of `compiled` by numba: importing this module takes half a second.

They do what is exact in every library: sums in the written order, products, quotients, roots and
comparisons. Exponentials, sines, hypotenuses and sums by `einsum` or `mean` stay with NumPy. Each
has its documentation and its types where its twin in NumPy is.
"""

from collections.abc import Callable
from typing import Any

import numba
import numpy as np

COMPILED: dict[str, Callable[..., Any]] = {}
# numba keeps what it compiles until this file changes, so no constant of another module is used.
_njit: Any = numba.njit(cache=True, error_model="numpy")


def _compiled(function: Callable[..., Any]) -> Callable[..., Any]:
    compiled: Callable[..., Any] = _njit(function)
    COMPILED[function.__name__] = compiled
    return compiled


@_compiled
def measure_pairs(x_m, y_m, period_m, dx_m, dy_m, distance_m):
    n_people, n_bodies = distance_m.shape
    for i in range(n_people):
        for j in range(n_bodies):
            dx, dy = x_m[i] - x_m[j], y_m[i] - y_m[j]
            if period_m > 0.0:
                dx -= np.rint(dx / period_m) * period_m
            dx_m[i, j], dy_m[i, j] = dx, dy
            distance_m[i, j] = np.sqrt(dx * dx + dy * dy)


@_compiled
def measure_walls(x_m, y_m, start_m, unit, length_m, dx_m, dy_m, distance_m, share):
    for i in range(len(x_m)):
        for w in range(len(length_m)):
            dx, dy = x_m[i] - start_m[0, w], y_m[i] - start_m[1, w]
            position = dx * unit[0, w] + dy * unit[1, w]
            clipped = min(max(position, 0.0), length_m[w])
            share[i, w] = 1.0 if position == clipped else 0.5
            dx -= clipped * unit[0, w]
            dy -= clipped * unit[1, w]
            dx_m[i, w], dy_m[i, w] = dx, dy
            distance_m[i, w] = np.sqrt(dx * dx + dy * dy)


@_compiled
def predicted_repulsion(
    dx_m,
    dy_m,
    distance_m,
    velocity_x_mps,
    velocity_y_mps,
    heading_x,
    heading_y,
    reach_m,
    core_reach_m,
    constants,
):
    foresight_s, decay_m, core_decay_m, anisotropy, standing_m2ps2, coincident_m = constants
    away_x, away_y, exponent, weight, per_metre, core = np.empty((6, *dx_m.shape))
    for i in range(dx_m.shape[0]):
        for j in range(dx_m.shape[1]):
            dx, dy = dx_m[i, j], dy_m[i, j]
            closing_x = velocity_x_mps[i] - velocity_x_mps[j]
            closing_y = velocity_y_mps[i] - velocity_y_mps[j]
            squared = max(closing_x * closing_x + closing_y * closing_y, standing_m2ps2)
            time_s = min(max(-(dx * closing_x + dy * closing_y) / squared, 0.0), foresight_s)
            x, y = dx + time_s * closing_x, dy + time_s * closing_y
            distance = max(np.sqrt(x * x + y * y), coincident_m)
            away_x[i, j], away_y[i, j] = x, y
            exponent[i, j] = min((reach_m[j] - distance) / decay_m, 3.0)
            cosine = -(dx * heading_x[i] + dy * heading_y[i]) / distance_m[i, j]
            weight[i, j] = anisotropy + (1.0 - anisotropy) * 0.5 * (1.0 + cosine)
            per_metre[i, j] = (1.0 if np.isfinite(distance_m[i, j]) else 0.0) / distance
            core[i, j] = min((core_reach_m[j] - distance_m[i, j]) / core_decay_m, 3.0)
    return away_x, away_y, exponent, weight, per_metre, core


@_compiled
def headings_past(
    to_x, to_y, distance, wanted_x, wanted_y, speed_mps, velocity_mps, circle_m, noticed_m, walls
):
    past_x, past_y = wanted_x.copy(), wanted_y.copy()
    for i in range(len(to_x)):
        ahead = wanted_x[i] * to_x[i] + wanted_y[i] * to_y[i]
        aside = wanted_x[i] * to_y[i] - wanted_y[i] * to_x[i]
        outrun = velocity_mps[0] * to_x[i] + velocity_mps[1] * to_y[i]
        if not (ahead > 0.0 and abs(aside) < circle_m and distance[i] < circle_m + noticed_m):
            continue
        if not speed_mps[i] * ahead > outrun:
            continue
        x, y = to_x[i] / distance[i], to_y[i] / distance[i]
        on_left = _has_room(circle_m * -y, circle_m * x, walls)
        on_right = _has_room(-(circle_m * -y), -(circle_m * x), walls)
        sine = min(circle_m / distance[i], 1.0)
        cosine = np.sqrt(1.0 - sine * sine)
        if not (aside <= 0.0 if on_left == on_right else on_left):
            sine = -sine
        past_x[i], past_y[i] = cosine * x - sine * y, cosine * y + sine * x
    return past_x, past_y


@_njit
def _has_room(x, y, walls):
    start_m, unit, length_m, radius_m = walls
    for w in range(len(length_m)):
        start_x, start_y, unit_x, unit_y = start_m[0, w], start_m[1, w], unit[0, w], unit[1, w]
        dx, dy = x - start_x, y - start_y
        position = min(max(dx * unit_x + dy * unit_y, 0.0), length_m[w])
        away_x, away_y = dx - position * unit_x, dy - position * unit_y
        if np.sqrt(away_x * away_x + away_y * away_y) < radius_m:
            return False
        side = unit_x * dy - unit_y * dx
        side_of_origin = unit_x * -start_y - unit_y * -start_x
        end_x, end_y = start_x + length_m[w] * unit_x, start_y + length_m[w] * unit_y
        side_of_start, side_of_end = x * start_y - y * start_x, x * end_y - y * end_x
        if side == 0.0 and side_of_origin == 0.0:
            start, end = x * start_x + y * start_y, x * end_x + y * end_y
            if max(start, end) >= 0.0 and min(start, end) <= x * x + y * y:
                return False
        elif side * side_of_origin <= 0.0 and side_of_start * side_of_end <= 0.0:
            return False
    return True


@_compiled
def headings_on_legs(x_m, y_m, legs, look_ahead_m, reached_m):
    heading_x, heading_y = np.empty((2, len(x_m)))
    reached = np.empty(len(x_m), dtype=np.bool_)
    for i in range(len(x_m)):
        start_x, start_y, unit_x, unit_y, length = legs[:, i]
        along = (x_m[i] - start_x) * unit_x + (y_m[i] - start_y) * unit_y
        reached[i] = along > length - reached_m
        ahead = min(max(along, 0.0) + look_ahead_m, length)
        to_x, to_y = start_x + ahead * unit_x - x_m[i], start_y + ahead * unit_y - y_m[i]
        distance = max(np.sqrt(to_x * to_x + to_y * to_y), 1e-9)
        heading_x[i], heading_y[i] = to_x / distance, to_y / distance
    return heading_x, heading_y, reached


@_compiled
def total_force(rate, speed_mps, heading, velocity_mps, people, wall, noise):
    force = np.empty(len(velocity_mps))
    for i in range(len(force)):
        wanted = rate * (speed_mps[i] * heading[i] - velocity_mps[i])
        force[i] = wanted + people[i] + wall[i] + noise[i]
    return force


@_compiled
def walk(x_m, y_m, velocity_x_mps, velocity_y_mps, force_x, force_y, fastest_mps, step_s):
    for i in range(len(x_m)):
        vx, vy = velocity_x_mps[i] + step_s * force_x[i], velocity_y_mps[i] + step_s * force_y[i]
        speed_mps = np.sqrt(vx * vx + vy * vy)
        scale = min(1.0, fastest_mps[i] / max(speed_mps, 1e-9))
        velocity_x_mps[i], velocity_y_mps[i] = vx * scale, vy * scale
        x_m[i] += step_s * velocity_x_mps[i]
        y_m[i] += step_s * velocity_y_mps[i]


@_compiled
def range_to_lines(to_x, to_y, along_m, ray_x, ray_y):
    nearest = np.full(len(ray_x), np.inf)
    for s in range(len(to_x)):
        along_x, along_y = along_m[s]
        across = to_x[s] * along_y - to_y[s] * along_x
        for r in range(len(ray_x)):
            turn = ray_x[r] * along_y - ray_y[r] * along_x
            if abs(turn) < 1e-12:
                turn = 1e-12
            distance = across / turn
            share = (to_x[s] * ray_y[r] - to_y[s] * ray_x[r]) / turn
            if distance > 0.0 and -1e-9 <= share <= 1.0 + 1e-9:
                nearest[r] = min(nearest[r], distance)
    return nearest


@_compiled
def range_to_circles(to_x, to_y, radius_squared, ray_x, ray_y):
    nearest = np.full(len(ray_x), np.inf)
    for k in range(len(to_x)):
        squared = to_x[k] * to_x[k] + to_y[k] * to_y[k]
        for r in range(len(ray_x)):
            along = ray_x[r] * to_x[k] + ray_y[r] * to_y[k]
            inside = radius_squared - (squared - along * along)
            if inside > 0.0 and along > 0.0:
                nearest[r] = min(nearest[r], along - np.sqrt(inside))
    return nearest


@_compiled
def nearest_wall(distance_m, x_m, y_m, origin_m, scale, nearest_m, n_soon):
    rows, columns = distance_m.shape
    shape, n_times = x_m.shape[:-1], x_m.shape[-1]
    x, y = x_m.reshape(-1, n_times), y_m.reshape(-1, n_times)
    least, too_close = np.full(len(x), np.inf), np.empty((len(x), n_soon), dtype=np.bool_)
    for i in range(x.shape[0]):
        for t in range(n_times):
            # Comparisons that are false of NaN: an index is within the raster in any case.
            across, up = (x[i, t] - origin_m[0]) * scale, (y[i, t] - origin_m[1]) * scale
            column = int(min(across, columns - 1.0)) if across > 0.0 else 0
            row = int(min(up, rows - 1.0)) if up > 0.0 else 0
            away_m = distance_m[row, column]
            least[i] = min(least[i], away_m)
            if t < n_soon:
                too_close[i, t] = away_m < nearest_m
    return least.reshape(shape), too_close.reshape((*shape, n_soon))


@_compiled
def predicted(position_m, velocity_mps, x_m, y_m, range_m, most, time_s):
    squared = np.empty(len(position_m))
    near = np.empty(len(position_m), dtype=np.intp)
    n_near = 0
    for i in range(len(position_m)):
        away_x, away_y = position_m[i, 0] - x_m, position_m[i, 1] - y_m
        squared[i] = away_x * away_x + away_y * away_y
        if squared[i] < range_m * range_m:
            near[n_near] = i
            n_near += 1
    if n_near > most:
        for rank in range(most):  # the first ones in the order of a stable sort
            first = rank
            for other in range(rank + 1, n_near):
                if squared[near[other]] < squared[near[first]]:
                    first = other
            nearest = near[first]
            near[rank + 1 : first + 1] = near[rank:first].copy()
            near[rank] = nearest
        n_near = most
    then_x, then_y = np.empty((2, n_near, len(time_s)))
    now_x, now_y = np.empty((2, n_near, 1))
    for k in range(n_near):
        now_x[k, 0], now_y[k, 0] = position_m[near[k], 0], position_m[near[k], 1]
        vx, vy = velocity_mps[near[k], 0], velocity_mps[near[k], 1]
        if not (np.isfinite(vx) and np.isfinite(vy)):
            vx = vy = 0.0
        for t in range(len(time_s)):
            then_x[k, t] = now_x[k, 0] + vx * time_s[t]
            then_y[k, t] = now_y[k, 0] + vy * time_s[t]
    return then_x, then_y, now_x, now_y


@_compiled
def distance_to_nearest(x_m, y_m, people_x_m, people_y_m):
    n_points, n_times = x_m.shape[-1], people_x_m.shape[1]
    all_x = np.ascontiguousarray(x_m).reshape(-1, n_points)
    all_y = np.ascontiguousarray(y_m).reshape(-1, n_points)
    nearest = np.full((len(all_x), max(n_points, n_times)), np.inf)
    moves, walk = min(n_points - 1, 1), min(n_times - 1, 1)
    for i in range(nearest.shape[0]):
        x, y, squared = all_x[i], all_y[i], nearest[i]
        for k in range(len(people_x_m)):
            person_x, person_y = people_x_m[k], people_y_m[k]
            if n_points == n_times:  # apart, so that the processor's vectors are used
                for t in range(n_times):
                    dx, dy = x[t] - person_x[t], y[t] - person_y[t]
                    squared[t] = min(squared[t], dx * dx + dy * dy)
            else:
                for t in range(len(squared)):
                    dx, dy = x[moves * t] - person_x[walk * t], y[moves * t] - person_y[walk * t]
                    squared[t] = min(squared[t], dx * dx + dy * dy)
        for t in range(len(squared)):
            squared[t] = np.sqrt(squared[t])
    return nearest.reshape((*x_m.shape[:-1], nearest.shape[1]))


@_compiled
def nearest_person(x_m, y_m, people_x_m, people_y_m, reach_m, nearest_m, decay_m):
    shape, n_times, n_soon = x_m.shape[:-1], x_m.shape[-1], len(nearest_m)
    exponent = distance_to_nearest(x_m, y_m, people_x_m, people_y_m).reshape(-1, n_times)
    too_close = np.empty((len(exponent), n_soon), dtype=np.bool_)
    for i in range(exponent.shape[0]):
        for t in range(n_times):
            gap_m = exponent[i, t] - reach_m
            if t < n_soon:
                too_close[i, t] = gap_m < nearest_m[t]
            exponent[i, t] = max(gap_m, -decay_m) / -decay_m
    return exponent.reshape(x_m.shape), too_close.reshape((*shape, n_soon))


@_compiled
def ramp(start, wanted, limit, time_s):
    ramped = np.empty((len(wanted), len(time_s)))
    for i in range(len(wanted)):
        for t in range(len(time_s)):
            reach = limit * time_s[t]
            ramped[i, t] = start + min(max(wanted[i] - start, -reach), reach)
    return ramped


@_compiled
def positions(start_m, speed_mps, direction, step_s):
    along = np.empty((speed_mps.shape[0], *direction.shape))
    for v in range(along.shape[0]):
        for w in range(along.shape[1]):
            total = 0.0
            for t in range(along.shape[2]):
                total += speed_mps[v, t] * direction[w, t]
                along[v, w, t] = total * step_s + start_m
    return along


@_compiled
def shortest_so_far(x_m, y_m, to_x_m, to_y_m):
    all_x = np.ascontiguousarray(x_m).reshape(-1, x_m.shape[-1])
    all_y = np.ascontiguousarray(y_m).reshape(-1, x_m.shape[-1])
    shortest, last = np.empty(all_x.shape), np.empty(len(all_x))
    for i in range(len(all_x)):
        least = np.inf
        for t in range(all_x.shape[1]):
            dx, dy = all_x[i, t] - to_x_m, all_y[i, t] - to_y_m
            last[i] = np.sqrt(dx * dx + dy * dy)
            least = min(least, last[i])
            shortest[i, t] = least
    return shortest.reshape(x_m.shape), last.reshape(x_m.shape[:-1])


@_compiled
def largest_product(values, factors):
    rows = values.reshape(-1, values.shape[-1])
    largest = np.full(len(rows), -np.inf)
    for i in range(rows.shape[0]):
        for t in range(rows.shape[1]):
            largest[i] = max(largest[i], rows[i, t] * factors[t])
    return largest.reshape(values.shape[:-1])


@_compiled
def nearest_now(x_m, y_m, people_x_m, people_y_m, reach_m, largest_m, nearest_m):
    n_times, range_m = x_m.shape[-1], reach_m + largest_m
    x = np.ascontiguousarray(x_m).reshape(-1, n_times)
    y = np.ascontiguousarray(y_m).reshape(-1, n_times)
    west, east, south, north = x.min(), x.max(), y.min(), y.max()
    too_close = np.zeros(x.shape, dtype=np.bool_)
    for k in range(len(people_x_m)):
        person_x, person_y = people_x_m[k, 0], people_y_m[k, 0]
        if not (west - range_m < person_x < east + range_m):
            continue
        if not (south - range_m < person_y < north + range_m):
            continue
        for i in range(x.shape[0]):
            for t in range(n_times):
                dx, dy = x[i, t] - person_x, y[i, t] - person_y
                too_close[i, t] |= np.sqrt(dx * dx + dy * dy) - reach_m < nearest_m[0]
    return too_close.reshape(x_m.shape)


@_compiled
def any_before(at_wall, at_person, soon):
    n_times = at_wall.shape[-1]
    found = np.zeros(at_wall.shape[:-1], dtype=np.bool_)
    if n_times == 0:
        return found
    rows = found.reshape(-1)
    wall, person = at_wall.reshape(-1, n_times), at_person.reshape(-1, n_times)
    when = soon.reshape(-1, n_times)
    n_alike = len(rows) // max(len(when), 1)
    for i in range(len(rows)):
        for t in range(n_times):
            if when[i // n_alike, t] and (wall[i, t] or person[i, t]):
                rows[i] = True
    return found
