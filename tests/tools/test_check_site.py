"""Pages of the site that a screen reader or a phone cannot show are found."""

import runpy
from pathlib import Path

import pytest

from support.browser import needs_chromium

TOOL = runpy.run_path(str(Path(__file__).resolve().parents[2] / "tools" / "check_site.py"))
GOOD = (
    '<!DOCTYPE html><html lang="en"><head><title>Good</title>'
    '<meta name="viewport" content="width=device-width"></head>'
    "<body><main><h1>Good</h1></main></body></html>"
)
PALE_AND_WIDE = GOOD.replace(
    "</h1>", '</h1><p style="color: #ccc; background: #fff; width: 600px">pale</p>'
)


@pytest.mark.slow
@needs_chromium
def test_pale_text_and_a_page_wider_than_a_phone_are_named(tmp_path):
    for name, text in (("good.html", GOOD), ("bad.html", PALE_AND_WIDE)):
        (tmp_path / name).write_text(text)
    found = TOOL["faults"](tmp_path, ("good.html", "bad.html"))
    assert not [each for each in found if each.startswith("good.html")]
    assert len([each for each in found if "color-contrast at 1 elements" in each]) == 4
    wide = [each for each in found if "wider than its window" in each]
    assert [each.split(":")[0] for each in wide] == [
        f"bad.html, {scheme}, 400 pixels wide" for scheme in ("light", "dark")
    ]
