"""Checks of arguments at the border of the package, each of which names what is wrong.

Arrays kept in records are private read-only copies, so a record cannot change after its checks.
What would not fit into memory is refused before it is built.
"""

import difflib
import os
import sys
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from serd_core.arrays import BoolArray, FloatArray, IntArray, first_index
from serd_core.errors import SerdError

if sys.platform != "win32":
    import resource

Shape = Sequence[int | None]

#: Characters of an argument that an error quotes at most.
LONGEST_SHOWN = 80


def float_array(name: str, values: Any, shape: Shape | None = None) -> FloatArray:
    """Read-only float copy of `values`; SerdError where it is not finite or misshapen."""
    array = _frozen(name, np.array(number_array(name, values), dtype=np.float64), shape)
    require_each(name, array, np.isfinite(array), "be finite", "remove or repair that value")
    return array


def int_array(name: str, values: Any, shape: Shape | None = None) -> IntArray:
    """Read-only integer copy of `values`; SerdError where a value is no whole number."""
    given = number_array(name, values)
    if given.dtype == np.bool_ or not np.can_cast(given.dtype, np.int64):
        given = np.array(float_array(name, given))
        require_each(name, given, given == np.floor(given), "be a whole number", "round it")
        small = np.abs(given) < 2.0**63
        require_each(name, given, small, "be below 2**63 in size", "number from 0")
    return _frozen(name, np.array(given, dtype=np.int64), shape)


def bool_array(name: str, values: Any, shape: Shape | None = None) -> BoolArray:
    """Read-only boolean copy of `values` (zeros and ones are taken as booleans)."""
    given = number_array(name, values)
    if not np.all((given == 0) | (given == 1)):
        raise SerdError(f"{name} must hold booleans, got values of type {given.dtype}; use a mask")
    return _frozen(name, np.array(given, dtype=np.bool_), shape)


def number_array(name: str, values: Any) -> NDArray[Any]:
    """`values` as an array, not copied where they are one; SerdError where they are no numbers.

    Text, dates and complex numbers are none, even where NumPy would convert them.
    """
    try:
        given = np.asarray(values)
        if given.dtype == np.object_:
            given = np.asarray(given.tolist()).reshape(given.shape)
        if given.dtype == np.object_ and values is not None:
            given = given.astype(np.float64)
    except (TypeError, ValueError, OverflowError) as error:
        raise SerdError(
            f"{name} must be an array of numbers, which this is not: {error}{misplaced(values)};"
            " pass equally long rows of numbers"
        ) from error
    if given.dtype.kind not in "biuf":
        example = given.ravel()[:1].tolist()
        raise SerdError(
            f"{name} must be an array of numbers, got {given.dtype} such as {example}; number"
            " labels from 0, and give dates in seconds"
        )
    return given


def chosen_indices(name: str, values: Any, size: int, what: str) -> IntArray:
    """(k,) indices into `size` things, given as such or as a mask (size,), in the order given."""
    if number_array(name, values).dtype == np.bool_:
        return np.flatnonzero(bool_array(name, values, (size,)))
    chosen = int_array(name, values, (None,))
    require_index(name, chosen, size, what)
    return chosen


def require_each(
    name: str, array: NDArray[Any], holds: BoolArray | np.bool_, rule: str, fix: str
) -> None:
    """SerdError naming the first entry of `array` that breaks a rule: where `holds` is false."""
    if (bad := first_index(~holds)) is not None:
        raise SerdError(f"{name}{list(bad)} must {rule}, got {array[bad]}; {fix}")


def require_index(
    name: str, array: IntArray, size: int, what: str, where: BoolArray | None = None
) -> None:
    """SerdError naming the first entry of `array` that is no index into `size` things."""
    holds = (array >= 0) & (array < size) | (False if where is None else ~where)
    rule, fix = f"be {what} from 0 to {size - 1}", "drop it or use the problem it was made for"
    require_each(name, array, holds, rule, fix)


