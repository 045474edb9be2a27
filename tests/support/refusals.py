"""Tests of the sentences with which wrong input is refused, as one table."""

from collections.abc import Callable
from typing import Any

import pytest

from serd_core.errors import SerdError


def refusals(*cases: tuple[Callable[[], Any], str]) -> Callable[..., None]:
    """A test that every call raises a SerdError whose sentence matches the pattern beside it."""

    @pytest.mark.parametrize(("call", "sentence"), cases)
    def test(call: Callable[[], Any], sentence: str) -> None:
        with pytest.raises(SerdError, match=sentence):
            call()

    return test
