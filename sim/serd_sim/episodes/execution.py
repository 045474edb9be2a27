"""Where many tasks run: processes of this machine (joblib's loky), or a Dask cluster."""

import os
import threading
import time
import warnings
from collections.abc import Callable, Generator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from typing import Any, TypeVar

from serd_bag.nearest import choice_rule
from serd_sim.errors import SimError

BACKENDS = ("loky", "dask")
Task = TypeVar("Task")
Result = TypeVar("Result")
_PARENT_LOOK_S = 0.5


@dataclass(frozen=True)
class Execution:
    """n_jobs: processes at a time, -1 for all cores; 1 with loky stays in this process.

    address: of a running Dask scheduler; a local cluster is started where it is empty.
    """

    n_jobs: int = -1
    backend: str = "loky"
    address: str = ""

    def __post_init__(self) -> None:
        if self.backend not in BACKENDS:
            raise SimError(choice_rule("backend", self.backend, BACKENDS))
        if self.n_jobs == 0 or self.n_jobs < -1:
            raise SimError(f"jobs must be at least 1, or -1 for all cores, got {self.n_jobs}")
        if self.address and self.backend == "loky":
            raise SimError(f"address must be left out with loky, got {self.address!r}; choose dask")

    @property
    def n_processes(self) -> int:
        """How many processes that is on this machine."""
        return (os.cpu_count() or 1) if self.n_jobs < 0 else self.n_jobs

    def results(
        self, function: Callable[[Task], Result], tasks: Sequence[Task]
    ) -> Generator[Result, None, None]:
        """function(task) of every task, as they come; closing the iterator ends the others."""
        if self.backend == "loky" and (self.n_jobs == 1 or len(tasks) <= 1):
            yield from map(function, tasks)
            return
        import joblib  # here, for each command has this module's options

        settings: dict[str, Any] = {"initializer": end_with_parent, "initargs": (os.getpid(),)}
        with ExitStack() as stack:
            if self.backend == "dask":
                settings = {"client": stack.enter_context(self._dask_client())}
            configured = joblib.parallel_config(self.backend, n_jobs=self.n_jobs, **settings)
            stack.enter_context(configured)
            parallel = joblib.Parallel(return_as="generator_unordered")
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

    def _dask_client(self) -> Any:
        """A client of the named cluster, of a local one where none was named."""
        try:
            from distributed import Client
        except ImportError:
            raise SimError(
                "backend dask needs the package dask[distributed], which is not installed"
                "; run 'pip install \"dask[distributed]\"' or use loky"
            ) from None
        if self.address:
            try:
                return Client(self.address)
            except (OSError, ValueError) as error:
                raise SimError(
                    f"address must be that of a running Dask scheduler, got {self.address!r}"
                    f" ({error}); start one with 'dask scheduler'"
                ) from error
        return Client(n_workers=self.n_processes, threads_per_worker=1, dashboard_address=None)


def end_with_parent(parent_pid: int) -> None:
    """End this process when its parent has ended for any reason."""

    def watch() -> None:
        while os.getppid() == parent_pid:
            time.sleep(_PARENT_LOOK_S)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
