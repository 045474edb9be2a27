"""Times in cells of recorded drives, as a law that the model file keeps.

The time until a cell is left is that of `serd_core.arrival.dwell_times`: a gamma distribution whose
mean depends on flow, turn, first cell and number of people, with a pace of each drive. A flow or
kind of move of which there are no crossings has the coefficient of the most frequent one.
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from os.path import realpath
from pathlib import Path

import numpy as np
from scipy.special import ndtri

from serd_app.demonstrations.crossing_table import FLOWS, LEAVING, Crossing, load_crossings
from serd_app.errors import AppError
from serd_bag.quantities import counted
from serd_core.arrays import FloatArray, IntArray
from serd_core.arrival.crossing_chain import Kind
from serd_core.arrival.dwell_times import DwellModel, Pace, fit_dwell_times
from serd_core.errors import SerdError
from serd_core.grid.grid import Outcome
from serd_files.model_file import CROSSING_COVARIATES as COVARIATES
from serd_files.model_file import CrossingTimes

#: Fewest episodes from which the differences between drives are estimated.
FEWEST_EPISODES = 3
_LEAST_SPREAD = 1e-9
_KINDS = tuple(kind.value for kind in Kind)


def load_times(paths: Sequence[Path]) -> tuple[CrossingTimes, ...]:
    """The law of each look-ahead in tables of crossings; AppError where there are too few."""
    twice = [path for path, n in Counter(map(realpath, paths)).items() if n > 1]
    if twice:
        raise AppError(f"--times must name each table once, got {twice[0]} twice; leave out one")
    tables = [load_crossings(path) for path in paths]
    ahead = sorted({row.lookahead_cells for table in tables for row in table})
    if paths and not ahead:
        raise AppError(f"--times must hold crossings, got none in {paths[0]}; drive more episodes")
    return tuple(
        fit_crossing_times(
            [[row for row in table if row.lookahead_cells == cells] for table in tables]
        )
        for cells in ahead
    )


def fit_crossing_times(tables: Sequence[Sequence[Crossing]]) -> CrossingTimes:
    """The law of crossings with one look-ahead; episodes of different tables are different ones."""
    rows = [(number, row) for number, table in enumerate(tables) for row in table]
    labels = np.array([(number, row.episode) for number, row in rows])
    episodes, drive = np.unique(labels, axis=0, return_inverse=True)
    if len(episodes) < FEWEST_EPISODES:
        raise AppError(
            f"--times must have at least {FEWEST_EPISODES} episodes per look-ahead, got"
            f" {len(episodes)}; drive more"
        )
    every = [row for _, row in rows]
    people = np.array([row.people_pm2 for row in every])
    mean_people = float(people.mean())
    kind = np.array([_KINDS.index(row.kind) for row in every])
    seen = {"flow": Counter(row.flow for row in every), "kind": Counter(row.kind for row in every)}
    used = _Contrasts(*(tuple(name for name, _ in each.most_common()) for each in seen.values()))
    design = np.array(
        [used.row(each.flow, each.kind, each.people_pm2 - mean_people) for each in every]
    )
    try:
        model = fit_dwell_times(
            np.array([row.dwell_s for row in every]), design, kind, drive.ravel(), len(_KINDS)
        )
    except SerdError as error:
        raise AppError(f"--times: {error}") from None
    if not model.converged:
        raise AppError("--times: the fit of the times did not converge; drive more episodes")
    return CrossingTimes(
        lookahead_cells=every[0].lookahead_cells,
        coefficients=used.coefficients(model.coefficients),
        dispersion=dict(zip(_KINDS, model.dispersion.tolist(), strict=True)),
        pace_variance=model.pace_variance,
        people_pm2=(float(people.min()), float(people.max())),
        mean_people_pm2=mean_people,
        left_towards={flow: _counts(every, flow) for flow in FLOWS},
        not_seen=tuple(
            name
            for names, counts in ((FLOWS, seen["flow"]), (_KINDS, seen["kind"]))
            for name in names
            if not counts[name]
        ),
        n_crossings=len(every),
        n_episodes=len(episodes),
    )


@dataclass(frozen=True)
class _Contrasts:
    """The flows and kinds that were seen, the most frequent first, with which others compare."""

    flows: tuple[str, ...]
    kinds: tuple[str, ...]

    def row(self, flow: str, kind: str, people_pm2: float) -> tuple[float, ...]:
        """Of the design: 1, the others of the flows and of the kinds, people."""
        named = (*self.flows[1:], *self.kinds[1:])
        return (1.0, *(float(name in (flow, kind)) for name in named), people_pm2)

    def coefficients(self, fitted: FloatArray) -> dict[str, float]:
        """Of `COVARIATES`, which compare with moves straight on with the flow."""
        first, *others, people = fitted.tolist()
        effect = dict(zip((*self.flows[1:], *self.kinds[1:]), others, strict=True))
        base = {
            **dict.fromkeys(FLOWS, effect.get(FLOWS[0], 0.0)),
            **dict.fromkeys(_KINDS, effect.get(Kind.STRAIGHT.value, 0.0)),
        }
        found = {name: effect.get(name, 0.0) - base.get(name, 0.0) for name in COVARIATES}
        found["intercept"] = first + base[FLOWS[0]] + base[Kind.STRAIGHT.value]
        return {**found, "people_pm2": people}


def _counts(rows: Sequence[Crossing], flow: str) -> tuple[int, int, int, int]:
    found = Counter(row.outcome for row in rows if row.action_flow == flow)
    forward, right, back, left = (found[name] for name in LEAVING)
    return forward, right, back, left


def leaving_outcomes(times: CrossingTimes, table: FloatArray) -> FloatArray:
    """(M, K) outcomes given that the cell is left: counted in drives, the model's as prior.

    table: (M, K) outcomes of a decision period. The prior counts as much as one crossing.
    """
    leaving = np.array(table, dtype=np.float64)
    leaving[:, Outcome.STAY] = 0.0
    leaving /= np.maximum(leaving.sum(axis=1, keepdims=True), np.finfo(float).tiny)
    for model, flow in enumerate(FLOWS):
        counts = np.array([0, *times.left_towards[flow]])
        leaving[model] = (counts + leaving[model]) / (counts.sum() + 1.0)
    stays = 1.0 - leaving.sum(axis=1)
    leaving[:, Outcome.STAY] += np.maximum(stays, 0.0)
    return leaving


def dwell_model(times: CrossingTimes) -> DwellModel:
    """The law as it was fitted."""
    return DwellModel(
        np.array([times.coefficients[name] for name in COVARIATES]),
        np.array([times.dispersion[kind] for kind in _KINDS]),
        times.pace_variance,
    )


def pace_of_a_drive(times: CrossingTimes) -> Pace:
    """Of a new drive: its spread, and what the mean of so many drives leaves open."""
    return Pace(0.0, times.pace_variance * (1.0 + 1.0 / times.n_episodes))


def paces_of_draws(times: CrossingTimes, n_draws: int) -> tuple[Pace, ...]:
    """The same as `n_draws` equally likely means, which all drives share, and their own spread."""
    means = ndtri((np.arange(n_draws) + 0.5) / n_draws)
    spread = np.sqrt(times.pace_variance / times.n_episodes) / max(means.std(), _LEAST_SPREAD)
    return tuple(Pace(float(spread * mean), times.pace_variance) for mean in means)


def mean_and_kind(
    times: CrossingTimes, flow: str, kind: Kind, people_pm2: float
) -> tuple[FloatArray, IntArray]:
    """(1,) mean (s) and (1,) place of the kind of one class of moves, at the pace of the mean."""
    named = {flow, kind.value, "intercept"}
    row = [float(name in named) for name in COVARIATES[:-1]]
    design = np.array([[*row, people_pm2 - times.mean_people_pm2]])
    return dwell_model(times).mean_s(design), np.array([_KINDS.index(kind.value)])


def times_sentence(times: CrossingTimes) -> str:
    """The usual time in a cell, how much drives differ, and from what it is known."""
    usual_s = mean_and_kind(times, FLOWS[0], Kind.STRAIGHT, times.mean_people_pm2)[0][0]
    return (
        f"look-ahead {times.lookahead_cells}: {usual_s:.2f} s per cell straight on with the flow,"
        f" drives differ by {100 * np.sqrt(times.pace_variance):.1f} %, from"
        f" {times.n_crossings} crossings of {counted(times.n_episodes, 'drive')}"
    )


def unseen_sentence(times: CrossingTimes) -> str:
    """A warning about flows and kinds of moves without crossings; empty where there are none."""
    if not times.not_seen:
        return ""
    names = ", ".join(times.not_seen)
    return (
        f"look-ahead {times.lookahead_cells}: no crossing was {names}; such times are predicted as"
        " those of the most frequent flow and kind: drive where there are some"
    )
