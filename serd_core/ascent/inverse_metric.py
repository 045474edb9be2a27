"""Inverse metrics B of quasi-Newton steps B g: a first one from a Hessian, and the BFGS update."""

import numpy as np

from serd_core.arrays import FloatArray

#: Smallest curvature, relative to the largest and to 1, that a first metric is made of.
LEAST_CURVATURE = 1e-6


def first_metric(hessian: FloatArray) -> FloatArray:
    """(n, n) inverse of the Hessian's absolute value, with a floor under its curvatures."""
    values, vectors = np.linalg.eigh(hessian)
    curvature = np.abs(values)
    floor = LEAST_CURVATURE * max(float(curvature.max(initial=0.0)), 1.0)
    return np.asarray((vectors / np.maximum(curvature, floor)) @ vectors.T)


def updated_metric(metric: FloatArray, moved: FloatArray, drop: FloatArray) -> FloatArray:
    """(n, n) BFGS update for a step `moved` (n,) that lowered the gradient by `drop` (n,).

    A step without curvature along it leaves the metric as it was.
    """
    curvature = float(moved @ drop)
    if not curvature > np.finfo(np.float64).eps * float(moved @ moved):
        return metric
    along = metric @ drop
    scale = (1.0 + float(drop @ along) / curvature) / curvature
    mixed = np.outer(moved, along) / curvature
    return np.asarray(metric + scale * np.outer(moved, moved) - mixed - mixed.T)
