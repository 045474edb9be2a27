"""`serd teleop` with a page, interrupted as a terminal does it."""

import asyncio
import json
import os
import re
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from aiohttp import ClientSession
from geometry_msgs.msg import PoseStamped

from serd_app.drives.sessions import read_drives
from serd_ros.convert.stamp import stamp_s
from serd_ros.endpoints import qos
from support.waiting import PATIENCE_S, wait_until

SERD = str(Path(sys.executable).with_name("serd"))


class Session:
    """`serd teleop` in a process group of its own, as a terminal starts it."""

    def __init__(self, folder, environment, *arguments):
        self._log = folder / "teleop.log"
        with self._log.open("wb") as log:
            self.process = subprocess.Popen(
                [SERD, "teleop", *arguments], cwd=folder, env=environment,
                stdout=log, stderr=log, start_new_session=True,
            )  # fmt: skip

    @property
    def output(self):
        return self._log.read_text()

    def wait_for(self, words):
        wait_until(lambda: words in self.output, seen=lambda: self.output)

    @property
    def url(self):
        (url,) = set(re.findall(r"http://[^\s\x1b]+", self.output))
        return url

    def request(self, do):
        """Start, save or discard an episode, as the page's buttons do."""
        url = self.url

        async def send():
            async with ClientSession() as session:
                origin = {"Origin": url.rstrip("/")}
                async with session.ws_connect(f"{url}socket", headers=origin) as socket:
                    await socket.send_json({"type": "episode", "do": do})

        asyncio.run(send())

    def end(self):
        """Ctrl-C, which a terminal sends to the whole group; the exit code."""
        os.killpg(self.process.pid, signal.SIGINT)
        return self.process.wait(PATIENCE_S)

    def close(self):
        if self.process.poll() is None:
            self.process.terminate()  # not killed, so that it ends its nodes
            self.process.wait(PATIENCE_S)


@pytest.mark.ros
@pytest.mark.slow
def test_a_page_starts_saves_and_discards_and_a_second_run_is_apart(probe, ros_env, tmp_path):
    times_s = []
    probe.node.create_subscription(
        PoseStamped, "robot_pose", lambda m: times_s.append(stamp_s(m.header.stamp)), qos.STATE
    )

    def wait_for_poses():
        """Until the world has gone on, so that the episode has a duration."""
        n_poses = len(times_s)
        probe.spin_until(lambda: len(times_s) > n_poses and times_s[-1] > times_s[n_poses] + 0.3)

    for number in (1, 2):
        as_json = ["--json"] if number == 2 else []
        given = ["--port", "0", "--people", "0", "--driver", "anna", "--seed", "2", *as_json]
        session = Session(tmp_path, ros_env, *given)
        try:
            session.wait_for("the world is running")
            session.wait_for("drive at")
            session.request("start")
            session.wait_for("episode 1 of anna has begun")
            wait_for_poses()
            session.request("save")
            session.wait_for("so far 1 kept (0 arrived), 0 discarded")
            session.request("start")
            session.wait_for("episode 2 of anna has begun")
            wait_for_poses()
            session.request("discard")
            session.wait_for("so far 1 kept (0 arrived), 1 discarded")
            assert session.end() == 0
        finally:
            session.close()
        bag = tmp_path / f"teleop_output/session-{number}/bag"
        if as_json:
            recorded = json.loads(re.search(r'\{\s+"bag".*', session.output, re.DOTALL)[0])
            assert recorded["outcomes"] == {"saved": 1, "discarded": 1}
            assert recorded["bag"] == str(bag)
            assert f"serd demos {bag} --scenario hallway" in recorded["decisions"]
        else:
            assert "1 episode kept (1 saved), 1 discarded" in session.output
        assert [span.outcome for span in read_drives(bag)[0].episodes] == ["saved", "discarded"]


async def hold_from_the_start(url, n_decisions):
    """Start an episode and hold north all the time, until so many decisions were taken."""
    async with ClientSession() as client:
        origin = {"Origin": url.rstrip("/")}
        async with client.ws_connect(f"{url}socket", headers=origin) as socket:
            await socket.send_json({"type": "episode", "do": "start"})
            async for message in socket:
                state = json.loads(message.data)
                if state["type"] == "state" and state["episode"]["decisions"] >= n_decisions:
                    return state
                await socket.send_json({"type": "hold", "direction": "north"})
    raise AssertionError("the page's server ended")


@pytest.mark.ros
@pytest.mark.slow
def test_a_direction_held_while_the_stack_starts_drives_once_it_runs(ros_env, tmp_path):
    session = Session(tmp_path, ros_env, "--port", "0", "--people", "0", "--seed", "2")
    try:
        session.wait_for("drive at")
        state = asyncio.run(asyncio.wait_for(hold_from_the_start(session.url, 4), PATIENCE_S))
        assert state["episode"]["phase"] == "running"
        assert state["choice"] == "north"
        assert session.end() == 0
    finally:
        session.close()
