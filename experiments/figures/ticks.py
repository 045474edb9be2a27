"""Ticks of a logarithmic axis over numbers of demonstrations: the numbers themselves."""

from collections.abc import Sequence

from matplotlib.axes import Axes


def tick_sizes(axes: Axes, sizes: Sequence[int]) -> None:
    """Label the x axis with these sizes and nothing between."""
    axes.set_xticks(sizes, [str(size) for size in sizes])
    axes.set_xticks([], minor=True)
