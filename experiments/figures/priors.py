"""Table 4.3: surfaces of the log priors with the circle and its maxima."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from experiments.priors import Surface
from experiments.running.repetitions import Row
from report.style import INK, RED, new_figure


def surfaces_figure(surfaces: dict[str, Surface], optima: Sequence[Row]) -> Figure:
    """One panel per prior; dots mark the maxima on the circle."""
    figure = new_figure(2.8 * len(surfaces), 2.6)
    panels = np.atleast_1d(figure.subplots(1, len(surfaces)))
    angle = np.linspace(0.0, 2.0 * np.pi, 200)
    for axes, (name, surface) in zip(panels, surfaces.items(), strict=True):
        drawn = axes.contourf(surface.theta, surface.theta, surface.value, levels=20)
        axes.plot(np.cos(angle), np.sin(angle), color=INK, linewidth=1)
        found = [row for row in optima if row["prior"] == name and row["theta_1"] is not None]
        across, upward = ([row[f"theta_{i}"] for row in found] for i in (1, 2))
        axes.plot(across, upward, "o", color=RED)
        axes.set(title=name, xlabel=r"$\theta_1$", ylabel=r"$\theta_2$", aspect="equal")
        bar = figure.colorbar(drawn, ax=axes, shrink=0.75)
        bar.locator = MaxNLocator(5)
        bar.update_ticks()
    return figure
