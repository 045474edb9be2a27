"""World, planner, mux, recorder and page are started; drive, save or discard episodes.

Ctrl-C ends. Each session has a new session-N folder.
"""

from pathlib import Path
from typing import Annotated, Any

import typer

from serd_cli.options import AsJson, free_folder, resolved_scenario, validated, with_settings
from serd_cli.processes.teleop_settings import TeleopSettings


@with_settings(TeleopSettings)
def teleop(
    output: Annotated[Path, typer.Option(help="folder that gets a session-N folder")] = Path(
        "teleop_output"
    ),
    as_json: AsJson = False,
    **options: Any,
) -> None:
    """Parse the options, run the stack and print what was recorded."""
    from serd_cli.processes.teleop_session import require_page, require_start, run_session

    options["scenario"] = resolved_scenario(options["scenario"])
    settings = validated(TeleopSettings, **options)
    require_start(settings)
    require_page(settings)
    run_session(settings, free_folder(output, "session").resolve(), as_json=as_json)
