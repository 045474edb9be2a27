"""Chromium without a window; where a machine makes it slow, no limit of its driver ends a test."""

import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.resources import files
from pathlib import Path

import pytest
from selenium import webdriver

from support.waiting import PATIENCE_S

#: Width and height in pixels of a desk and a phone.
DEVICES = ((1280, 900), (400, 860))
SCHEMES = ("light", "dark")

_CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
_CHROMEDRIVER = shutil.which("chromedriver")
needs_chromium = pytest.mark.skipif(
    not (_CHROMIUM and _CHROMEDRIVER),
    reason="no Chromium on this machine: apt-get install chromium chromium-driver",
)


def start_chromium(folder: Path) -> webdriver.Chrome:
    """A browser whose profile is in the folder; its log is that of the pages' consoles."""
    options = webdriver.ChromeOptions()
    options.binary_location = _CHROMIUM or ""
    for argument in (
        "--headless=new", "--no-sandbox", "--disable-gpu", "--hide-scrollbars",
        "--window-size=1280,860", f"--user-data-dir={folder / 'chromium'}",
    ):  # fmt: skip
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    limits_ms = dict.fromkeys(("script", "pageLoad"), round(1000 * PATIENCE_S))
    options.set_capability("timeouts", limits_ms)
    browser = webdriver.Chrome(options, webdriver.ChromeService(_CHROMEDRIVER))
    browser.command_executor.client_config.timeout = PATIENCE_S
    # On a busy machine a browser without a window may start without the focus.
    browser.execute_cdp_cmd("Emulation.setFocusEmulationEnabled", {"enabled": True})
    return browser


@contextmanager
def chromium(*, width: int, height: int, scheme: str = "light") -> Iterator[webdriver.Chrome]:
    """A browser with a profile of its own and a window of this size."""
    with tempfile.TemporaryDirectory() as folder:
        browser = start_chromium(Path(folder))
        try:
            view(browser, width=width, height=height, scheme=scheme)
            yield browser
        finally:
            browser.quit()


def view(browser: webdriver.Chrome, *, width: int, height: int, scheme: str) -> None:
    """Give the page the size of a device and its colour scheme."""
    size = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    feature = {"name": "prefers-color-scheme", "value": scheme}
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": [feature]})


def violations(browser: webdriver.Chrome) -> list[tuple[str, list[str]]]:
    """What axe-core (in the package axe-playwright-python) finds on the page, with the elements."""
    if not browser.execute_script("return 'axe' in window"):
        axe = files("axe_playwright_python") / "axe.min.js"
        browser.execute_script(axe.read_text(encoding="utf-8"))
    return browser.execute_async_script(
        "const done = arguments[0]; axe.run().then((found) => done(found.violations.map("
        "(each) => [each.id, each.nodes.map((node) => node.html + node.failureSummary)])))"
    )


def sideways_px(browser: webdriver.Chrome) -> int:
    """By how much the page is wider than its window."""
    return browser.execute_script(
        "const page = document.documentElement; return page.scrollWidth - page.clientWidth"
    )
