"""How long work will take that comes in few and long pieces, of which only rough costs are known.

rich's own estimate forgets all but the last seconds, in which no piece may have ended.
"""

from datetime import timedelta

from rich.progress import ProgressColumn, Task
from rich.text import Text


def time_left_s(done_s: float, total_s: float, spent_s: float, n_processes: int) -> float:
    """Seconds for the rest, when done_s of total_s seconds of work have taken spent_s so far.

    Before anything is done, the costs are taken at their word and shared by all processes.
    """
    speed = done_s / spent_s if done_s > 0 and spent_s > 0 else float(n_processes)
    return max(total_s - done_s, 0.0) / speed


class TimeLeftColumn(ProgressColumn):
    """`left 0:12:34`, counted down between one piece and the next."""

    def __init__(self, n_processes: int) -> None:
        super().__init__()
        self._n_processes = n_processes
        self._done_s, self._at_s = 0.0, 0.0

    def render(self, task: Task) -> Text:
        """The estimate of when the last piece ended, less the time since."""
        if task.total is None:
            return Text("")
        now_s = task.elapsed or 0.0
        if task.completed != self._done_s:
            self._done_s, self._at_s = task.completed, now_s
        left_s = time_left_s(self._done_s, task.total, self._at_s, self._n_processes)
        return Text(f"left {timedelta(seconds=round(max(left_s - (now_s - self._at_s), 0.0)))}")
