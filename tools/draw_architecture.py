"""Draw packages.svg, journey.svg and topics_STACK.svg in docs/pictures with Graphviz.

They are made of the import-linter contracts in pyproject.toml, of the first lines of modules and of
serd_ros/graph/graph.yaml. Run `make pictures` after changing any of them.
"""

import ast
import json
import subprocess
import textwrap
from collections import defaultdict
from collections.abc import Iterable, Mapping
from functools import partial
from html import escape
from importlib.util import find_spec
from itertools import chain, pairwise, product
from pathlib import Path

import yaml
from importlinter.api import read_configuration

ROOT = Path(__file__).resolve().parents[1]
PICTURES = ROOT / "docs" / "pictures"
#: The stacks that together show every node of interest.
STACKS = ("demonstrate_and_learn", "navigate", "teleop", "replay_and_learn", "nav2")
#: From a recording to an arrival: each module, and what it passes on.
JOURNEY = {
    "serd_bag.reader": "messages",
    "serd_app.drives.sessions": "drives: poses, actions, episodes",
    "serd_app.demonstrations.discretise": "decisions (s, a, s')",
    "serd_app.learning.recipe": "rewards and outcome models",
    "serd_files.model_file": "model.yaml",
    "serd_sim.drivers.strategy": "plan: policy and remaining time",
    "serd_app.navigation.navigator": "waypoint",
    "serd_sim.planning.local_planner": "velocity",
    "serd_sim.world.world": "pose, time of arrival",
    "serd_app.navigation.comparison": "predicted beside measured",
}
_LOOK = """
  graph [bgcolor="transparent", fontname="DejaVu Sans", pad=0.25, nodesep=0.2, ranksep=0.4];
  node [fontname="DejaVu Sans", fontsize=14, fontcolor="#26323d", color="#6b7885", penwidth=1.1];
  edge [color="#8a96a3", arrowsize=0.8, penwidth=1.2, fontname="DejaVu Sans"];
  edge [fontsize=10, fontcolor="#7f8b97"];
"""
_NODE_LOOK = 'shape=box, style="filled,bold", fillcolor="#c9deef", margin="0.12,0.09"'
_TOPIC_LOOK = 'shape=box, style="rounded,filled", fillcolor="#ffffff", margin="0.06,0.04", height=0'
_OTHER_LOOK = 'shape=box, style="filled,bold,dashed", fillcolor="#f3e3c8", margin="0.12,0.09"'
_SERVICE_LOOK = _TOPIC_LOOK.replace("filled", "filled,dashed")
_PACKAGE_LOOK = 'shape=box, style="rounded,filled", fillcolor="#eef3f8", margin="0.18,0.10"'
_NOTE_LOOK = 'shape=note, style="filled", fillcolor="#f6f5f1"'
#: Text as DOT writes it.
_quoted = partial(json.dumps, ensure_ascii=False)
Ends = tuple[tuple[str, ...], ...]


def dot(
    direction: str,
    nodes: Mapping[str, str],
    edges: Mapping[tuple[str, str], str],
    ranks: Iterable[Iterable[str]] = (),
    caption: str = "",
) -> str:
    """A graph in the DOT language, of the attributes of each node and the label of each edge."""
    lines = [f"  {_quoted(name)} [{attributes}];" for name, attributes in nodes.items()]
    lines += [f"  {{ rank=same; {' '.join(map(_quoted, rank))} }}" for rank in ranks]
    for (start, end), label in edges.items():
        attributes = f" [label={_quoted('  ' + label)}]" if label else ""
        lines.append(f"  {_quoted(start)} -> {_quoted(end)}{attributes};")
    if caption:
        lines.append(f'  label={_quoted(caption)}; fontsize=14; fontcolor="#7f8b97";')
    return f"digraph {{\n  rankdir={direction};{_LOOK}" + "\n".join(lines) + "\n}\n"


def layers_of(package: str = "") -> list[list[str]]:
    """Packages, or subpackages of one, from the top layer down, as the contracts list them."""
    for contract in read_configuration(str(ROOT / "pyproject.toml"))["contracts_options"]:
        if contract["type"] == "layers" and contract["layers"][0].rpartition(".")[0] == package:
            return [[name.strip() for name in layer.split("|")] for layer in contract["layers"]]
    return []


def packages_picture() -> str:
    """Packages in layers; an arrow goes to each package of the next layer down."""
    layers = layers_of()
    nodes = {}
    for name in (name for layer in layers for name in layer):
        # Subpackages are in the order of the data; those of one layer stand together.
        inner = [", ".join(part.rpartition(".")[2] for part in each) for each in layers_of(name)]
        parts = f'<br/><font point-size="12">{" → ".join(reversed(inner))}</font>' if inner else ""
        nodes[name] = f"{_PACKAGE_LOOK}, label=<{_label(name)}{parts}>"
    edges = [edge for above, below in pairwise(layers) for edge in product(above, below)]
    caption = "arrow: may import; also everything further down"
    return dot("TB", nodes, dict.fromkeys(edges, ""), layers, caption)


