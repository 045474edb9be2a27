"""The site that `make site` built, by axe-core in light and dark, on a desk and on a phone."""

from pathlib import Path

import pytest

from support.browser import (
    DEVICES,
    SCHEMES,
    chromium,
    needs_chromium,
    sideways_px,
    view,
    violations,
)

SITE = Path(__file__).resolve().parents[2] / "site"
#: The front page, a tutorial, a notebook, pages with wide pictures and tables, a generated one.
PAGES = (
    "index.html",
    "docs/tutorials/own_recording.html",
    "docs/tutorials/recording_to_report.html",
    "docs/runtime.html",
    "reference/commands.html",
)


@pytest.mark.slow
@needs_chromium
@pytest.mark.skipif(not SITE.exists(), reason="no site was built: make site")
@pytest.mark.parametrize("scheme", SCHEMES)
def test_pages_have_no_violation_and_are_no_wider_than_their_window(scheme):
    with chromium(width=1280, height=900, scheme=scheme) as browser:  # the theme keeps the scheme
        for page in PAGES:
            for width, height in DEVICES:
                view(browser, width=width, height=height, scheme=scheme)
                browser.get((SITE / page).as_uri())
                assert violations(browser) == [], (page, width)
                assert sideways_px(browser) == 0, (page, width)
