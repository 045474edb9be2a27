"""foxglove_server with a client of its protocol, and without its package."""

import asyncio
import json
import re
import struct
import sys

import aiohttp
import pytest
from nav_msgs.msg import OccupancyGrid, Odometry
from rclpy.serialization import deserialize_message
from rosbags.typesys import get_types_from_msg

from serd_cli.processes.node_commands import node_command
from serd_ros.endpoints import qos
from serd_ros.errors import NodeError
from serd_ros.nodes import foxglove_server
from support.waiting import PATIENCE_S, wait_until

pytestmark = [pytest.mark.ros, pytest.mark.slow]
_HEAD = struct.Struct("<BIQ")
_MESSAGE_DATA = 1
_UNKNOWN = re.compile(r"Unknown channel ID: (\d+)")


class Client:
    """Subscribes to every channel; schemas: (type, definition), messages: bytes, by topic."""

    def __init__(self):
        self.schemas, self.messages, self._topics = {}, {}, {}

    async def run_until(self, port, condition, turn):
        async with aiohttp.ClientSession() as session:
            url = f"ws://127.0.0.1:{port}"
            async with session.ws_connect(url, protocols=["foxglove.sdk.v1"]) as socket:
                while not condition():
                    turn()
                    try:
                        received = await socket.receive(0.1)
                    except asyncio.TimeoutError:
                        continue
                    await self._take(socket, received)

    async def _take(self, socket, received):
        if received.type is aiohttp.WSMsgType.TEXT:
            message = json.loads(received.data)
            for channel in message.get("channels", ()) if message["op"] == "advertise" else ():
                number, topic = channel["id"], channel["topic"]
                assert channel["encoding"] == "cdr"
                self._topics[number] = topic
                self.schemas[topic] = channel["schemaName"], channel["schema"]
                await self._subscribe(socket, number)
            # The server advertises a channel before it knows it itself, and refuses who is faster.
            if message["op"] == "status" and (unknown := _UNKNOWN.fullmatch(message["message"])):
                await self._subscribe(socket, int(unknown[1]))
        elif received.type is aiohttp.WSMsgType.BINARY:
            code, number, _ = _HEAD.unpack_from(received.data)
            assert code == _MESSAGE_DATA
            self.messages[self._topics[number]] = received.data[_HEAD.size :]

    async def _subscribe(self, socket, number):
        wish = {"id": number, "channelId": number}
        await socket.send_json({"op": "subscribe", "subscriptions": [wish]})


def test_a_client_receives_topics_with_their_types_and_latched_ones_late(nodes, probe, ros_env):
    command = node_command("foxglove_server", {"port": 0}, {}, ros_env)
    nodes.start(command, "foxglove_server", forked=False)
    wait_until(lambda: "open ws://" in nodes.log_of("foxglove_server"))
    port = re.search(r"open ws://127\.0\.0\.1:(\d+)", nodes.log_of("foxglove_server"))[1]
    grid, odometry = OccupancyGrid(), Odometry()
    grid.info.width, odometry.pose.pose.position.x = 7, 2.5
    latched = probe.node.create_publisher(OccupancyGrid, "map", qos.LATCHED)
    latched.publish(grid)
    speeds = probe.node.create_publisher(Odometry, "odom", qos.SENSOR)
    expected = {"/map": grid, "/odom": odometry}
    for _ in range(2):  # the second client comes after the latched message was sent
        client = Client()
        asyncio.run(
            asyncio.wait_for(
                client.run_until(
                    port,
                    lambda client=client: expected.keys() <= client.messages.keys(),
                    lambda: speeds.publish(odometry),
                ),
                PATIENCE_S,
            )
        )
        for topic, message in expected.items():
            assert deserialize_message(client.messages[topic], type(message)) == message
        name, definition = client.schemas["/odom"]
        assert name == "nav_msgs/msg/Odometry"
        assert "geometry_msgs/msg/PoseWithCovariance" in get_types_from_msg(definition, name)


def test_without_the_package_the_error_has_the_command_that_installs_it(monkeypatch):
    monkeypatch.setitem(sys.modules, "foxglove", None)
    with pytest.raises(NodeError, match=re.escape("pip install 'serd[foxglove]'")):
        foxglove_server._sdk()
