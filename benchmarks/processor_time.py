"""Processor time of one thread: what is left of a timing when others share the machine."""

import time
from collections.abc import Callable
from typing import Any


def best_of(work: Callable[[], Any], at_least_s: float = 1.0, calls: int = 1) -> tuple[float, Any]:
    """Least processor seconds of repeated calls, and the last result.

    Called for at_least_s seconds of processor time, and at least `calls` times.
    """
    times: list[float] = []
    while sum(times) < at_least_s or len(times) < calls:
        start_s = time.process_time()
        result = work()
        times.append(time.process_time() - start_s)
    return min(times), result
