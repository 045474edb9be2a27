"""Gamma laws of dwell times: discount, density and survival with derivatives of second order.

A law has the mean mu = exp(l) seconds and the shape a = exp(s), so the scale mu / a and the squared
coefficient of variation 1 / a. With g = -log gamma, gamma per second, and y = 1 + mu g / a,

    E[gamma^tau] = y^(-a)
    d log E / dl = -mu g / y,    d log E / ds = -a log y + mu g / y

Of the survival function Q(a, z) = P(tau > t), z = a t / mu, v the logarithm of a gamma variable of
shape a and scale 1, and E, Var taken given v > log z,

    d log Q / da = E[v] - psi(a),    d2 log Q / da2 = Var[v] - psi'(a)
    d log Q / d log z = -h,          h = z^a exp(-z) / (Gamma(a) Q)

The moments of v are integrals of exp(a v - exp(v)) by Gauss and Legendre's rule, from log z to
where this is below exp(-DROP) of its largest value. It is log-concave, so that is one interval.
"""

from typing import NamedTuple

import numpy as np

from serd_core.arrays import FloatArray

#: Nats below the largest value at which an integrand ends; steps to find where that is.
DROP, STEPS = 38.0, 12
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(56)


class ByMeanAndShape(NamedTuple):
    """A function of (l, s), elementwise: value, first and second derivatives."""

    value: FloatArray
    mean: FloatArray
    shape: FloatArray
    mean_mean: FloatArray
    mean_shape: FloatArray
    shape_shape: FloatArray


def log_discount(log_mean: FloatArray, log_shape: FloatArray, rate: float) -> ByMeanAndShape:
    """log E[gamma^tau], rate = -log gamma per second."""
    shape, cost = np.exp(log_shape), np.exp(log_mean) * rate
    share = cost / shape
    y = 1.0 + share
    value, slope = -shape * np.log1p(share), cost / y
    bend = slope * share / y
    return ByMeanAndShape(value, -slope, value + slope, -slope / y, -bend, value + slope + bend)


def _of_shapes(log_shape: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """a, log Gamma(a), psi(a) and psi'(a) of logarithms of which many are equal."""
    # Here: what only discounts, as a robot does that drives, needs no package of SciPy.
    from scipy.special import digamma, gammaln, polygamma

    distinct, place = np.unique(log_shape, return_inverse=True)
    a, place = np.exp(distinct), place.reshape(np.shape(log_shape))
    return a[place], gammaln(a)[place], digamma(a)[place], polygamma(1, a)[place]


def log_density(
    log_dwell: FloatArray, log_mean: FloatArray, log_shape: FloatArray
) -> ByMeanAndShape:
    """Log density at dwell times in seconds, given by their logarithms."""
    a, log_gamma, psi, psi_slope = _of_shapes(log_shape)
    away = log_dwell - log_mean
    x = np.exp(away)
    value = a * (log_shape + away - x) - log_gamma - log_dwell
    by_mean = a * (x - 1.0)
    by_shape = a * (log_shape + 1.0 + away - x - psi)
    bend = by_shape + a - a**2 * psi_slope
    return ByMeanAndShape(value, by_mean, by_shape, -a * x, by_mean, bend)


def fisher_information(log_shape: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Of a dwell time about l and about s, a and a^2 psi'(a) - a; between them there is none."""
    a, _, _, psi_slope = _of_shapes(log_shape)
    return a, a**2 * psi_slope - a


def log_survival(
    log_dwell: FloatArray, log_mean: FloatArray, log_shape: FloatArray
) -> ByMeanAndShape:
    """Log probability that a dwell time is above the given ones."""
    a, log_gamma, psi, psi_slope = _of_shapes(log_shape)
    log_z = log_shape + log_dwell - log_mean
    z = np.exp(log_z)
    log_mass, mean, variance = _truncated(log_shape, log_z)
    log_q = np.minimum(log_mass - log_gamma, 0.0)
    hazard = np.exp(a * log_z - z - log_gamma - log_q)
    turn = hazard * (a - z + hazard)
    pull = a * hazard * (log_z - mean)
    above = a * (mean - psi)
    spread = a**2 * (variance - psi_slope)
    return ByMeanAndShape(
        log_q, hazard, above - hazard, -turn, turn + pull, above + spread - turn - 2.0 * pull
    )


def _truncated(
    log_shape: FloatArray, log_z: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """log of Gamma(a) Q, and mean and variance of v given v > log z."""
    a, top = np.exp(log_shape), np.maximum(log_z, log_shape)
    largest = np.exp(top)
    first, last = np.maximum(log_z, top - _below(a)), top + _above(a, largest)
    half = 0.5 * (last - first)
    # Distances from the top, where the integrand is largest, keep digits for large shapes.
    away = (first - top + half)[..., None] + half[..., None] * _NODES
    logs = a[..., None] * away - largest[..., None] * np.expm1(away)
    mass = half[..., None] * _WEIGHTS * np.exp(logs)
    total = mass.sum(axis=-1)
    mean = np.sum(mass * away, axis=-1) / total
    variance = np.sum(mass * (away - mean[..., None]) ** 2, axis=-1) / total
    return np.log(total) + a * top - largest, top + mean, variance


def _above(shape: FloatArray, largest: FloatArray) -> FloatArray:
    """d > 0 with largest (exp(d) - 1) - shape d = DROP, by Newton's method from above."""
    gap = largest - shape
    d = np.minimum(
        (np.sqrt(gap**2 + 2.0 * DROP * largest) - gap) / largest,
        np.log1p((DROP + shape * (1.0 + DROP / shape)) / largest) + 1.0,
    )
    for _ in range(STEPS):
        d = d - (largest * np.expm1(d) - shape * d - DROP) / (largest * np.exp(d) - shape)
    return np.asarray(d)


def _below(shape: FloatArray) -> FloatArray:
    """d > 0 with shape (d - 1 + exp(-d)) = DROP, in the same way."""
    d = DROP / shape + 1.0
    for _ in range(STEPS):
        d = d - (d + np.expm1(-d) - DROP / shape) / -np.expm1(-d)
    return np.asarray(d)
