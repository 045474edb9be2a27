"""How many small faults of a package its tests notice, at places drawn at random.

A fault changes one comparison, operation, number or logical connection of a copy of the tree. The
tests that mirror the package run on the copy until one fails; a fault that none notices is printed.
The same seed gives the same places, so that two sets of tests compare.
"""

import argparse
import ast
import json
import os
import random
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
#: Of each package: the folder of its source, and what its tests are mirrored below.
PACKAGES = {
    "serd_core": ("serd_core", "tests/serd_core"),
    "serd_bag": ("bags/serd_bag", "tests/bags"),
    "planners": ("sim/serd_sim/planning", "tests/sim/planning"),
    "guard": ("sim/serd_sim/safety", "tests/sim/safety"),
    "teleop": ("serd_app/teleop", "tests/serd_app/teleop"),
    "drives": ("serd_app/drives", "tests/serd_app/drives"),
}
#: Pairs of operators that replace each other.
_PAIRS = [(ast.Lt, ast.LtE), (ast.Gt, ast.GtE), (ast.Eq, ast.NotEq), (ast.Is, ast.IsNot)]
_PAIRS += [(ast.Add, ast.Sub), (ast.Mult, ast.Div), (ast.And, ast.Or)]
OTHER: dict[Any, Any] = {**dict(_PAIRS), **{second: first for first, second in _PAIRS}}


def places(tree: ast.AST) -> list[Any]:
    """Nodes of the tree that a fault can change, in the order of the walk."""
    return [
        node
        for node in ast.walk(tree)
        if (isinstance(node, ast.Constant) and type(node.value) in (int, float))
        or (isinstance(node, ast.Compare) and type(node.ops[0]) in OTHER)
        or (isinstance(node, ast.BinOp | ast.BoolOp) and type(node.op) in OTHER)
    ]


def change(node: Any) -> None:
    """Put the fault into the node."""
    if isinstance(node, ast.Constant):
        node.value += 1
    elif isinstance(node, ast.Compare):
        node.ops[0] = OTHER[type(node.ops[0])]()
    else:
        node.op = OTHER[type(node.op)]()


def with_faults(tree: Path, source: str, n_places: int, seed: int) -> Iterator[tuple[Path, str]]:
    """Each module that was drawn and its fault, while the fault is in the tree."""
    texts = {path: path.read_text() for path in sorted((tree / source).rglob("*.py"))}
    drawn = [(path, i) for path, text in texts.items() for i in range(len(places(ast.parse(text))))]
    for path, index in random.Random(seed).sample(drawn, min(n_places, len(drawn))):
        module = ast.parse(texts[path])
        node = places(module)[index]
        before, line = ast.unparse(node), node.lineno
        change(node)
        path.write_text(ast.unparse(module))
        yield path, f"{path.relative_to(tree)}:{line} {before} -> {ast.unparse(node)}"
        path.write_text(texts[path])


def tests_notice(tree: Path, tests: Path) -> bool:
    """Whether a test of the folder, or of the nearest above it that exists, fails on the tree."""
    while not tests.is_dir():
        tests = tests.parent
    packages = os.pathsep.join(str(tree / each) for each in ("", "sim", "bags"))
    environment = {**os.environ, "PYTHONPATH": packages}
    words = [sys.executable, "-m", "pytest", "-x", "-n", "0", "-p", "no:cacheprovider", tests]
    given = {"cwd": tree, "env": environment, "capture_output": True, "timeout": 600.0}
    try:
        return subprocess.run(words, **given).returncode != 0
    except subprocess.TimeoutExpired:
        return True


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("package", choices=PACKAGES)
    parser.add_argument("--places", type=int, default=24, help="how many faults (24)")
    parser.add_argument("--seed", type=int, default=36, help="of the places (36)")
    parser.add_argument("--report", type=Path, help="JSON file of what was noticed")
    given = parser.parse_args()
    source, tests = PACKAGES[given.package]
    noticed: dict[str, bool] = {}
    with tempfile.TemporaryDirectory() as folder:
        tree = Path(folder) / "tree"
        names = subprocess.check_output(["git", "ls-files", "-z"], cwd=ROOT, text=True).split("\0")
        for path in (ROOT / name for name in names if (ROOT / name).is_file()):
            (copy := tree / path.relative_to(ROOT)).parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(path, copy)
        for path, fault in with_faults(tree, source, given.places, given.seed):
            noticed[fault] = tests_notice(
                tree, tree / tests / path.relative_to(tree / source).parent
            )
            print(f"{'noticed' if noticed[fault] else 'NOT noticed'}: {fault}", flush=True)
    print(f"{given.package}: {sum(noticed.values())} of {len(noticed)} faults noticed")
    if given.report:
        given.report.write_text(json.dumps(noticed, indent=1) + "\n")


if __name__ == "__main__":
    main()
