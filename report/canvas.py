"""Figures without pyplot: making an empty one, and turning one into PNG or SVG bytes."""

from io import BytesIO

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from report.style import report_style

PNG_DOTS_PER_INCH = 160


def new_figure(width_in: float, height_in: float) -> Figure:
    """An empty figure that lays itself out, attached to the Agg canvas only."""
    with report_style():
        figure = Figure(figsize=(width_in, height_in), layout="constrained")
        FigureCanvasAgg(figure)
    return figure


def png_bytes(figure: Figure) -> bytes:
    """The figure as PNG; equal figures give equal bytes."""
    return _saved(figure, "png", {"Software": None}, dpi=PNG_DOTS_PER_INCH)


def svg_bytes(figure: Figure) -> bytes:
    """The figure as SVG with text as outlines, so that it looks the same everywhere."""
    return _saved(figure, "svg", {"Date": None}, dpi=PNG_DOTS_PER_INCH)


def _saved(figure: Figure, kind: str, metadata: dict[str, None], dpi: int) -> bytes:
    buffer = BytesIO()
    with report_style():
        figure.draw_without_rendering()  # maps of fixed aspect settle in the second layout only
        figure.savefig(buffer, format=kind, metadata=metadata, dpi=dpi)
    return buffer.getvalue()
