"""Mutations of valid input as hypothesis strategies, and the bounds each mutated input must keep.

The environment variable SERD_FUZZ_CASES sets the number of cases per target; `make fuzz` sets it
to 10,000.
"""

import os
import re
import resource
import signal
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from copy import deepcopy
from pathlib import Path
from typing import Any

import yaml
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st

from serd_files.errors import USER_ERRORS

#: Settings of one target; the cases are the same in every run.
FUZZ = settings(
    max_examples=int(os.environ.get("SERD_FUZZ_CASES", "50")),
    deadline=None,
    database=None,
    derandomize=True,
    suppress_health_check=list(HealthCheck),
)
MOST_CPU_S = 5.0
MOST_MEMORY = 10**9

ODD_SCALARS = (
    None, True, False, 0, 1, -1, 2, 3, 10**6, 2**31, 2**63, -(2**63) - 1, 10**30, 10**400, 0.0, 0.5,
    -0.0, 1e-300, 1e300, float("inf"), -float("inf"), float("nan"), "", " ", "a", "0", "1e3", "nan",
    "\n", "\x85", "\u2028", "\0", "é", "😀", "../x", "/", ".", "#", "^", "a\nb", "x" * 3000,
)  # fmt: skip
YAML_PIECES = (
    "!!float ''", "!!float x", "!!float 1:x", "!!int ''", "!!int x", "!!int 0x", "!!int 1:1",
    "!!bool x", "!!bool ''", "!!null x", "!!timestamp x", "!!timestamp 2001-99-99", "!!binary x",
    "!!binary YQ==", "!!set {a}", "!!set x", "!!omap [a: 1]", "!!omap x", "!!pairs [a: 1]",
    "!!pairs x", "!!seq x", "!!map x", "!!map [1]", "!!str [1]", "!!str", "!!python/none x", "!x y",
    "2001-12-14t21:59:43.10-05:00", "2001-01-01", "2001-99-99", "<<: {a: 1}", "<<: x", "<<", "=",
    "&a", "*a", "? ", "- ", ": ", "|", ">", "%", "@", "`", "---", "...", "{", "}", "[", "]", ",",
    "'", '"', "'\\'", '"\\x"', "\t", "\n", "\n  ", "~", "null", ".inf", "-.inf", ".nan", "1e999",
    "0x10", "0o17", "1_000", "1:30", "+", "-", ".", "1.", ".5", "9" * 30, "9" * 5000, "[" * 3000,
    "{a: " * 200, "\x85", "\u2028", "\0", "\ufeff", "True", "yes", "é",
)  # fmt: skip
CSV_PIECES = (
    "", ",", ",,", "\n", "\n\n", "\r", "\r\n", '"', '""', '"a', 'a"', '"a\nb"', '"a,b"', "\0",
    "nan", "NaN", "inf", "-inf", "1e999", "1e400", "-1", "0", "1.0", "1.5", "0x1", "1_0", " 1 ",
    "9" * 19, "9" * 30, "9" * 400, "9" * 5000, "x" * 140_000, "é", "١", "\x85", "\u2028", "\ufeff",
    "none", "north", "arrived", "a", "None", "True", "<NA>", "1e18", "-9223372036854775809",
)  # fmt: skip

#: Most elements that an edit removes or repeats.
_MOST = 40


def mutated_text(valid: str, pieces: Sequence[str]) -> st.SearchStrategy[str]:
    """The text with up to six of its words removed, repeated, replaced or cut off."""
    new = (
        st.sampled_from(pieces)
        | st.text(max_size=8)
        | st.floats().map(str)
        | st.integers().map(str)
    )
    words = re.split(r"([\s,:\[\]{}#'\"]+)", valid)
    return _mutated(words, st.lists(new, max_size=2)).map("".join)


def mutated_bytes(valid: bytes) -> st.SearchStrategy[bytes]:
    """The bytes with up to six places overwritten, inserted, repeated or cut out."""
    return _mutated(valid, st.binary(max_size=16)) | st.binary(max_size=64)


def _mutated(valid: Any, new: st.SearchStrategy[Any]) -> st.SearchStrategy[Any]:
    """A sequence with up to six slices replaced by new elements, or by others of its own."""
    place = st.integers(0, 2**16)
    length = st.integers(0, 4) | st.integers(0, _MOST) | st.just(2**16)

    def edited(edits: Sequence[tuple[int, int, Any]]) -> Any:
        content = valid
        for first, n_removed, inserted in edits:
            start = first % (len(content) + 1)
            if isinstance(inserted, int):
                other = inserted % (len(content) + 1)
                inserted = content[other : other + 1 + inserted % _MOST]
            content = content[:start] + inserted + content[start + n_removed :]
        return content

    edits = st.lists(st.tuples(place, length, new | place), min_size=1, max_size=6)
    return edits.map(edited)


def mutated_yaml(valid: str) -> st.SearchStrategy[str]:
    """The YAML text with up to four of its values, keys or branches changed, written by PyYAML."""
    values = yaml.safe_load(valid)
    scalars = st.sampled_from(ODD_SCALARS) | st.integers() | st.floats() | st.text(max_size=8)
    branches = st.recursive(
        scalars,
        lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=4), inner),
        max_leaves=4,
    )
    changes = st.lists(
        st.tuples(st.integers(0, 2**16), st.sampled_from(("set", "remove", "rename", "repeat")),
                  scalars | branches),
        min_size=1,
        max_size=4,
    )  # fmt: skip
    return changes.map(lambda edits: yaml.safe_dump(_changed(values, edits), allow_unicode=True))


def assert_loads_or_one_line(load: Callable[[], object]) -> None:
    """The call returns, or is refused in one line, within the bounds."""
    with _bounded():
        try:
            load()
        except USER_ERRORS as error:
            if len(str(error).splitlines()) == 1:
                return
            raise


@contextmanager
def _bounded() -> Iterator[None]:
    """TimeoutError after 5 s of CPU time, MemoryError beyond 1 GB more memory than now."""

    def time_is_over(*_: object) -> None:
        raise TimeoutError(f"more than {MOST_CPU_S:g} s of CPU time")

    previous = signal.signal(signal.SIGPROF, time_is_over)
    soft, hard = resource.getrlimit(resource.RLIMIT_AS)
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    resource.setrlimit(resource.RLIMIT_AS, (pages * resource.getpagesize() + MOST_MEMORY, hard))
    signal.setitimer(signal.ITIMER_PROF, MOST_CPU_S)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        resource.setrlimit(resource.RLIMIT_AS, (soft, hard))
        signal.signal(signal.SIGPROF, previous)


def _changed(values: Any, edits: Sequence[tuple[int, str, Any]]) -> Any:
    root = {"": deepcopy(values)}
    for number, kind, new in edits:
        places = list(_places(root))
        parent, key = places[number % len(places)]
        if kind == "set" or parent is root:
            parent[key] = new
        elif kind == "remove":
            del parent[key]
        elif isinstance(parent, dict):
            name = new if isinstance(new, (str, int, float, bool, type(None))) else "x"
            parent[name] = parent[key] if kind == "repeat" else parent.pop(key)
        else:
            parent.insert(key, deepcopy(parent[key]))
    return root[""]


def _places(values: Any) -> Iterator[tuple[Any, Any]]:
    """Every (container, key or index) in a tree of dicts and lists."""
    if isinstance(values, (dict, list)):
        for key in values if isinstance(values, dict) else range(len(values)):
            yield values, key
            yield from _places(values[key])
