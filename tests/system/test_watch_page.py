"""`serd watch` beside a stack that was started before."""

import asyncio
import json
import signal
import subprocess
import sys
from contextlib import contextmanager
from pathlib import Path

import pytest
from aiohttp import ClientSession

from serd_cli.processes.workspace import stack_processes
from serd_ros.graph.graph import find_stack
from support.processes import read_json_object
from support.waiting import PATIENCE_S

SERD = str(Path(sys.executable).with_name("serd"))
pytestmark = [pytest.mark.ros, pytest.mark.slow]


@contextmanager
def running(environment, folder, *words):
    """A command, which Ctrl-C ends."""
    with subprocess.Popen(
        [SERD, *words], env=environment, cwd=folder, stdout=subprocess.PIPE, text=True
    ) as process:
        try:
            yield process
        finally:
            process.send_signal(signal.SIGINT)
            process.stdout.read()


async def messages_until(url, wanted):
    """The newest message of the page of each type, at the first of which the condition holds."""
    newest = {}
    async with ClientSession() as session:
        origin = {"Origin": url.rstrip("/")}
        async with session.ws_connect(f"{url}socket", headers=origin) as socket:
            async for message in socket:
                values = json.loads(message.data)
                newest[values["type"]] = values
                if wanted(values):
                    return newest
    raise AssertionError("the page's server ended")


def received(url, wanted):
    return asyncio.run(asyncio.wait_for(messages_until(url, wanted), PATIENCE_S))


def moves(values):
    world = values["type"] == "state" and values["world"]
    return world and abs(world["robot"][3]) > 0.1 and values["episode"]["phase"] == "running"


def test_the_page_follows_a_stack_and_its_node_publishes_no_command(
    nodes, probe, ros_env, tmp_path
):
    stack = find_stack("demonstrate")
    # The world stands until the page is there, or it would compute for nobody.
    watched = [*stack.parameters["hallway_sim"]["required_nodes"], "watch_page"]
    given = {"demo_recorder.output": str(tmp_path / "b"), "hallway_sim.required_nodes": watched}
    given["frame_prefix"] = "robot1/"
    words = ["watch", "--port", "0", "--json", "--namespace", "robot1"]
    words += ["--frame-prefix", "robot1/"]
    for process in stack_processes(stack, given, ros_env, "/robot1"):
        nodes.start(list(process.command), process.name)
    with running(ros_env, tmp_path, *words) as watch:
        url = read_json_object(watch.stdout)["url"]
        newest = received(url, moves)
        scene, state = newest["scene"], newest["state"]
        assert (scene["watch"], scene["name"]) == (True, "hallway")
        assert len(state["world"]["people"]) > 10
        assert state["episode"]["other_driver"] == "scripted_expert"
        assert state["is_stale"] is False
        node = ("watch_page", "/robot1")
        found = probe.node.get_publisher_names_and_types_by_node(*node)
        own = {"/robot1/diagnostics", "/rosout", "/parameter_events"}
        assert {name for name, _ in found} <= own
        assert probe.node.get_client_names_and_types_by_node(*node) == []
    assert watch.returncode == 0
