"""`serd watch` beside a stack that another command has started."""

import asyncio
import json
import signal
import subprocess
import sys
from contextlib import contextmanager
from pathlib import Path

import pytest
from aiohttp import ClientSession

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


async def first_states(url, wanted):
    """The scene, and a state of which the condition holds."""
    async with ClientSession() as session:
        origin = {"Origin": url.rstrip("/")}
        async with session.ws_connect(f"{url}socket", headers=origin) as socket:
            scene = None
            async for message in socket:
                values = json.loads(message.data)
                scene = values if values["type"] == "scene" else scene
                if values["type"] == "state" and wanted(values):
                    return scene, values
    raise AssertionError("the page's server ended")


def moves(state):
    world = state["world"]
    return world and abs(world["robot"][3]) > 0.1 and state["episode"]["phase"] == "running"


@pytest.mark.parametrize("namespace", ["", "/robot1"])
def test_the_page_follows_a_stack_and_its_node_publishes_no_command(
    probe, ros_env, tmp_path, namespace
):
    launch = ["launch", "demonstrate", f"demo_recorder.output:={tmp_path}/b"]
    words = ["watch", "--port", "0", "--json"]
    if namespace:
        launch += [f"namespace:={namespace}", "frame_prefix:=robot1/"]
        words += ["--namespace", namespace, "--frame-prefix", "robot1/"]
    with (
        running(ros_env, tmp_path, *launch),
        running(ros_env, tmp_path, *words) as watch,
    ):
        url = read_json_object(watch.stdout)["url"]
        scene, state = asyncio.run(asyncio.wait_for(first_states(url, moves), PATIENCE_S))
        assert (scene["watch"], scene["replay"], scene["name"]) == (True, None, "hallway")
        assert len(state["world"]["people"]) > 10
        assert state["episode"]["other_driver"] == "scripted_expert"
        assert state["is_stale"] is False
        node = ("watch_page", namespace or "/")
        found = probe.node.get_publisher_names_and_types_by_node(*node)
        own = {f"{namespace}/diagnostics", "/rosout", "/parameter_events"}
        assert {name for name, _ in found} <= own
        assert probe.node.get_client_names_and_types_by_node(*node) == []
    assert watch.returncode == 0
