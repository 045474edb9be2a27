"""`serd watch`: a running stack or a recording on a web page that drives nothing."""

import os
import sys
from contextlib import suppress
from pathlib import Path
from typing import Annotated

import typer
from rich.text import Text

from serd_app.places.kept_scenario import scenario_of_model
from serd_app.teleop.page.access import PageAccess, read_token
from serd_app.teleop.page.server import PageServer
from serd_app.teleop.page.view import watched_scene_of
from serd_cli.errors import UsageError
from serd_cli.options import AsJson, option, resolved_scenario, validated
from serd_cli.output.terminal import print_json, progress_console
from serd_cli.processes.node_commands import node_command
from serd_cli.processes.stack_run import run_alone
from serd_cli.processes.workspace import ros_environment
from serd_cli.watch import BagWatch, layers_of, serve_bag
from serd_files.model_file import load_model
from serd_ros.graph.configs import BagReplayConfig, WatchPageConfig
from serd_ros.graph.graph import full_namespace
from serd_ros.process.progress import Progress
from serd_sim.scenario.grid import grid_of
from serd_sim.scenario.scenario import load_scenario

_NODE = "watch_page"


def watch(
    bag: Annotated[
        Path | None,
        typer.Argument(metavar="BAG", help="recording to replay; without it, the running stack"),
    ] = None,
    scenario: Annotated[
        str, typer.Option(help="built-in scenario or YAML file; that of the --model, else hallway")
    ] = "",
    model: Annotated[
        Path | None,
        typer.Option(help="learned model: policy, arrival and dynamics are drawn over BAG"),
    ] = None,
    rate: float = option(BagReplayConfig, "rate"),
    address: str = option(WatchPageConfig, "address"),
    port: int = option(WatchPageConfig, "port"),
    token_file: str = option(WatchPageConfig, "token_file"),
    namespace: Annotated[
        str, typer.Option(help="of the robot that is shown, as robot1; / for topics without one")
    ] = "",
    frame_prefix: str = option(WatchPageConfig, "frame_prefix"),
    as_json: AsJson = False,
) -> None:
    """Watch a running stack, or a recording, on a web page that drives nothing.

    serd watch

    The page shows what others have started with 'serd launch' in the same
    ROS domain. It publishes no command, and the viewer needs a browser only.

    serd watch demo_output/run-1/bag --rate 4

    A recording has a time line: play, pause, go to a time, change the speed.
    With --model demo_output/run-1/model.yaml it has the layers of that model,
    as the running stack has those of its learner.

    One of several robots is shown with --namespace robot1, and with
    --frame-prefix robot1/ where its stack has a frame_prefix.

    With --json the address of the page is printed as JSON. Ctrl-C ends.
    """
    if model is not None and bag is None:
        raise UsageError(
            f"--model must be left out without a BAG, got {model}; the page draws the models that"
            " a learner in the graph publishes"
        )
    if model is not None and not scenario:
        scenario = scenario_of_model(model, load_model(model).scenario)
    settings = validated(
        WatchPageConfig,
        scenario=resolved_scenario(scenario or WatchPageConfig().scenario),
        address=address,
        port=port,
        token_file=str(Path(token_file).resolve()) if token_file else "",
        frame_prefix=frame_prefix,
    )
    access = PageAccess(settings.address, read_token(settings.token_file))
    place = load_scenario(settings.scenario)
    with suppress(KeyboardInterrupt):  # the usual end
        if bag is None:
            if rate != 1.0:
                raise UsageError(f"--rate must be left out without a BAG, got {rate:g}")
            _watch_stack(settings, full_namespace(namespace), as_json=as_json)
            return
        validated(BagReplayConfig, bag=str(bag), rate=rate)
        layers = None if model is None else layers_of(model, place)
        shown = BagWatch(bag, place, rate, namespace=namespace, frame_prefix=frame_prefix)
        scene = watched_scene_of(place, grid_of(place), shown.replay)
        server = PageServer(scene, access, settings.port)
        if layers is not None:
            server.show_overlay(layers)
        _print_address(server.url, as_json=as_json)
        try:
            serve_bag(shown, server)
        finally:
            server.close()


def _watch_stack(settings: WatchPageConfig, namespace: str, *, as_json: bool) -> None:
    environment = ros_environment(os.environ)
    remappings = {"__ns": namespace} if namespace else {}
    command = node_command(_NODE, settings.model_dump(), remappings, environment)

    def take(progress: Progress) -> None:
        if progress.address:
            _print_address(progress.address, as_json=as_json)

    run_alone(_NODE, command, environment, take)


def _print_address(url: str, *, as_json: bool) -> None:
    if as_json:
        print_json({"url": url})
        sys.stdout.flush()
    else:
        progress_console.print(Text.assemble("watch at ", (url, "bold"), "   (Ctrl-C ends)"))
