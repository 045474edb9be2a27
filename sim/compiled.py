"""Functions of a control period that numba may compile: after many periods, where it is installed.

The compiled ones have the same names in `compiled_loops` and the same results to the bit, so that
no trajectory depends on when a process begins to use them. Nodes use them in lock-step alone:
compiling for the first time takes seconds, for which a robot must not be without commands.
"""

from collections.abc import Callable
from functools import wraps
from typing import Any, ParamSpec, TypeVar

from serd_core.compiled import numba_loads

P = ParamSpec("P")
T = TypeVar("T")

#: Control periods after which compiled functions save more than they cost, compiling included.
MANY_TICKS = 4_000
#: The functions that numba may compile, by their names.
COMPILABLE: dict[str, Callable[..., Any]] = {}
_in_use: dict[str, Callable[..., Any]] = {}


def compilable(function: Callable[P, T]) -> Callable[P, T]:
    """Decorator: the compiled function of that name, once those are used."""
    name = function.__name__
    COMPILABLE[name] = function

    @wraps(function)
    def call(*arguments: P.args, **keywords: P.kwargs) -> T:
        compiled: Callable[P, T] | None = _in_use.get(name)
        if compiled is not None:
            try:
                return compiled(*arguments, **keywords)
            except OSError:  # numba cannot keep what it has compiled, as on a full disk
                _in_use.pop(name)
        return function(*arguments, **keywords)

    return call


def use_compiled() -> bool:
    """Use compiled functions in this process from now on; whether there are any."""
    if not _in_use and numba_loads():
        try:
            from sim import compiled_loops
        except RuntimeError:  # there is no folder in which numba could keep what it compiles
            return False
        _in_use.update(compiled_loops.COMPILED)
    return bool(_in_use)


class TickCount:
    """Control periods that a process has driven."""

    def __init__(self) -> None:
        self.n_ticks = 0

    def add(self, n_ticks: int) -> None:
        """Count more, and use compiled functions after many."""
        self.n_ticks += n_ticks
        if self.n_ticks >= MANY_TICKS:
            use_compiled()


DRIVEN = TickCount()
