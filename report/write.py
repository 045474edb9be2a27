"""Writing a report: figures, tables, summary and the page, each file atomically."""

import json
from pathlib import Path

from report.canvas import png_bytes, svg_bytes
from report.figure_set import all_figures
from report.inputs import ReportInputs
from report.page import render_page
from report.run_facts import FileLink
from report.summary import summary_of
from report.tables import all_tables
from storage.files import atomic_write_bytes, atomic_write_text

_OWN_FILES = (
    FileLink("summary.json", "every number of this page"),
    FileLink("episodes.csv", "how each new episode ended"),
    FileLink("arrival_times.csv", "predicted and measured arrival curves with bands"),
    FileLink("reward_weights.csv", "learned reward weights"),
    FileLink("outcome_models.csv", "initial and learned outcome probabilities"),
    FileLink("figures/", "all figures as PNG and SVG"),
)


def write_report(inputs: ReportInputs, directory: Path) -> Path:
    """Write everything below `directory` (made if missing); returns the path of report.html.

    The page is written last: when it is there, all it links to is there.
    """
    folder = Path(directory).resolve()
    (folder / "figures").mkdir(parents=True, exist_ok=True)
    summary = summary_of(inputs)
    pictures = {}
    for name, figure in all_figures(inputs).items():
        pictures[name] = svg_bytes(figure)
        atomic_write_bytes(folder / "figures" / f"{name}.svg", pictures[name])
        atomic_write_bytes(folder / "figures" / f"{name}.png", png_bytes(figure))
    for file_name, text in all_tables(inputs).items():
        atomic_write_text(folder / file_name, text)
    numbers = json.dumps(summary.as_json(), indent=2, allow_nan=False)
    atomic_write_text(folder / "summary.json", numbers + "\n")
    page = folder / "report.html"
    atomic_write_text(page, render_page(inputs, summary, pictures, _links(inputs)))
    return page


def _links(inputs: ReportInputs) -> tuple[FileLink, ...]:
    """The caller's files first; its words win where both describe one file."""
    given = {link.path for link in inputs.files}
    return inputs.files + tuple(link for link in _OWN_FILES if link.path not in given)
