"""Objectives whose maxima are known, for tests of ascents."""

import numpy as np

CURVATURE = np.diag([1.0, 10.0])
TOP = np.array([3.0, -2.0])


def quadratic(vector):
    away = vector - TOP
    return 5.0 - 0.5 * away @ CURVATURE @ away, -CURVATURE @ away


def valley(vector):
    """Rosenbrock's, upside down."""
    x, y = vector
    value = -((1 - x) ** 2 + 100 * (y - x**2) ** 2)
    return value, np.array([2 * (1 - x) + 400 * x * (y - x**2), -200 * (y - x**2)])


def never(_):
    """A callback that stops no ascent."""
    return False
