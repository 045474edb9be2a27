"""Progress on stderr: a bar on a terminal, a line now and then in a file or pipe."""

import time
from typing import Any

from rich.progress import Progress, ProgressColumn, TaskID

from serd_cli.terminal import progress_console

_LINE_EVERY_S = 30.0


class WorkProgress(Progress):
    """rich's progress, which by itself says nothing before the end where there is no terminal."""

    def __init__(self, *columns: str | ProgressColumn, expand: bool = False) -> None:
        super().__init__(*columns, console=progress_console, expand=expand)
        self._printed_at_s = time.monotonic()

    def update(self, task_id: TaskID, *args: Any, **kwargs: Any) -> None:
        """Take news of a task; half a minute after the last line, print one."""
        super().update(task_id, *args, **kwargs)
        if self.console.is_terminal or time.monotonic() - self._printed_at_s < _LINE_EVERY_S:
            return
        self._printed_at_s = time.monotonic()
        self.console.print(self.get_renderable())