def require_kind(name: str, given: object, kinds: tuple[type, ...], example: str) -> None:
    """SerdError unless an argument is an object of one of the classes."""
    if not isinstance(given, kinds):
        wanted = " or ".join(kind.__name__ for kind in kinds)
        raise SerdError(
            f"{name} must be a {wanted} object, got {shown(given)}{misplaced(given)}; use for"
            f" example {example}"
        )


def misplaced(given: object) -> str:
    """A question for an argument that is an object of this package, but not of the right class."""
    own = type(given).__module__.startswith("serd_core.") or isinstance(given, np.random.Generator)
    return " (are the arguments in the right order?)" if own else ""


def require_generator(rng: object) -> None:
    """SerdError unless `rng` is a generator of NumPy."""
    if not isinstance(rng, np.random.Generator):
        raise SerdError(
            f"rng must be a numpy.random.Generator, got {shown(rng)}{misplaced(rng)}; use"
            " numpy.random.default_rng(0)"
        )


def require_count(name: str, value: object, least: int, example: str) -> None:
    """SerdError unless an argument is one whole number of at least `least`."""
    if not (isinstance(value, int | np.integer) and not isinstance(value, bool) and value >= least):
        raise SerdError(
            f"{name} must be a whole number of at least {least}, got {shown(value)}; use {example}"
        )


def require_positive(name: str, value: Any, fix: str = "use for example 1") -> None:
    """SerdError unless an argument is one finite number above 0."""
    if not (is_number(value) and 0.0 < value < np.inf):
        raise SerdError(f"{name} must be finite and above 0, got {shown(value)}; {fix}")


def require_share(name: str, value: Any, example: str = "0.95") -> None:
    """SerdError unless an argument is one number between 0 and 1."""
    if not (is_number(value) and 0.0 < value < 1.0):
        raise SerdError(f"{name} must be between 0 and 1, got {shown(value)}; use {example}")


def is_number(value: Any) -> bool:
    """Whether an argument is one real number; an array of shape () is one, too."""
    scalar = value[()] if isinstance(value, np.ndarray) else value
    return isinstance(scalar, int | float | np.integer | np.floating)


def shown(value: object) -> str:
    """Text of a wrong argument, or its type where that is long."""
    text = str(value) if isinstance(value, np.generic) else repr(value)
    return text if len(text) <= LONGEST_SHOWN else f"one of type {type(value).__name__}"


def require_shape(name: str, array: NDArray[Any], *shapes: Shape) -> None:
    """SerdError unless an array has one of the shapes, in which None is any size."""
    for shape in shapes:
        if len(shape) == array.ndim and all(
            wanted in (None, size) for wanted, size in zip(shape, array.shape, strict=True)
        ):
            return
    sizes = [", ".join("any" if size is None else str(size) for size in each) for each in shapes]
    raise SerdError(
        f"{name} must have shape ({') or ('.join(sizes)}), got {array.shape}; reshape it"
    )


def nearest(name: object, known: Iterable[str]) -> str:
    """The end of a sentence that names the known name most like a wrong one; empty for none.

    >>> nearest("sofT_polcy", ["soft_policy", "laplace"])
    '; did you mean soft_policy?'
    """
    by_folded = {each.casefold(): each for each in known}
    close = difflib.get_close_matches(str(name).casefold(), by_folded, n=1)
    return f"; did you mean {by_folded[close[0]]}?" if close else ""


def _frozen(name: str, array: NDArray[Any], shape: Shape | None) -> NDArray[Any]:
    """The array, which cannot be written to; SerdError where it has another shape."""
    if shape is not None:
        require_shape(name, array, shape)
    array.flags.writeable = False
    return array


#: Bytes at the peak of a gradient, rounded down: per entry of P, of models that are given entry by
#: entry, and per pair (s, a).
BYTES_PER_ENTRY, LISTED_BYTES_PER_ENTRY, BYTES_PER_PAIR = 90, 200, 25


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
