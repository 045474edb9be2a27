"""Pictures in a fraction of the time, for tests of what is around them."""

from collections.abc import Mapping
from io import BytesIO
from typing import Any

import pytest

_DOTS_PER_INCH = 20


@pytest.fixture
def quick_pictures(monkeypatch: pytest.MonkeyPatch) -> None:
    """Figures are drawn and encoded small, not laid out; tests/serd_app/report does all of it."""
    from serd_app.report import style  # which imports matplotlib, and most tests draw nothing

    def saved(figure: Any, kind: str, metadata: Mapping[str, None]) -> bytes:
        buffer = BytesIO()
        with style.report_style():
            style._take_names_as_they_are(figure)
            figure.set_layout_engine("none")
            figure.savefig(buffer, format=kind, metadata=metadata, dpi=_DOTS_PER_INCH)
        return buffer.getvalue()

    monkeypatch.setattr(style, "_saved", saved)
