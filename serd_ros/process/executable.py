"""What every installed executable runs: the node that has its name.

`lib/serd_ros/hallway_sim` is the node hallway_sim, and so is `python -m serd_ros.process.executable
hallway_sim`. The node is imported here, so that Ctrl-C meanwhile ends quietly.
"""

import sys
from importlib import import_module
from pathlib import Path

from serd_ros.process.quiet_interrupt import starting


def main() -> int:
    """Entry point: the node this file is named after."""
    return run(Path(sys.argv[0]).stem)


def run(node: str) -> int:
    """Import the node and run it; its exit code."""
    with starting():
        module = import_module(f"serd_ros.nodes.{node}")
    return int(module.main())


if __name__ == "__main__":
    sys.exit(run(sys.argv.pop(1)))
