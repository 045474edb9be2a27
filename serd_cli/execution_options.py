"""Options that say where many tasks run, alike for every command that has them."""

from typing import Annotated

import typer

from sim.episodes.execution import BACKENDS

Jobs = Annotated[int, typer.Option(help="processes at a time, -1 for all cores")]
Backend = Annotated[str, typer.Option(help=", ".join(BACKENDS))]
Address = Annotated[
    str, typer.Option(help="of a running Dask or Ray cluster; else a local one is started")
]
