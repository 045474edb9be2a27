"""The committed pictures agree with their sources; the check needs no Graphviz."""

import runpy
import xml.etree.ElementTree as ElementTree
from pathlib import Path
from types import SimpleNamespace

import pytest
import yaml

ROOT = Path(__file__).resolve().parents[2]
SVG = "{http://www.w3.org/2000/svg}"


@pytest.fixture(scope="module")
def drawing():
    return SimpleNamespace(**runpy.run_path(str(ROOT / "tools" / "draw_architecture.py")))


def titles(picture, kind):
    """Titles of all nodes or edges of an SVG that Graphviz wrote."""
    root = ElementTree.parse(picture).getroot()
    groups = [group for group in root.iter(f"{SVG}g") if group.get("class") == kind]
    return {str(group.findtext(f"{SVG}title")).replace("\\n", "\n") for group in groups}


def test_the_committed_pictures_have_the_nodes_and_arrows_of_their_sources(drawing):
    for name, picture in drawing.pictures().items():
        file = drawing.PICTURES / f"{name}.svg"
        hint = f"run `make pictures` and commit the result: {name}"
        assert titles(file, "node") == set(picture.nodes), hint
        assert titles(file, "edge") == {f"{start}->{end}" for start, end in picture.edges}, hint


def test_every_node_is_in_a_picture(drawing):
    nodes = yaml.safe_load(drawing.GRAPH_FILE.read_text())["nodes"]
    shown = {name for picture in drawing.pictures().values() for name in picture.nodes}
    # The first is for robots; the others stand beside any stack.
    others = {"people_tracker", "watch_page", "bag_replay"}
    assert set(nodes) - shown == others


def test_topics_with_the_same_ends_share_one_ellipse_and_topics_of_all_nodes_have_no_arrows(
    drawing, tmp_path
):
    graph = tmp_path / "graph.yaml"
    graph.write_text(
        "nodes:\n"
        "  simulator: {publishes: [/clock, scan, map], subscribes: [cmd_vel], serves: [reset]}\n"
        "  planner: {publishes: [velocity], subscribes: [/clock, scan, map]}\n"
        "  strategy: {subscribes: [/clock], calls: [reset]}\n"
        "  other: {subscribes: [scan]}\n"
        "stacks:\n"
        "  some:\n"
        "    about: without the other\n"
        "    nodes: [simulator, planner, strategy]\n"
        "    remappings: {planner: {velocity: cmd_vel}}\n"
    )
    picture = drawing.topics_picture("some", graph)
    names = {"simulator", "planner", "strategy", "map\nscan", "cmd_vel", "reset"}
    assert set(picture.nodes) == names | {"(every node)\n/clock"}
    assert set(picture.edges) == {
        ("simulator", "map\nscan"),
        ("map\nscan", "planner"),
        ("planner", "cmd_vel"),
        ("cmd_vel", "simulator"),
        ("strategy", "reset"),
        ("reset", "simulator"),
    }
