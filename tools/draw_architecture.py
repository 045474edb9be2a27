"""Draw packages.svg, journey.svg and topics_STACK.svg in docs/pictures with Graphviz.

Packages: the layers of the import-linter contracts in pyproject.toml, described by the first line
of each package. Journey: the modules of JOURNEY, described likewise. Topics:
serd_ros/graph/graph.yaml, a picture for each stack of STACKS, since a picture of all nodes is
unreadable. Run `make pictures` after changing any of them.
"""

import ast
import subprocess
import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from itertools import chain, pairwise, product
from pathlib import Path
from typing import Any

import yaml

try:
    import tomllib
except ModuleNotFoundError:  # Python 3.10
    import tomli as tomllib

ROOT = Path(__file__).resolve().parents[1]
PICTURES = ROOT / "docs" / "pictures"
GRAPH_FILE = ROOT / "serd_ros" / "graph" / "graph.yaml"
#: The stacks that together show every node of interest.
STACKS = ("demonstrate_and_learn", "navigate", "teleop", "replay_and_learn", "nav2")
#: The way of the data from a recording to an arrival: each module, and what it passes on.
JOURNEY = (
    ("serd_bag.reader", "messages"),
    ("serd_app.drives.sessions", "drives: poses, actions, episodes"),
    ("serd_app.demonstrations.discretise", "decisions (s, a, s')"),
    ("serd_app.learning.recipe", "rewards and outcome models"),
    ("serd_files.model_file", "model.yaml"),
    ("serd_sim.drivers.strategy", "plan: policy and remaining time"),
    ("serd_app.navigation.navigator", "waypoint"),
    ("serd_sim.planning.local_planner", "velocity"),
    ("serd_sim.world.world", "pose, time of arrival"),
    ("serd_app.navigation.comparison", "predicted beside measured"),
)
JOURNEY_START = "bag"
#: What the picture of a stack with the bridge shows beside it.
NAV2_BRIDGE, NAV2 = "nav2_bridge", "Nav2"
_NAV2_ACTIONS = "navigate_to_pose\nnavigate_through_poses"

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


@dataclass(frozen=True)
class Picture:
    """A directed graph: attributes of each node, edges, ranks of nodes, labels of edges."""

    direction: str
    nodes: Mapping[str, str]
    edges: tuple[tuple[str, str], ...]
    ranks: tuple[tuple[str, ...], ...] = ()
    caption: str = ""
    labels: Mapping[tuple[str, str], str] = field(default_factory=dict)

    def dot(self) -> str:
        """The graph in the DOT language."""
        lines = [f"  {_quoted(name)} [{attributes}];" for name, attributes in self.nodes.items()]
        lines += [f"  {{ rank=same; {' '.join(map(_quoted, rank))} }}" for rank in self.ranks]
        lines += [f"  {self._edge(*edge)};" for edge in self.edges]
        if self.caption:
            lines.append(f'  label={_quoted(self.caption)}; fontsize=14; fontcolor="#7f8b97";')
        return f"digraph {{\n  rankdir={self.direction};{_LOOK}" + "\n".join(lines) + "\n}\n"

    def _edge(self, start: str, end: str) -> str:
        label = self.labels.get((start, end))
        attributes = f" [label={_quoted('  ' + label)}]" if label else ""
        return f"{_quoted(start)} -> {_quoted(end)}{attributes}"


def layers_of(package: str = "") -> list[list[str]]:
    """Packages from the top layer down, as the import-linter contracts list them.

    package: its subpackages instead; empty where no contract orders them.
    """
    text = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    for contract in tomllib.loads(text)["tool"]["importlinter"]["contracts"]:
        if contract["type"] == "layers" and contract["layers"][0].rpartition(".")[0] == package:
            return [[name.strip() for name in layer.split("|")] for layer in contract["layers"]]
    return []


def packages_picture() -> Picture:
    """Packages in layers; an arrow goes to each package of the next layer down."""
    layers = layers_of()
    labels = {name: _package_label(name) for layer in layers for name in layer}
    nodes = {name: f"{_PACKAGE_LOOK}, label=<{label}>" for name, label in labels.items()}
    edges = [edge for above, below in pairwise(layers) for edge in product(above, below)]
    caption = "arrow: may import; also everything further down"
    return Picture("TB", nodes, tuple(edges), tuple(map(tuple, layers)), caption)


def journey_picture() -> Picture:
    """The modules of JOURNEY from top to bottom; each arrow has what is passed on."""
    modules = [module for module, _ in JOURNEY]
    names = [JOURNEY_START, *modules, JOURNEY[-1][1]]
    labels = {name: _label(name, file_of(name).with_suffix(".py")) for name in modules}
    nodes = dict.fromkeys(names, _TOPIC_LOOK)
    nodes |= {name: f"{_PACKAGE_LOOK}, label=<{label}>" for name, label in labels.items()}
    edges = tuple(pairwise(names))
    passed_on = dict(zip(edges[1:], (data for _, data in JOURNEY[:-1]), strict=False))
    return Picture("TB", nodes, edges, labels=passed_on)


