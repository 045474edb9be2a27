"""Refuse what would not fit into memory before it is built.

The numbers of bytes are what a gradient and its linear systems were measured to need at their
peak, rounded down, so that nothing that fits is refused.
"""

import os
import sys

if sys.platform != "win32":
    import resource

from serd_core.errors import SerdError

#: Bytes per entry of P at the peak of a gradient: indices and numbers of P and of I - gamma P_pi.
BYTES_PER_ENTRY = 90
#: The same where a model is given entry by entry.
LISTED_BYTES_PER_ENTRY = 200
#: Bytes per pair (s, a): mask and places of its entries.
BYTES_PER_PAIR = 25


def memory_limit() -> int:
    """Bytes that the process may use: the machine's, or less where a limit is set."""
    if sys.platform == "win32":
        return sys.maxsize
    machine = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    limit, _ = resource.getrlimit(resource.RLIMIT_AS)
    return machine if limit == resource.RLIM_INFINITY else min(machine, limit)


def require_memory(what: str, n_bytes: float, fix: str) -> None:
    """SerdError where `what` needs more bytes than there are."""
    limit = memory_limit()
    if n_bytes > limit:
        raise SerdError(
            f"{what} must fit into memory, but needs {n_bytes:.3g} bytes of {limit:.3g}; {fix}"
        )
