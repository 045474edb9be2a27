"""Whether code compiled by numba is used: where it is installed (the extra `fast`) and pays.

Large problems are worked on in two parts, on machines with two cores or more by two threads. Parts
depend on the problem alone, so that results do not depend on the machine.
"""

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import cache
from importlib.util import find_spec
from typing import Any

HAS_NUMBA = find_spec("numba") is not None
#: States from which compiled code saves more than loading it costs.
SMALLEST_COMPILED = 20_000
#: States from which two threads save more than they wait for each other.
SMALLEST_SPLIT = 500_000


def is_compiled(n_states: int) -> bool:
    """Whether work on this number of states is done by compiled code."""
    return HAS_NUMBA and n_states >= SMALLEST_COMPILED and numba_loads()


@cache
def numba_loads() -> bool:
    """Whether numba is installed and supports this version of NumPy."""
    try:
        import numba  # noqa: F401
    except ImportError:
        return False
    return True


def halves(n_states: int) -> tuple[tuple[int, int], ...]:
    """First state and end of both halves of a large problem, or of all states as one part."""
    middle = n_states // 2 if n_states >= SMALLEST_SPLIT else n_states
    return ((0, middle), (middle, n_states))[: 2 if middle < n_states else 1]


@contextmanager
def side_by_side(parts: Sequence[tuple[int, ...]]) -> Iterator[Callable[..., list[Any]]]:
    """What calls work(part, *given) for each part, and returns the results in their order."""
    if len(parts) == 1 or (os.cpu_count() or 1) == 1:
        yield lambda work, *given: [work(part, *given) for part in parts]
        return
    with ThreadPoolExecutor(len(parts) - 1) as pool:

        def run(work: Callable[..., Any], *given: Any) -> list[Any]:
            others = [pool.submit(work, part, *given) for part in parts[1:]]
            return [work(parts[0], *given), *(other.result() for other in others)]

        yield run
