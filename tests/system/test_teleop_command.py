"""`serd teleop` as a person types it into a terminal, with a page."""

import asyncio
import contextlib
import json
import os
import pty
import re
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
    """`serd teleop` in a separate terminal."""

    def __init__(self, folder, environment, *arguments):
        self._person, device = pty.openpty()
        self._device = device
        self.output = ""
        os.set_blocking(self._person, False)
        self.process = subprocess.Popen(
            [sys.executable, "-c", _IN_ITS_TERMINAL, SERD, "teleop", *arguments],
            cwd=folder, env=environment, stdin=device, stdout=device, stderr=device,
            start_new_session=True,
        )  # fmt: skip

    def wait_for(self, words):
        self._wait_until(lambda: words in self.output)

    def _wait_until(self, condition):
        def read_and_look():
            self.read()
            return condition()

        wait_until(read_and_look, seen=lambda: self.output)

    def read(self):
        with contextlib.suppress(BlockingIOError):
            self.output += os.read(self._person, 65536).decode(errors="replace")

    def request(self, do):
        """Start, save or discard an episode, as the page's buttons do."""
        (url,) = set(re.findall(r"http://[^\s\x1b]+", self.output))

        async def send():
            async with ClientSession() as session:
                origin = {"Origin": url.rstrip("/")}
                async with session.ws_connect(f"{url}socket", headers=origin) as socket:
                    await socket.send_json({"type": "episode", "do": do})

        asyncio.run(send())

    def end(self):
        """Ctrl-C, as the terminal itself passes it on; the exit code."""
        os.write(self._person, b"\x03")
        self._wait_until(lambda: self.process.poll() is not None)
        self.read()
        return self.process.returncode

    def close(self):
        if self.process.poll() is None:
            self.process.terminate()  # not killed, so that it ends its nodes
            self.process.wait(PATIENCE_S)
        os.close(self._person)
        os.close(self._device)


# The terminal becomes the controlling one, so that Ctrl-C reaches the command as a signal.
_IN_ITS_TERMINAL = """
import fcntl, os, sys, termios
fcntl.ioctl(0, termios.TIOCSCTTY, 0)
os.execv(sys.argv[1], sys.argv[1:])
"""


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
