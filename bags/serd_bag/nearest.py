"""The nearest right name for a wrong one, for every "did you mean"."""

from collections.abc import Iterable
from difflib import get_close_matches

_CUTOFF = 0.6


def nearest_name(name: str, candidates: Iterable[str]) -> str | None:
    """The candidate most like `name` (letter case aside), or None where none is close."""
    by_folded = {candidate.casefold(): candidate for candidate in candidates}
    close = get_close_matches(name.casefold(), by_folded, n=1, cutoff=_CUTOFF)
    return by_folded[close[0]] if close else None


def choice_rule(what: str, name: str, candidates: Iterable[str]) -> str:
    """The sentence that `what` must be one of the candidates, with the nearest if one is near."""
    known = list(candidates)
    meant = nearest_name(name, known)
    fix = f"; did you mean {meant!r}?" if meant else ""
    return f"{what} must be one of {', '.join(known)}, got {name!r}{fix}"


def hint(name: str, candidates: Iterable[str]) -> str:
    """The fix to put at the end of a sentence: the nearest candidate, or all of them."""
    known = sorted(candidates)
    meant = nearest_name(name, known)
    if meant is not None:
        return f"did you mean {meant!r}?"
    return f"choose from {', '.join(known)}" if known else "none is known"
