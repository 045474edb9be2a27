"""What pydantic found wrong, as one sentence: dotted key, rule, value received, fix."""

import re
from collections.abc import Sequence

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from storage.model_keys import keys_at
from storage.nearest import hint

_LONGEST_VALUE = 60
_PLAIN_WORDS = {
    "must be have": "must have",
    " a valid integer": " an integer",
    " a valid ": " a ",
    " array": " list",
    " object": " group of keys",
    " after validation": "",
}


def sentence_of(error: ValidationError, model_class: type[BaseModel]) -> str:
    """The most telling of the faults; the number of the others is added."""
    details = sorted(error.errors(include_url=False), key=_rank)
    others = len(details) - 1
    more = f" ({others} more fault{'s' if others > 1 else ''})" if others else ""
    return _sentence(details[0], model_class) + more


def dotted(place: Sequence[int | str]) -> str:
    """A place inside a file as people write it: `walls[2].outline_m`."""
    parts = [f"[{step}]" if isinstance(step, int) else f".{step}" for step in place]
    return "".join(parts).lstrip(".")


def _rank(detail: ErrorDetails) -> int:
    """An unknown key first: the missing one it was meant to be is its consequence."""
    return {"extra_forbidden": 0, "missing": 2}.get(detail["type"], 1)


def _sentence(detail: ErrorDetails, model_class: type[BaseModel]) -> str:
    key = dotted(detail["loc"])
    if detail["type"] == "extra_forbidden":
        name = str(detail["loc"][-1])
        return f"{key} is not a known key; {hint(name, keys_at(model_class, detail['loc'][:-1]))}"
    if detail["type"] == "missing":
        return f"{key} is required but missing; add it"
    if detail["type"] in ("value_error", "assertion_error"):
        return _own_rule(key, detail["msg"].split(", ", 1)[1])
    return f"{key or 'the file'} {_rule(detail)}, got {_shortened(detail['input'])}{_near(detail)}"


def _own_rule(key: str, message: str) -> str:
    if not key:
        return message
    return f"{key} {message}" if message.startswith(("must ", "is ")) else f"{key}: {message}"


def _rule(detail: ErrorDetails) -> str:
    if detail["type"] == "model_type":
        return "must hold keys and values"
    message = re.sub(r"^Input should (?:be )?", "must be ", detail["msg"])
    message = re.sub(r"^(\w+) should ", "must ", message)
    for pydantic_word, plain_word in _PLAIN_WORDS.items():
        message = message.replace(pydantic_word, plain_word)
    return message


def _near(detail: ErrorDetails) -> str:
    if detail["type"] != "literal_error":
        return ""
    allowed = re.findall(r"'([^']*)'", detail["ctx"]["expected"])
    return f"; {hint(str(detail['input']), allowed)}"


def _shortened(value: object) -> str:
    text = repr(value)
    return text if len(text) <= _LONGEST_VALUE else text[: _LONGEST_VALUE - 1] + "…"