def topics_picture(stack: str, graph_file: Path = GRAPH_FILE) -> Picture:
    """Nodes of a stack as boxes; topics, and services, with the same ends share one ellipse.

    Topics that touch every node of the stack are named in a note without arrows.
    """
    described = yaml.safe_load(graph_file.read_text())
    graph = _stack_graph(described, stack)
    own = {*graph}
    if NAV2_BRIDGE in graph:
        graph |= _nav2(graph)
    topics = _ends(graph, ("publishes",), ("subscribes", "may_subscribe"))
    shared = [name for name, (talkers, hearers) in topics.items() if talkers | hearers >= own]
    groups = _grouped({name: ends for name, ends in topics.items() if name not in shared})
    services = _grouped(_ends(graph, ("calls",), ("serves",)))
    nodes = {name: _NODE_LOOK if name in own else _OTHER_LOOK for name in graph}
    nodes |= dict.fromkeys(groups, _TOPIC_LOOK)
    nodes |= dict.fromkeys(services, _SERVICE_LOOK)
    if shared:
        nodes["\n".join(["(every node)", *shared])] = _NOTE_LOOK
    edges = [
        edge
        for name, (talkers, hearers) in (groups | services).items()
        for edge in [*((end, name) for end in talkers), *((name, end) for end in hearers)]
    ]
    legend = "blue: node; white: topic; dashed: service or action"
    caption = f"{stack}: {described['stacks'][stack]['about']}\n{legend}"
    return Picture("LR", nodes, tuple(edges), caption=caption)


def pictures() -> dict[str, Picture]:
    """Every picture by the name of its file."""
    drawn = {f"topics_{stack}": topics_picture(stack) for stack in STACKS}
    return {"packages": packages_picture(), "journey": journey_picture(), **drawn}


def file_of(dotted: str) -> Path:
    """Folder or file, without suffix, of a package or module."""
    package, *inner = dotted.split(".")
    beside = next(each for each in (ROOT, ROOT / "sim", ROOT / "bags") if (each / package).is_dir())
    return beside.joinpath(package, *inner)


def _package_label(name: str) -> str:
    """Name, first line of the package and, where a contract orders them, its subpackages.

    These are in the order of the data; those of one layer stand together, as `report, teleop`.
    """
    label = _label(name, file_of(name) / "__init__.py")
    layers = [", ".join(each.rpartition(".")[2] for each in layer) for layer in layers_of(name)]
    parts = " → ".join(reversed(layers))
    return f'{label}<br/><font point-size="12">{parts}</font>' if parts else label


def _label(name: str, module: Path) -> str:
    documentation = ast.get_docstring(ast.parse(module.read_text())) or ""
    first_line = escape(documentation.split("\n")[0].rstrip("."), quote=False).replace("`", "")
    lines = "<br/>".join(textwrap.wrap(first_line, 44))
    small = f'<br/><font point-size="11" color="#6b7885">{lines}</font>' if lines else ""
    return f"<b>{name}</b>{small}"


Listed = Mapping[str, Mapping[str, list[str]]]
Ends = dict[str, tuple[set[str], set[str]]]


def _ends(graph: Listed, *sides: Sequence[str]) -> Ends:
    """{topic or service: (nodes that list it under keys of one side, those of the other side)}."""
    found: Ends = {}
    for node, listed in graph.items():
        for side, keys in enumerate(sides):
            for name in chain.from_iterable(listed.get(key) or () for key in keys):
                found.setdefault(name, (set(), set()))[side].add(node)
    return dict(sorted(found.items()))


def _stack_graph(described: Mapping[str, Any], stack: str) -> dict[str, dict[str, list[str]]]:
    """The stack's nodes with the names that topics have there."""
    chosen, found = described["stacks"][stack], {}
    for node in chosen["nodes"]:
        renamed, listed = chosen.get("remappings", {}).get(node, {}), described["nodes"][node]
        found[node] = {key: [renamed.get(name, name) for name in listed[key]] for key in listed}
    return found


def _nav2(graph: Listed) -> dict[str, dict[str, list[str]]]:
    """Nav2, which is started apart, and the bridge with the actions that it requests of Nav2."""
    bridge = dict(graph[NAV2_BRIDGE])
    bridge["calls"] = [*bridge.get("calls", ()), _NAV2_ACTIONS]
    nav2 = {"serves": [_NAV2_ACTIONS], "subscribes": ["scan"], "publishes": ["cmd_vel_raw"]}
    return {NAV2_BRIDGE: bridge, NAV2: nav2}


def _grouped(ends: Ends) -> dict[str, tuple[list[str], list[str]]]:
    """{names with the same ends, one a line: their sorted ends}."""
    groups: dict[tuple[tuple[str, ...], tuple[str, ...]], list[str]] = {}
    for name, (talkers, hearers) in ends.items():
        groups.setdefault((tuple(sorted(talkers)), tuple(sorted(hearers))), []).append(name)
    return {"\n".join(names): ([*talk], [*hear]) for (talk, hear), names in groups.items()}


def _quoted(name: str) -> str:
    return '"' + name.replace('"', '\\"').replace("\n", "\\n") + '"'


def main() -> None:
    """Draw them all, each with its DOT source beside it."""
    PICTURES.mkdir(parents=True, exist_ok=True)
    for name, picture in pictures().items():
        source, path = PICTURES / f"{name}.dot", PICTURES / f"{name}.svg"
        source.write_text(picture.dot())
        try:
            subprocess.run(["dot", "-Tsvg", "-o", str(path), str(source)], check=True)
        except FileNotFoundError:
            raise SystemExit("needs Graphviz: apt-get install graphviz") from None
        print(f"drawn: {path}")


if __name__ == "__main__":
    main()
