"""Time left of few long pieces of work, and a notice about results of other code."""

from datetime import timedelta
from pathlib import Path

from rich.progress import ProgressColumn, Task
from rich.text import Text

from lab.experiments.running.provenance import other_commits
from serd_cli.output.terminal import progress_console


def time_left_s(done_s: float, total_s: float, spent_s: float, n_processes: int) -> float:
    """Seconds for the rest, when done_s of total_s seconds of work took spent_s so far.

    Before anything is done, the estimated costs are divided by the number of processes.
    """
    speed = done_s / spent_s if done_s > 0 and spent_s > 0 else float(n_processes)
    return max(total_s - done_s, 0.0) / speed


class TimeLeftColumn(ProgressColumn):
    """`left 0:12:34` for few long pieces of work of roughly known cost.

    rich's own estimate uses the last seconds only, in which no piece may have ended.
    """

    def __init__(self, n_processes: int) -> None:
        super().__init__()
        self._n_processes = n_processes
        self._done_s, self._at_s = 0.0, 0.0

    def render(self, task: Task) -> Text:
        """The estimate made when the last piece ended, minus the time since."""
        if task.total is None:
            return Text("")
        now_s = task.elapsed or 0.0
        if task.completed != self._done_s:
            self._done_s, self._at_s = task.completed, now_s
        left_s = time_left_s(self._done_s, task.total, self._at_s, self._n_processes)
        return Text(f"left {timedelta(seconds=round(max(left_s - (now_s - self._at_s), 0.0)))}")


def remark_other_code(folder: Path) -> None:
    """Print a warning where a folder holds results of another version of the code."""
    if commits := other_commits(folder):
        progress_console.print(
            f"{folder} holds results of {', '.join(each[:7] for each in commits)}, which are kept;"
            " delete the folder to make all of them with the present code",
            style="yellow",
            soft_wrap=True,
        )
