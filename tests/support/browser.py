"""Chromium without a window; where a machine makes it slow, no limit of its driver ends a test."""

import shutil
from pathlib import Path

import pytest
from selenium import webdriver

from support.waiting import PATIENCE_S

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
    return browser
