"""Pages of the site that are generated from the code."""

import re
import runpy
from pathlib import Path

import pytest

import serd_core
from serd_cli.app import COMMANDS

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def tool():
    return runpy.run_path(str(ROOT / "tools" / "build_site.py"))


def test_each_command_and_each_of_its_options_has_its_line(tool):
    page = tool["commands_page"]()
    for name, about in COMMANDS.items():
        assert f"* `{name}`: {about}\n" in page
        assert f"## `serd {name}`\n" in page
    assert not re.search(r"[a-z,;]\n(?!serd )[a-z]", page), "a line of prose is broken"
    assert "* `suggest`: Write a mapping file for 'serd demos' from the topics of a bag" in page
    assert "### `serd bag suggest`\n" in page
    assert "* `--cell-size-m <float>`: " in page
    assert "\n\n```bash\nserd report model.yaml --demonstrations decisions.csv\n```\n\n" in page


def test_public_names_of_the_library_and_modules_of_recordings_are_on_a_page(tool):
    pages = tool["python_pages"]()
    page = pages["reference/python/serd_core.learners.md"]
    assert "::: serd_core.learners.serd.fit_mdce_serd\n" in page
    assert "certificate" not in page
    named = set(re.findall(r"::: \S+\.(\w+)", "".join(pages.values())))
    assert {name for name in dir(serd_core) if not name.startswith("_")} <= named
    linked = "[scan](python/serd_bag.formats.mcap.md#serd_bag.formats.mcap.scan)"
    assert linked in pages["reference/python.md"]
    assert "reference/commands.md" in (ROOT / "mkdocs.yml").read_text()


def test_the_gallery_has_each_picture_once_and_prefers_its_own_page_to_the_readme(tool):
    pages = {
        "overview.md": "![seen from above](docs/pictures/a.gif) ![arrival](docs/pictures/b.png)",
        "docs/how_to/drive.md": "![predicted arrival](../pictures/b.png) ![drawn](../c.svg)",
    }
    rows = [line for line in tool["gallery"](pages).splitlines() if line.startswith("- ")]
    assert rows == [
        "- [![](docs/pictures/a.gif) Seen from above](overview.md)",
        "- [![](docs/pictures/b.png) Predicted arrival](docs/how_to/drive.md)",
    ]


def test_files_that_pages_link_to_are_on_the_site(tool):
    pages = tool["documents"]()
    assert Path("bags/data/record.sh") in tool["linked_files"](pages)