def journey_picture() -> str:
    """The modules of JOURNEY from top to bottom; each arrow has what is passed on."""
    names = ["bag", *JOURNEY, [*JOURNEY.values()][-1]]
    looks = {name: f"{_PACKAGE_LOOK}, label=<{_label(name)}>" for name in JOURNEY}
    nodes = {name: looks.get(name, _TOPIC_LOOK) for name in names}
    passed_on = ["", *[*JOURNEY.values()][:-1], ""]
    return dot("TB", nodes, dict(zip(pairwise(names), passed_on, strict=True)))


def topics_picture(stack: str) -> str:
    """Nodes of a stack as boxes; topics, and services, with the same ends share one ellipse.

    Topics that touch every node of the stack are named in a note without arrows.
    """
    described = yaml.safe_load((ROOT / "serd_ros" / "graph" / "graph.yaml").read_text())
    chosen, graph = described["stacks"][stack], {}
    for node in chosen["nodes"]:
        renamed = chosen.get("remappings", {}).get(node, {})
        listed = described["nodes"][node].items()
        graph[node] = {key: [renamed.get(name, name) for name in names] for key, names in listed}
    own = {*graph}
    if "nav2_bridge" in graph:  # Nav2 is started apart, with the actions that the bridge requests
        actions = ["navigate_to_pose\nnavigate_through_poses"]
        graph["nav2_bridge"].setdefault("calls", []).extend(actions)
        graph["Nav2"] = {"serves": actions, "subscribes": ["scan"], "publishes": ["cmd_vel_raw"]}
    nodes = {name: _NODE_LOOK if name in own else _OTHER_LOOK for name in graph}
    edges: dict[tuple[str, str], str] = {}
    topics = _grouped(graph, ["publishes"], ["subscribes", "may_subscribe"])
    shared = [names for (talk, hear), names in topics.items() if {*talk, *hear} >= own]
    services = _grouped(graph, ["calls"], ["serves"])
    for look, groups in ((_TOPIC_LOOK, topics), (_SERVICE_LOOK, services)):
        for (talk, hear), names in groups.items():
            if names not in shared:
                nodes[name := "\n".join(names)] = look
                edges |= dict.fromkeys([*product(talk, [name]), *product([name], hear)], "")
    if shared:
        nodes["\n".join(["(every node)", *sorted(chain(*shared))])] = _NOTE_LOOK
    legend = "blue: node; white: topic; dashed: service or action"
    caption = f"{stack}: {chosen['about']}\n{legend}"
    return dot("LR", nodes, edges, caption=caption)


def pictures() -> dict[str, str]:
    """The DOT source of each picture by the name of its file."""
    topics = {f"topics_{stack}": topics_picture(stack) for stack in STACKS}
    return topics | {"packages": packages_picture(), "journey": journey_picture()}


def _label(name: str) -> str:
    """The name of a package or module, and the first line of it."""
    module = ast.parse(Path(find_spec(name).origin).read_text(encoding="utf-8"))
    first_line = (ast.get_docstring(module) or "").split("\n")[0].rstrip(".").replace("`", "")
    lines = "<br/>".join(textwrap.wrap(escape(first_line, quote=False), 44))
    small = f'<br/><font point-size="11" color="#6b7885">{lines}</font>' if lines else ""
    return f"<b>{name}</b>{small}"


def _grouped(
    graph: Mapping[str, Mapping[str, list[str]]], *sides: list[str]
) -> dict[Ends, list[str]]:
    """Topics or services by the nodes that list them under keys of one side, and of the other."""
    ends: dict[str, list[set[str]]] = defaultdict(lambda: [set(), set()])
    for node, listed in graph.items():
        for side, keys in enumerate(sides):
            for name in chain.from_iterable(listed.get(key) or () for key in keys):
                ends[name][side].add(node)
    groups: dict[Ends, list[str]] = defaultdict(list)
    for name in sorted(ends):
        groups[tuple(tuple(sorted(nodes)) for nodes in ends[name])].append(name)
    return groups


if __name__ == "__main__":
    for name, source in pictures().items():
        (PICTURES / f"{name}.dot").write_text(source)
        drawn = PICTURES / f"{name}.svg"
        subprocess.run(["dot", "-Tsvg", "-o", drawn], input=source, text=True, check=True)
        print(f"drawn: {drawn}")
