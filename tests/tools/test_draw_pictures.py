"""The pictures of README, tutorials and how-to pages are what the code draws.

If one fails: `make pictures`, and look at it. Those of the demo are drawn from kept data, which CI
compares with the demo that it runs.
"""

import re
import runpy
import shutil
import subprocess
from importlib.metadata import version
from pathlib import Path

import pytest
from PIL import Image

from support.browser import needs_chromium
from support.pixels import share_of_other_pixels

ROOT = Path(__file__).resolve().parents[2]
TOOL = runpy.run_path(str(ROOT / "tools" / "draw_pictures.py"))
#: Of the Chromium that has drawn the pages; another one may place letters otherwise.
CHROMIUM = "156"


def chromium_version() -> str:
    name = shutil.which("chromium") or shutil.which("chromium-browser")
    printed = subprocess.run([name, "--version"], capture_output=True, text=True, check=True).stdout
    return re.search(r"Chromium (\d+)", printed)[1]


drawn_by_matplotlib = pytest.mark.skipif(
    version("matplotlib") < "3.11", reason="drawn by matplotlib 3.11"
)


@drawn_by_matplotlib
@pytest.mark.slow
@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=[needs_chromium] if name in TOOL["OF_PAGES"] else [])
        for name in sorted(TOOL["DRAWN"])
    ],
)
def test_a_picture_is_what_the_code_draws(name):
    if name in TOOL["OF_PAGES"] and chromium_version() != CHROMIUM:
        pytest.skip(f"drawn by Chromium {CHROMIUM}")
    assert TOOL["drifted"]([name]) == []


@drawn_by_matplotlib
def test_one_arrow_that_turned_is_found(tmp_path):
    """Half the social norm: the policy takes other ways."""
    kept = tmp_path / "demo"
    shutil.copytree(TOOL["KEPT"], kept)
    model = (kept / "model.yaml").read_text()
    changed = re.sub(r"social_norm: [\d.]+", "social_norm: 0.0", model, count=1)
    assert changed != model
    (kept / "model.yaml").write_text(changed)
    assert TOOL["drifted"](["demo_policy.png"], kept) == ["demo_policy.png"]


def test_pictures_of_other_sizes_or_lengths_are_others(tmp_path):
    frames = [Image.new("RGB", (20, 10), shade) for shade in ("white", "grey", "white")]
    for name, shown in (("long", frames), ("short", frames[:2])):
        shown[0].save(tmp_path / f"{name}.gif", save_all=True, append_images=shown[1:])
    frames[0].resize((20, 12)).save(tmp_path / "high.gif")
    assert share_of_other_pixels(tmp_path / "long.gif", tmp_path / "long.gif") == 0.0
    assert share_of_other_pixels(tmp_path / "long.gif", tmp_path / "short.gif") == 1.0
    assert share_of_other_pixels(tmp_path / "long.gif", tmp_path / "high.gif") == 1.0
