"""Pictures of policies, values, occupancy, outcome models, arrivals and learning curves.

Each function draws into `axes` and returns them; without axes it makes a figure. Further keywords
are those of the function of Matplotlib that draws. No other module of the package uses Matplotlib:
`pip install serd-core[plots]`.

Maps take `cells`: a `serd_core.grid.grid.Grid`, or (rows, columns) of states that are numbered row
by row from the top left, as those of Gymnasium's FrozenLake are.
"""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from serd_core import checks
from serd_core.arrays import FloatArray, IntArray
from serd_core.arrival.law import ArrivalLaw, EmpiricalArrival, sampling_band
from serd_core.demonstrations.decisions import Decisions, state_counts
from serd_core.grid.grid import DIRECTION_VECTORS, Grid
from serd_core.policies.solved_policy import Policy

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Cells: TypeAlias = Grid | tuple[int, int]
Look: TypeAlias = dict[str, Any]

#: Steps (east, north) of the actions of FrozenLake: left, down, right, up.
LAKE_DIRECTIONS = ((-1, 0), (0, -1), (1, 0), (0, 1))
_INK = "#26323d"
#: Widest shaft of an arrow, and the same in sides of its cell.
_SHAFT_IN, _SLENDER = 0.016, 0.11
#: Length of the one arrow of a state, and of the arrow of a certain action, in sides of the cell.
_ONE, _CERTAIN = 0.8, 0.48
#: Probability of an action up to which it has no arrow.
_RARE = 0.01
#: Width of all bars of one outcome.
_GROUP = 0.76


def values(
    value: ArrayLike, cells: Cells, axes: "Axes | None" = None, *, label: str = "value", **look: Any
) -> "Axes":
    """Draw a number of each state (S,) as the shade of its cell.

    label: of the colour bar; an empty one leaves the bar out.

        plots.values(sc.soft_policy(problem, weights, table).value, (5, 5))
    """
    axes, centers, side = _map(axes, cells)
    from matplotlib.collections import PatchCollection
    from matplotlib.patches import Rectangle

    squares = [Rectangle((x - side / 2, y - side / 2), side, side) for x, y in centers]
    looks: Look = {"cmap": "Blues", "alpha": 0.7, "edgecolor": "#ffffff", "linewidth": 0.4}
    drawn = PatchCollection(squares, **looks | {"zorder": 1} | look)
    drawn.set_array(np.asarray(checks.float_array("value", value, (len(centers),))))
    axes.add_collection(drawn)
    if label:
        axes.figure.colorbar(drawn, ax=axes, label=label)
    return axes


def occupancy(
    visits: Decisions | ArrayLike, cells: Cells, axes: "Axes | None" = None, **look: Any
) -> "Axes":
    """Draw how often each state is visited.

    visits: decisions, or numbers (S,). Others as in `values`.

        plots.occupancy(decisions, (5, 5))
    """
    axes, centers, _ = _map(axes, cells)
    if isinstance(visits, Decisions):
        visits = state_counts(visits, len(centers))
    return values(visits, cells, axes, **{"cmap": "Reds", "label": "decisions in the cell"} | look)


