"""A setting of an experiment's config: its default, and what `--help` says of it."""

from dataclasses import field
from typing import Any, TypeVar

Value = TypeVar("Value")


def setting(default: Value, about: str) -> Value:
    """A dataclass field; default: immutable; about: a phrase without a full stop."""
    declared: Any = field(default=default, metadata={"about": about})
    return declared  # type: ignore[no-any-return]
