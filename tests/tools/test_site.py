"""The site that `make site` built, opened as files: light and dark, on a desk and on a phone."""

import re
from pathlib import Path

import pytest
from selenium.webdriver.common.by import By

from serd_core import __version__
from support.browser import (
    DEVICES,
    SCHEMES,
    chromium,
    needs_chromium,
    sideways_px,
    view,
    violations,
)
from support.waiting import wait_until

SITE = Path(__file__).resolve().parents[2] / "site"
#: Front page, gallery, a tutorial, a notebook, wide pictures and tables, a generated page.
PAGES = (
    "index.html",
    "gallery.html",
    "docs/tutorials/own_recording.html",
    "docs/tutorials/recording_to_report.html",
    "docs/runtime.html",
    "reference/commands.html",
)
pytestmark = pytest.mark.skipif(not SITE.exists(), reason="no site was built: make site")


def test_no_page_loads_anything_from_a_network():
    """By its text; what scripts ask for is looked at in the browser."""
    loads = (
        r"<(?:script|img|iframe|source|link(?![^>]*canonical))\b[^>]*(?:src|href)=.?(?:https?:)?//"
    )
    pages = list(SITE.rglob("*.html"))
    assert len(pages) > 50
    assert not [page for page in pages if re.search(loads, page.read_text(encoding="utf-8"))]


@pytest.mark.slow
@needs_chromium
@pytest.mark.parametrize("scheme", SCHEMES)
def test_pages_have_no_violation_and_are_no_wider_than_their_window(scheme):
    with chromium(width=1280, height=900, scheme=scheme) as browser:  # the theme keeps the scheme
        cut_off(browser)
        for page in PAGES:
            for width, height in DEVICES:
                view(browser, width=width, height=height, scheme=scheme)
                browser.get((SITE / page).as_uri())
                assert asked_for(browser) == [], page
                assert violations(browser) == [], (page, width)
                assert sideways_px(browser) == 0, (page, width)


@pytest.mark.slow
@needs_chromium
def test_the_search_finds_pages_without_a_network():
    with chromium(width=1280, height=900) as browser:
        cut_off(browser)
        browser.get((SITE / "docs" / "bags.html").as_uri())
        browser.find_element(By.CLASS_NAME, "md-search__input").send_keys("Foxglove Rerun")
        page = (SITE / "docs" / "how_to" / "recordings.html").as_uri()
        wait_until(lambda: any(link.startswith(page) for link in links_found(browser)))
        assert asked_for(browser) == []


@pytest.mark.slow
@needs_chromium
def test_a_page_in_dark_mode_is_printed_light_and_names_its_version():
    with chromium(width=800, height=900, scheme="dark") as tab:
        tab.get((SITE / "docs" / "runtime.html").as_uri())
        tab.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "print"})
        wait_until(lambda: tab.find_elements(By.CSS_SELECTOR, "body[data-md-color-scheme=default]"))
        assert sideways_px(tab) == 0
        assert f"SERD {__version__}" in tab.find_element(By.CLASS_NAME, "md-copyright").text


def links_found(browser):
    links = "document.querySelectorAll('.md-search-result__link')"
    return browser.execute_script(f"return [...{links}].map((link) => link.href)")


def cut_off(browser):
    """Every request to a network fails, and is in the log of the browser."""
    browser.execute_cdp_cmd("Network.enable", {})
    limits = {"offline": True, "latency": 0, "downloadThroughput": 0, "uploadThroughput": 0}
    browser.execute_cdp_cmd("Network.emulateNetworkConditions", limits)


def asked_for(browser):
    """What pages asked a network for since the last look."""
    lines = [entry["message"] for entry in browser.get_log("browser")]
    return [line for line in lines if line.startswith(("http", "ws"))]
