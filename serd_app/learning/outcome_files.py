"""The files of a lesson: the model, its grid, and how the fit went."""

from pathlib import Path

from serd_app.demonstrations.grid_file import save_grid
from serd_app.learning.recipe import LearningTask, Lesson
from storage.files import atomic_write_text
from storage.model_file import save_model


def save_lesson(output: Path, lesson: Lesson, task: LearningTask) -> None:
    """Write the model to `output`, `grid.yaml` and `learning.csv` beside it."""
    files = lesson_files(output)
    save_grid(files["grid"], task.problem.grid, task.scenario)
    atomic_write_text(files["learning"], lesson.trace_table())
    save_model(files["model"], lesson.model)


def lesson_files(output: Path) -> dict[str, Path]:
    """Where everything is that `save_lesson` writes, by what it is."""
    return {
        "model": output,
        "grid": output.with_name("grid.yaml"),
        "learning": output.with_name("learning.csv"),
    }
