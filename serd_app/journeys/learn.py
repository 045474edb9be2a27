"""From a table of decisions to a model file and its page: what `serd learn` does."""

from dataclasses import dataclass
from pathlib import Path

from serd_app.journeys.report import ReportSources
from serd_app.journeys.report import report as write_page
from serd_app.learning.knowledge import Certainty, certainty_of
from serd_app.learning.learning_files import LearningFiles, read_learning_files
from serd_app.learning.methods import ProgressCallback, ignore_progress
from serd_app.learning.outcome import FitOutcome, outcome_files, save_outcome
from serd_app.learning.recipe import learn
from serd_app.learning.settings import FlowSource, LearningSettings
from serd_app.places.kept_scenario import require_replaceable
from serd_bag.files import require_file_place, require_folder
from serd_files.errors import missing_pictures


@dataclass(frozen=True, eq=False)
class Learned:
    """A model that was learned from a table and written.

    certainty: standard errors and what the data leave open. model: its file. page: of its report,
    None where none was wanted. missing: why no picture was drawn, empty where one was or the fit
    has none.
    """

    files: LearningFiles
    outcome: FitOutcome
    certainty: Certainty
    model: Path
    page: Path | None = None
    missing: str = ""


def learn_from_table(
    table: Path,
    output: Path,
    settings: LearningSettings,
    *,
    scenario: str = "",
    flow: FlowSource = "auto",
    goals_m: tuple[tuple[float, float], ...] = (),
    features: Path | None = None,
    report: Path | None = None,
    on_progress: ProgressCallback = ignore_progress,
) -> Learned:
    """Learn, write the model to `output` with the files beside it, and a page to `report`.

    scenario, flow, goals_m, features: see `read_learning_files`. SerdError or FileError where a
    file is missing or wrong, or where too few decisions are left.
    """
    require_file_place(output)
    if report is not None:
        require_folder(report)
    files = read_learning_files(
        table,
        discount=settings.discount,
        scenario=scenario,
        flow=flow,
        goals_m=goals_m,
        features=features,
    )
    require_replaceable(output, files.task.scenario_yaml)
    outcome = learn(files.task, files.decisions, settings, on_progress)
    grid, missing = files.task.problem.grid, ""
    save_outcome(output, outcome, grid)
    if outcome.knowledge is not None and not (missing := missing_pictures()):
        from serd_app.report.maps import draw_gain
        from serd_app.report.style import save_figure

        figure = draw_gain(None, grid, outcome.knowledge.gain_nats)
        save_figure(outcome_files(output)["gain_map"], figure)
    page = None
    if report is not None:
        page = write_page(ReportSources(output, scenario, table), report).page
    certainty = certainty_of(outcome.problem, outcome.decisions, outcome.fit)
    return Learned(files, outcome, certainty, output, page, missing)
