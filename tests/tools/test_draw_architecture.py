"""The committed pictures agree with their sources; the check needs no Graphviz."""

import re
import runpy
from pathlib import Path

import yaml

ROOT = Path(__file__).resolve().parents[2]
SOURCES = runpy.run_path(str(ROOT / "tools" / "draw_architecture.py"))["pictures"]()


def test_the_committed_pictures_have_the_nodes_and_arrows_of_their_sources():
    for name, source in SOURCES.items():
        drawn = (ROOT / "docs" / "pictures" / f"{name}.dot").read_text()
        committed, present = (re.sub(r", label=<.*>", "", each) for each in (drawn, source))
        assert committed == present, f"run `make pictures` and commit the result: {name}"


def test_every_node_is_in_a_picture():
    nodes = yaml.safe_load((ROOT / "serd_ros/graph/graph.yaml").read_text())["nodes"]
    shown = set(re.findall(r'^  "(\w+)" \[', "\n".join(SOURCES.values()), re.M))
    # The first is for robots; the other stands beside any stack.
    assert set(nodes) - shown == {"people_tracker", "watch_page"}
