"""The look every figure shares: colours that colour-blind readers can distinguish, fonts, lines.

The line colours are from Paul Tol's "bright" scheme (SRON/EPS/TN/09-002); meanings never rest on
colour alone: line styles, markers or labels repeat them.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from typing import Any

from matplotlib import rc_context
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.text import Text

from serd_bag.files import atomic_write_bytes

INK = "#26323d"
MUTED = "#6b7885"
HAIRLINE = "#d5dbe1"
PAPER = "#ffffff"
WALL = "#55606b"
FLOOR = "#f6f5f1"
BLUE = "#4477aa"
RED = "#ee6677"
GREEN = "#228833"
YELLOW = "#ccbb44"
CYAN = "#66ccee"
PURPLE = "#aa3377"

GOAL_COLOUR = GREEN
INITIAL_COLOUR = "#c3cad1"
PERSON_COLOUR = "#b98a2f"
START_COLOURS = (BLUE, RED, CYAN, YELLOW)
PREDICTED_COLOUR = BLUE
MEASURED_COLOUR = RED

VISITS_MAP = LinearSegmentedColormap.from_list(
    "visits", ["#fdfcfa", "#f7cfc0", "#e58a78", "#c04a50", "#7a1733"]
)
VALUE_MAP = LinearSegmentedColormap.from_list("value", ["#f4f7fa", "#d3e2ee", "#a3c4de", "#6f9fc6"])

_STYLE: dict[str, Any] = {
    "font.family": "DejaVu Sans",
    "font.size": 9.0,
    "axes.titlesize": 10.0,
    "axes.titleweight": "bold",
    "axes.titlecolor": INK,
    "axes.labelcolor": INK,
    "axes.edgecolor": MUTED,
    "axes.linewidth": 0.8,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.axisbelow": True,
    "axes.grid": False,
    "grid.color": HAIRLINE,
    "grid.linewidth": 0.7,
    "text.color": INK,
    "xtick.color": MUTED,
    "ytick.color": MUTED,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "legend.frameon": False,
    "legend.fontsize": 8.5,
    "figure.facecolor": PAPER,
    "figure.constrained_layout.h_pad": 0.06,
    "figure.constrained_layout.w_pad": 0.06,
    "savefig.facecolor": PAPER,
    "svg.hashsalt": "serd",
    "svg.fonttype": "path",
}


@contextmanager
def report_style() -> Iterator[None]:
    """The report's matplotlib settings for the length of a `with` block; nothing stays behind."""
    with rc_context(_STYLE):
        yield


PNG_DOTS_PER_INCH = 160
#: Keyword arguments of a function of Matplotlib.
Look = dict[str, Any]


def new_figure(width_in: float, height_in: float) -> Figure:
    """An empty figure that lays itself out, attached to the Agg canvas only."""
    with report_style():
        figure = Figure(figsize=(width_in, height_in), layout="constrained")
        FigureCanvasAgg(figure)
    return figure


def png_bytes(figure: Figure) -> bytes:
    """The figure as PNG; equal figures give equal bytes."""
    return _saved(figure, "png", {"Software": None})


def svg_bytes(figure: Figure) -> bytes:
    """The figure as SVG with text as outlines, so that it looks the same everywhere."""
    return _saved(figure, "svg", {"Date": None})


def save_figure(path: Path, figure: Figure) -> None:
    """Write the figure as .png or .svg, by the suffix of the path, whole or not at all."""
    formats = {".png": png_bytes, ".svg": svg_bytes}
    atomic_write_bytes(path, formats[path.suffix.lower()](figure))


def _saved(figure: Figure, kind: str, metadata: dict[str, None]) -> bytes:
    buffer = BytesIO()
    with report_style():
        _take_names_as_they_are(figure)
        figure.draw_without_rendering()  # maps of fixed aspect settle in the second layout only
        figure.savefig(buffer, format=kind, metadata=metadata, dpi=PNG_DOTS_PER_INCH)
    return buffer.getvalue()


def _take_names_as_they_are(figure: Figure) -> None:
    """Dollar signs begin no formula but in the numbers of logarithmic axes."""
    numbers = {
        label
        for axes in figure.axes
        for axis in (axes.xaxis, axes.yaxis)
        for label in axis.get_ticklabels(which="both")
    }
    for each in figure.findobj(Text):
        if isinstance(each, Text) and each not in numbers:
            each.set_parse_math(False)
