"""Whether code compiled by numba is used: where it is installed (the extra `fast`) and pays."""

from functools import cache
from importlib.util import find_spec

HAS_NUMBA = find_spec("numba") is not None
#: States from which compiled code saves more than loading it costs.
SMALLEST_COMPILED = 20_000


def is_compiled(n_states: int) -> bool:
    """Whether work on this number of states is done by compiled code."""
    return HAS_NUMBA and n_states >= SMALLEST_COMPILED and _numba_loads()


@cache
def _numba_loads() -> bool:
    """Whether numba supports this version of NumPy; else it raises ImportError."""
    try:
        import numba  # noqa: F401
    except ImportError:
        return False
    return True
