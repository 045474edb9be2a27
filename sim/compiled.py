"""Functions of a control period that numba may compile: after many periods, where it is installed.

The compiled ones have the same names in `compiled_loops` and equal results (but for the sign of a
zero), so that no trajectory depends on when a process begins to use them. Of the nodes, those use
them that are in the process of a simulator in lock-step: compiling for the first time takes
seconds, for which a robot must not be without commands.
"""

import pickle
from collections.abc import Callable
from functools import cache, wraps
from typing import Any, ParamSpec, TypeVar

from serd_core.compiled import numba_loads

P = ParamSpec("P")
T = TypeVar("T")

#: Control periods after which compiled functions are used. Loading them costs the time that 1,500
#: control periods save, compiling them for the first time that of 14,000.
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
            except (OSError, EOFError, pickle.UnpicklingError):
                # The files in which numba keeps what it compiles are damaged, or the disk is full.
                _in_use.pop(name, None)
        return function(*arguments, **keywords)

    return call


def use_compiled() -> bool:
    """Use compiled functions in this process from now on; whether there are any."""
    if not _in_use:
        _in_use.update(_compiled_functions())
    return bool(_in_use)


@cache
def _compiled_functions() -> dict[str, Callable[..., Any]]:
    """Those of `compiled_loops`; none where numba does not load or compiles nothing."""
    if not numba_loads():
        return {}
    try:
        from numba import config

        from sim import compiled_loops
    except RuntimeError:  # there is no folder in which numba could keep what it compiles
        return {}
    return {} if config.DISABLE_JIT else compiled_loops.COMPILED


class TickCount:
    """Control periods that a process has driven."""

    def __init__(self) -> None:
        self.n_ticks = 0

    def add(self, n_ticks: int) -> None:
        """Count more, and use compiled functions once there are many."""
        before, self.n_ticks = self.n_ticks, self.n_ticks + n_ticks
        if before < MANY_TICKS <= self.n_ticks:
            use_compiled()


DRIVEN = TickCount()
