"""Rewards and dynamics from demonstrations in Markov decision processes.

    import serd_core as sc

`__init__.pyi` lists the names of this flat interface. Each is imported from its module at first
use, as imports of single modules are to stay fast.
"""

import ast
import functools
import importlib
from pathlib import Path
from typing import Any

__version__ = "0.4.0"


@functools.cache
def _homes() -> dict[str, str]:
    """Module of each name of the interface."""
    stub = ast.parse(Path(__file__).with_name("__init__.pyi").read_text(encoding="utf-8"))
    imports = (node for node in stub.body if isinstance(node, ast.ImportFrom))
    return {name.name: str(node.module) for node in imports for name in node.names}


def __getattr__(name: str) -> Any:
    if name == "__all__":
        return __dir__()
    home = None if name.startswith("_") else _homes().get(name)
    if home is None:
        meant = importlib.import_module("serd_core.checks").nearest(name, __dir__())
        raise AttributeError(
            f"module 'serd_core' has no attribute {name!r}{meant}; CHANGELOG.md has names that left"
        )
    if home == __name__:  # a module of the interface
        return importlib.import_module(f"{home}.{name}")
    found = getattr(importlib.import_module(home), name)
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    return sorted({"__version__", *_homes()})