def policy(
    policy: Policy | ArrayLike,
    cells: Cells,
    axes: "Axes | None" = None,
    *,
    directions: ArrayLike | None = None,
    colours: str | Sequence[str] = _INK,
) -> "Axes":
    """Draw a policy as arrows of its actions; an action that leads nowhere is a dot.

    policy: what `soft_policy` returns, or probabilities (S, A), which are the lengths of arrows; or
    one action of each state (S,), -1 for none. States of a `Policy` without a choice have none.
    directions: (A, 2) steps (east, north) of actions; None for those of a `Grid` (`Action`), and
    left, down, right, up (FrozenLake) where there is none. colours: one, or one of each state.

        plots.policy(sc.soft_policy(problem, weights, table), (5, 5), directions=steps)
    """
    axes, centers, side = _map(axes, cells)
    state, action, chance = _arrows(policy, len(centers))
    default = DIRECTION_VECTORS if isinstance(cells, Grid) else LAKE_DIRECTIONS
    steps = checks.float_array(
        "directions", default if directions is None else directions, (None, 2)
    )
    checks.require_index("policy: actions", action, len(steps), "an action that directions have")
    panel, extent = axes.get_window_extent(), np.ptp(centers, axis=0) / side + 1
    cell_in = min(panel.width / extent[0], panel.height / extent[1]) / axes.figure.dpi
    width_in = min(_SHAFT_IN, _SLENDER * float(cell_in))
    ink, moving = np.resize(colours, len(centers))[state], steps[action].any(axis=1)
    several = len(np.unique(state)) < len(state)
    shift = (_CERTAIN if several else _ONE) * side * chance[:, None] * steps[action]
    tail = centers[state] - (0.0 if several else 0.5) * shift
    if moving.any():
        heads = {"headwidth": 4.5, "headlength": 4.5, "headaxislength": 4.0}
        scale: Look = {"angles": "xy", "scale_units": "xy", "scale": 1.0, "units": "inches"}
        look: Look = {"color": ink[moving].tolist(), "zorder": 5, "gid": "greedy moves"}
        axes.quiver(*tail[moving].T, *shift[moving].T, width=width_in, **scale, **heads, **look)
    dots: Look = {"s": 1000 * width_in * chance[~moving], "c": ink[~moving].tolist(), "zorder": 5}
    axes.scatter(*centers[state[~moving]].T, **dots, gid="greedy waits")
    return axes


def _arrows(policy: Policy | ArrayLike, n_states: int) -> tuple[IntArray, IntArray, FloatArray]:
    """State, action and probability of each arrow."""
    given = checks.number_array("policy", getattr(policy, "probabilities", policy))
    checks.require_shape("policy", given, (n_states,), (n_states, None))
    if given.ndim == 1:
        state = np.flatnonzero(given >= 0)
        return state, checks.int_array("policy", given)[state], np.ones(len(state))
    drawn = given > _RARE
    if isinstance(policy, Policy):
        drawn &= np.isfinite(policy.q).sum(axis=1, keepdims=True) > 1
    state, action = np.nonzero(drawn)
    return state, action, given[drawn]


def intervals(at: ArrayLike, ends: ArrayLike, axes: "Axes | None" = None, **look: Any) -> "Axes":
    """Draw error bars.

    at: (n,) places; ends: (3, n) lower ends, values and upper ends.

        low, high = errors.reward_interval(fit.reward_weights)
        plots.intervals([0, 1], [low, fit.reward_weights, high], fmt="o")
    """
    axes, bounds = _axes(axes), np.asarray(checks.number_array("ends", ends), dtype=np.float64)
    checks.require_shape("ends", bounds, (3, np.size(at)))
    with np.errstate(invalid="ignore"):  # of infinite values, which are not drawn
        lengths = np.diff(bounds, axis=0)
    axes.errorbar(at, bounds[1], yerr=lengths, **look)
    return axes


def outcomes(
    tables: Mapping[str, ArrayLike],
    outcome_names: Sequence[str],
    axes: "Axes | None" = None,
    *,
    looks: Sequence[Look] = (),
    interval_label: str | None = None,
) -> "Axes":
    """Draw probabilities of K outcomes as bars side by side, with intervals where these are known.

    tables: by the name of each kind of bar, (K,) probabilities, or (3, K) lower ends, probabilities
    and upper ends. looks: keywords of each kind.

        plots.outcomes({"learned": fit.outcome_probabilities[0], "truth": table[0]}, "abcde")
    """
    axes, number, ends = _axes(axes), np.arange(len(outcome_names)), []
    width = _GROUP / len(tables)
    places = [number + (i - (len(tables) - 1) / 2) * width for i in range(len(tables))]
    for i, (name, table) in enumerate(tables.items()):
        rows = np.asarray(checks.number_array(f"tables[{name!r}]", table), dtype=np.float64)
        checks.require_shape(f"tables[{name!r}]", rows, (len(number),), (3, len(number)))
        ends.append(rows if rows.ndim == 2 else np.stack([rows + np.nan, rows, rows + np.nan]))
        look: Look = {"label": name} | (looks[i] if looks else {})
        axes.bar(places[i], ends[i][1], width, **look)
    at, whole = np.concatenate(places), np.hstack(ends)
    if (known := np.isfinite(whole).all(axis=0)).any():
        whiskers: Look = {"fmt": "_", "markersize": 7, "elinewidth": 1.0, "capsize": 2.5}
        intervals(at[known], whole[:, known], axes, color=_INK, label=interval_label, **whiskers)
    axes.set_xticks(number, list(outcome_names))
    axes.set(ylim=(0, 1.08), ylabel="probability")
    return axes


