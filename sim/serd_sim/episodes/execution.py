"""Where many tasks run: processes of this machine, by joblib."""

import os
import threading
import time
import warnings
from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass
from typing import TypeVar

from serd_sim.errors import SimError

Task = TypeVar("Task")
Result = TypeVar("Result")
_PARENT_LOOK_S = 0.5


@dataclass(frozen=True)
class Execution:
    """n_jobs: processes at a time, -1 for all cores; 1 stays in this process."""

    n_jobs: int = -1

    def __post_init__(self) -> None:
        if self.n_jobs == 0 or self.n_jobs < -1:
            raise SimError(f"jobs must be at least 1, or -1 for all cores, got {self.n_jobs}")

    def results(
        self, function: Callable[[Task], Result], tasks: Sequence[Task]
    ) -> Generator[Result, None, None]:
        """function(task) of every task, as they come; closing the iterator ends the others."""
        if self.n_jobs == 1 or len(tasks) <= 1:
            yield from map(function, tasks)
            return
        import joblib  # here, for each command has this module's options

        parallel = joblib.Parallel(
            self.n_jobs,
            return_as="generator_unordered",
            initializer=end_with_parent,
            initargs=(os.getpid(),),
        )
        results = parallel(joblib.delayed(function)(task) for task in tasks)
        try:
            # Not `yield from`, which would close it unsilenced.
            for result in results:  # noqa: UP028
                yield result
        finally:
            with warnings.catch_warnings():
                # joblib's advice to start fewer tasks is of no use after an interrupt.
                warnings.simplefilter("ignore", UserWarning)
                results.close()


def end_with_parent(parent_pid: int) -> None:
    """End this process when its parent has ended for any reason."""

    def watch() -> None:
        while os.getppid() == parent_pid:
            time.sleep(_PARENT_LOOK_S)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
