"""The pictures of README, tutorials and how-to pages are what the code draws.

If one fails: `make pictures`, and look at it. Those of the demo are compared with the run of the
demo that SERD_DEMO names.
"""

import os
import re
import runpy
import shutil
import subprocess
from importlib.metadata import version
from pathlib import Path

import pytest

from support.browser import needs_chromium
from support.pixels import MOST_OTHER, share_of_other_pixels

ROOT = Path(__file__).resolve().parents[2]
TOOL = runpy.run_path(str(ROOT / "tools" / "draw_pictures.py"))
PICTURES = TOOL["PICTURES"]
#: Of the Chromium that has drawn the pages; another one may place letters otherwise.
CHROMIUM = "156"
pytestmark = pytest.mark.skipif(version("matplotlib") < "3.11", reason="drawn by matplotlib 3.11")


def chromium_version():
    name = shutil.which("chromium") or shutil.which("chromium-browser")
    printed = subprocess.run([name, "--version"], capture_output=True, text=True, check=True).stdout
    return re.search(r"Chromium (\d+)", printed)[1]


@pytest.mark.slow
@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=[needs_chromium] if "page" in name else [])
        for name in sorted(TOOL["DRAWN"])
    ],
)
def test_a_picture_is_what_the_code_draws(name, tmp_path):
    if "page" in name and chromium_version() != CHROMIUM:
        pytest.skip(f"drawn by Chromium {CHROMIUM}")
    TOOL["DRAWN"][name](tmp_path / name)
    assert share_of_other_pixels(tmp_path / name, PICTURES / name) <= MOST_OTHER


@pytest.mark.skipif("SERD_DEMO" not in os.environ, reason="no run of the demo is named")
@pytest.mark.parametrize("name", TOOL["OF_DEMO"])
def test_a_picture_of_the_demo_is_that_of_its_run(name):
    drawn = Path(os.environ["SERD_DEMO"]) / "figures" / f"{name}.png"
    assert share_of_other_pixels(drawn, PICTURES / f"demo_{name}.png") <= MOST_OTHER
