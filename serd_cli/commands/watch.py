"""serd watch

The page shows what others have started with 'serd launch', or play with
'serd bag play', in the same ROS domain. It publishes no command, and the
viewer needs a browser only.

One of several robots is shown with --namespace robot1, and with
--frame-prefix robot1/ where its stack has a frame_prefix.

With --json the address of the page is printed as JSON. Ctrl-C ends.
"""

import os
import sys
from contextlib import suppress
from pathlib import Path
from typing import Annotated, Any

from rich.text import Text

from serd_app.teleop.page.server import PageAccess, read_token
from serd_cli.options import AsJson, opt, resolved_scenario, validated, with_settings
from serd_cli.output.terminal import print_json, progress_console
from serd_cli.processes.node_commands import node_command
from serd_cli.processes.stack_run import run_alone
from serd_cli.processes.workspace import ros_environment
from serd_ros.graph.graph import full_namespace
from serd_ros.process.progress import Progress
from serd_ros.settings import WatchPageConfig
from serd_sim.scenario.scenario import load_scenario


@with_settings(WatchPageConfig)
def watch(
    namespace: Annotated[
        str, opt("of the robot that is shown, as robot1; / for topics without one")
    ] = "",
    as_json: AsJson = False,
    **options: Any,
) -> None:
    """Parse the options and run the page until it is stopped."""
    options["scenario"] = resolved_scenario(options["scenario"])
    if options["token_file"]:
        options["token_file"] = str(Path(options["token_file"]).resolve())
    settings = validated(WatchPageConfig, **options)
    PageAccess(settings.address, read_token(settings.token_file))
    load_scenario(settings.scenario)
    environment = ros_environment(os.environ)
    remappings = {"__ns": full} if (full := full_namespace(namespace)) else {}
    command = node_command("watch_page", settings.model_dump(), remappings, environment)

    def take(progress: Progress) -> None:
        if progress.address and as_json:
            print_json({"url": progress.address})
            sys.stdout.flush()
        elif progress.address:
            address = progress.address, "bold"
            progress_console.print(Text.assemble("watch at ", address, "   (Ctrl-C ends)"))

    with suppress(KeyboardInterrupt):  # the usual end
        run_alone("watch_page", command, environment, take)
