"""Charts: predicted against measured time of arrival (Fig. 5.10), and the outcome models.

Outcomes are counted beside learned, with what the posterior leaves open.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from serd_app.learning.knowledge import MASS, DynamicsRow
from serd_app.report import style
from serd_app.report.inputs import in_words
from serd_app.report.style import Look, new_figure
from serd_bag.quantities import counted
from serd_core import plots
from serd_core.arrival.law import ArrivalLaw, EmpiricalArrival, empirical_arrival_cdf
from serd_core.bayes.information import PRIOR_ONLY
from serd_core.grid.grid import Outcome

#: Share at which a curve visibly differs from zero.
_LEFT_ZERO = 0.005
_LOOKS = {"predicted": (style.PREDICTED_COLOUR, "--"), "measured": (style.MEASURED_COLOUR, "-")}


def measured_curve(arrival_times_s: ArrayLike, timeout_s: float) -> EmpiricalArrival:
    """Empirical CDF with its exact 95 % confidence band.

    arrival_times_s: (N,) of each episode, inf where it did not arrive.
    """
    return empirical_arrival_cdf(arrival_times_s, np.isinf(arrival_times_s), timeout_s)


def time_reaching(curve: ArrivalLaw | EmpiricalArrival, share: float) -> float | None:
    """First time at which the curve is at or above `share`, None if it never is."""
    reached = np.flatnonzero(curve.cdf >= share - 1e-12)
    return float(curve.times_s[reached[0]]) if reached.size else None


def shown_until_s(predicted: ArrivalLaw, arrival_times_s: ArrayLike, timeout_s: float) -> float:
    """End of the time axis: where both curves have settled, the timeout if one robot was late.

    arrival_times_s: (N,) of each episode, inf where it did not arrive.
    """
    latest_s = float(np.max(arrival_times_s))
    settled_s = predicted.quantile_s(0.99 * float(predicted.cdf[-1])) or 0.0
    return min(timeout_s, 1.15 * max(latest_s, settled_s))


def shown_from_s(*curves: ArrivalLaw | EmpiricalArrival) -> float:
    """Begin of the time axis: a tenth before the first curve leaves zero."""
    starts_s = [time_reaching(curve, _LEFT_ZERO) for curve in curves]
    return 0.9 * min((start_s for start_s in starts_s if start_s is not None), default=0.0)


def draw_comparison(
    predicted: ArrivalLaw, arrival_times_s: ArrayLike, timeout_s: float, recorded_s: ArrayLike = ()
) -> Figure:
    """A prediction and the (N,) times of episodes, inf without an arrival, as steps with bands.

    What stays below 1 never arrived in time. recorded_s: times of arrival of the demonstrations.
    """
    n_episodes, recorded = len(np.asarray(arrival_times_s)), np.asarray(recorded_s)
    measured = measured_curve(arrival_times_s, timeout_s)
    until_s = max([shown_until_s(predicted, arrival_times_s, timeout_s), *(1.05 * recorded)])
    with style.report_style():
        figure = new_figure(7.2, 3.9)
        axes = figure.subplots()
        for curve, kind, label in (
            (predicted, "predicted", "predicted by the learned model"),
            (measured, "measured", f"measured in {n_episodes} episodes"),
        ):
            colour, line = _LOOKS[kind]
            look: Look = {"color": colour, "linestyle": line, "linewidth": 2.0, "label": label}
            band = f"95 % band, {kind}"
            plots.arrival(curve, axes, n_episodes=n_episodes, band_label=band, **look)
        begin_s = min([shown_from_s(predicted, measured), *(0.9 * recorded)])
        _frame(axes, min(begin_s, 0.9 * until_s), until_s)
        _draw_recorded(axes, recorded)
        handles, labels = axes.get_legend_handles_labels()
        order = sorted(range(len(labels)), key=lambda i: labels[i].startswith("95"))
        axes.legend([handles[i] for i in order], [labels[i] for i in order], loc="lower right")
    return figure


_FORECAST_LOOKS = ((style.BLUE, "-"), (style.RED, "--"), (style.GREEN, "-."), (style.PURPLE, ":"))


def draw_forecasts(
    laws: Mapping[str, ArrivalLaw], timeout_s: float, recorded_s: ArrayLike = ()
) -> Figure:
    """The computed arrival from each start, by name; a dot where half have arrived.

    recorded_s: (N,) times of arrival of recorded drives, which are drawn beside it.
    """
    with style.report_style():
        figure = new_figure(7.2, 3.9)
        axes = figure.subplots()
        for number, (name, law) in enumerate(laws.items()):
            colour, line = _FORECAST_LOOKS[number % len(_FORECAST_LOOKS)]
            bare = replace(law, cdf_draws=None)  # bands of several would hide each other
            plots.arrival(bare, axes, color=colour, linestyle=line, label=name)
            half_s = law.quantile_s(0.5)
            if half_s is not None:
                axes.plot(half_s, 0.5, "o", color=colour, markersize=5)
        until_s = max(shown_until_s(law, [0.0], timeout_s) for law in laws.values())
        until_s = max([until_s, *(1.05 * np.asarray(recorded_s))])
        starts_s = [law.times_s[law.cdf >= _LEFT_ZERO][:1] for law in laws.values()]
        starts_s.append(np.asarray(recorded_s, dtype=np.float64))
        from_s = 0.9 * float(np.concatenate(starts_s).min(initial=until_s))
        _frame(axes, from_s, max(until_s, from_s + 1e-3))
        _draw_recorded(axes, recorded_s)
        axes.legend(loc="lower right", title="from")
    return figure


def _frame(axes: Axes, from_s: float, until_s: float) -> None:
    axes.set(xlim=(from_s, until_s), ylim=(0, 1.03), yticks=np.linspace(0, 1, 5))
    axes.grid()


def _draw_recorded(axes: Axes, recorded_s: ArrayLike) -> None:
    """The share of recorded drives that had arrived by each time: steps with a dot at each time."""
    times_s = np.sort(np.asarray(recorded_s, dtype=np.float64))
    if not len(times_s):
        return
    share = np.arange(1, len(times_s) + 1) / len(times_s)
    label = f"recorded: {counted(len(times_s), 'drive')}"
    look: Look = {"color": style.INK, "linewidth": 1.0}
    ends_s, steps = np.append(times_s, axes.get_xlim()[1]), np.append(share, 1.0)
    axes.step(np.append(times_s[0], ends_s), np.append(0.0, steps), where="post", **look)
    axes.plot(times_s, share, "o", markersize=4, label=label, **look)


OUTCOME_LABELS = tuple(outcome.name.lower() for outcome in Outcome)
_HATCHED: Look = {
    "color": style.INITIAL_COLOUR, "hatch": "////", "edgecolor": "white", "linewidth": 0,
}  # fmt: skip
#: Of the legend below the panels.
_LEGEND_WIDTH_IN = 6.0


def draw_outcomes(
    rows: Sequence[DynamicsRow], decisions: Mapping[str, int], known_from: Mapping[str, str]
) -> Figure:
    """One panel per model: probability of each outcome, counted and with the reward's help.

    rows: by model, then by outcome; ends of an interval are NaN where it is not known. decisions:
    of each model; known_from: what determines it, of models for which that is known.
    """
    names = list(dict.fromkeys(row.model for row in rows))
    with style.report_style():
        figure = new_figure(max(2.35 * len(names), _LEGEND_WIDTH_IN), 2.9)
        panels = figure.subplots(1, len(names), sharey=True, squeeze=False)[0]
        for name, axes in zip(names, panels, strict=True):
            decided = counted(decisions[name], "decision")
            if name in known_from:
                decided += f"\nknown from: {known_from[name]}"
            strength = 0.3 if known_from.get(name) == PRIOR_ONLY else 1.0
            _draw_model(axes, [row for row in rows if row.model == name], strength)
            pad = 28 if name in known_from else 16
            axes.set_title(in_words(name), loc="left", pad=pad, parse_math=False)
            axes.text(0, 1.02, decided, transform=axes.transAxes, fontsize=8, color=style.MUTED)
        panels[0].set_ylabel("probability")
        shown = panels[0].get_legend_handles_labels()
        figure.legend(*shown, loc="outside lower center", ncols=3)
    return figure


def _draw_model(axes: Axes, rows: Sequence[DynamicsRow], strength: float) -> None:
    """Both bars with their intervals where known, and numbers above the learned ones."""
    counts = np.array([(row.counted_lower, row.counted, row.counted_upper) for row in rows]).T
    joint = np.array([(row.joint_lower, row.joint, row.joint_upper) for row in rows]).T
    plots.outcomes(
        {"counted": counts, "with the reward's help": joint},
        OUTCOME_LABELS,
        axes,
        looks=(_HATCHED, {"color": style.BLUE, "alpha": strength}),
        interval_label=f"median, {100 * MASS:.0f} % interval",
    )
    above: Look = {"xytext": (0, 1.5), "textcoords": "offset points", "ha": "center"}
    tops = zip(axes.containers[1], joint[1], np.fmax(joint[1], joint[2]), strict=True)
    for bar, probability, top in tops:
        place = bar.get_x() + bar.get_width() / 2
        axes.annotate(f"{probability:.2f}".lstrip("0"), (place, top), fontsize=7, **above)
    axes.tick_params(axis="x", labelsize=8)
    axes.set_ylabel("")
    axes.set_yticks([0, 0.25, 0.5, 0.75, 1.0])
    axes.grid(axis="y")
    axes.tick_params(length=0)
    axes.spines["left"].set_visible(False)
