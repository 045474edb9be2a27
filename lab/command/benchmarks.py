"""`python -m lab benchmarks`: benchmarks one after the other."""

from importlib import import_module
from typing import Annotated

import typer

from lab.catalogue import BENCHMARKS
from serd_bag.nearest import choice_rule
from serd_cli.errors import UsageError


def benchmarks(
    names: Annotated[list[str] | None, typer.Argument(help="all when none is named")] = None,
) -> None:
    """Run all benchmarks, or those named.

    python -m lab benchmarks gradient lockstep

    Each prints a table and writes lab/results/NAME.json.
    """
    chosen = [name.replace("_", "-") for name in names or BENCHMARKS]
    for name in chosen:
        if name not in BENCHMARKS:
            raise UsageError(choice_rule("a benchmark", name, BENCHMARKS))
    for name in chosen:
        import_module(BENCHMARKS[name].module).run()