def arrival(
    law: ArrivalLaw | EmpiricalArrival,
    axes: "Axes | None" = None,
    *,
    n_episodes: int | None = None,
    band_label: str | None = None,
    **look: Any,
) -> "Axes":
    """Draw the probability of having arrived over time as steps, with a band around it.

    law: a predicted one, or what `empirical_arrival_cdf` returns, with its band. n_episodes: the
    band of a predicted one is where the share of so many episodes would fall in 95 %; None for 95 %
    of the draws of its posterior, without which it has no band.

        plots.arrival(law, n_episodes=20, label="predicted")
    """
    checks.require_kind("law", law, (ArrivalLaw, EmpiricalArrival), "empirical_arrival_cdf(...)")
    axes = _axes(axes)
    band: Sequence[FloatArray] = ()
    if isinstance(law, EmpiricalArrival):
        band = law.lower, law.upper
    elif n_episodes is not None:
        band = sampling_band(law.cdf if law.cdf_draws is None else law.cdf_draws, n_episodes)
    elif law.cdf_draws is not None:
        band = list(np.quantile(law.cdf_draws, [0.025, 0.975], axis=0))
    (line,) = axes.step(law.times_s, law.cdf, where="post", **look)
    if band:
        shade: Look = {"step": "post", "color": line.get_color(), "alpha": 0.18, "linewidth": 0}
        axes.fill_between(law.times_s, band[0], band[1], label=band_label, **shade)
    axes.set(xlabel="time since the start in s", ylabel="probability of having arrived")
    axes.set_ylim(0, 1.03)
    return axes


def learning_curve(
    sizes: ArrayLike, measure: ArrayLike, axes: "Axes | None" = None, **look: Any
) -> "Axes":
    """Draw a measure over (n,) numbers of demonstrations, or of steps, as a line with its band.

    measure: (n,), or (3, n) lower ends, values and upper ends of a band.

        plots.learning_curve(np.arange(fit.n_steps) + 1, fit.objective_trace)
    """
    axes, rows = _axes(axes), np.asarray(checks.number_array("measure", measure), dtype=np.float64)
    checks.require_shape("measure", rows, (np.size(sizes),), (3, np.size(sizes)))
    (line,) = axes.plot(sizes, rows if rows.ndim == 1 else rows[1], **look)
    if rows.ndim == 2:
        axes.fill_between(sizes, rows[0], rows[2], color=line.get_color(), alpha=0.18, linewidth=0)
    return axes


def _axes(axes: "Axes | None") -> "Axes":
    """The axes, or those of a new figure."""
    if axes is not None:
        return axes
    try:
        from matplotlib import pyplot
    except ModuleNotFoundError as error:
        raise ModuleNotFoundError(
            "pictures need matplotlib, which is missing; run: pip install serd-core[plots]",
            name="matplotlib",
        ) from error
    made: Axes = pyplot.figure(layout="constrained").add_subplot()
    return made


def _map(axes: "Axes | None", cells: Cells) -> tuple["Axes", FloatArray, float]:
    """Axes of a map, the (S, 2) centres (x, y) of its cells with y upwards, and their side."""
    axes = _axes(axes)
    axes.set_aspect("equal")
    if isinstance(cells, Grid):
        centers, side = cells.centers_m, cells.cell_size_m
        axes.set(xlabel="x in m", ylabel="y in m")
    else:
        rows, columns = (int(size) for size in checks.int_array("cells", cells, (2,)))
        row, column = np.divmod(np.arange(rows * columns), columns)
        centers, side = np.stack([column, rows - 1.0 - row], axis=1), 1.0
        axes.set(xticks=[], yticks=[])
        axes.spines[:].set_visible(False)
    axes.update_datalim(np.concatenate([centers - side / 2, centers + side / 2]))
    axes.autoscale_view()
    return axes, centers, side
