"""Runs the page in a thread of its own, beside whoever drives the robot."""

import asyncio
import errno
import json
import threading
from collections.abc import Mapping
from typing import Any

from aiohttp import web

from teleop.errors import TeleopError
from teleop.page.access import PageAccess
from teleop.page.app import make_app
from teleop.page.hub import Hub
from teleop.page.wishes import Wish

_START_LIMIT_S = 10.0
_SHUTDOWN_S = 0.5


class PageServer:
    """Serves from construction until `close`. port 0 takes a free one; `port` tells which."""

    def __init__(self, scene: Mapping[str, Any], access: PageAccess, port: int) -> None:
        self.access, self.port = access, port
        self._hub = Hub(json.dumps(scene))
        self._loop = asyncio.new_event_loop()
        self._runner: web.AppRunner | None = None
        self._thread = threading.Thread(target=self._run, name="page", daemon=True)
        self._thread.start()
        try:
            self._call(self._begin())
        except OSError as error:
            self.close()
            raise TeleopError(_no_server(access.address, port, error)) from None

    @property
    def url(self) -> str:
        """Where a browser on this machine finds the page."""
        host = "127.0.0.1" if self.access.address in ("0.0.0.0", "::") else self.access.address
        host = f"[{host}]" if ":" in host else host
        return f"http://{host}:{self.port}/"

    @property
    def driving_page(self) -> int:
        """Number of the page that drives, 0 for none."""
        return self._hub.driving or 0

    def take(self) -> list[Wish]:
        """What the driving page has asked for since."""
        waiting = self._hub.wishes
        return [waiting.get_nowait() for _ in range(waiting.qsize())]

    def show(self, state: Mapping[str, Any]) -> None:
        """Show all pages how things stand."""
        text = json.dumps(state, allow_nan=False)
        self._loop.call_soon_threadsafe(self._hub.show, text)

    def say(self, sentence: str) -> None:
        """Show all pages a sentence."""
        self._loop.call_soon_threadsafe(self._hub.say, sentence)

    def close(self) -> None:
        """End all connections and the thread; a second call does nothing."""
        if not self._thread.is_alive():
            return
        if self._runner is not None:
            self._call(self._runner.cleanup())
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join()
        self._loop.close()

    def _run(self) -> None:
        asyncio.set_event_loop(self._loop)
        self._loop.run_forever()

    def _call(self, coroutine: Any) -> None:
        asyncio.run_coroutine_threadsafe(coroutine, self._loop).result(_START_LIMIT_S)

    async def _begin(self) -> None:
        app = make_app(self._hub, self.access)
        self._runner = web.AppRunner(app, access_log=None, shutdown_timeout=_SHUTDOWN_S)
        await self._runner.setup()
        site = web.TCPSite(self._runner, self.access.address, self.port)
        await site.start()
        self.port = int(self._runner.addresses[0][1])


def _no_server(address: str, port: int, error: OSError) -> str:
    if error.errno == errno.EADDRINUSE:
        return f"port {port} of {address} is in use; choose another, 0 takes a free one"
    return f"cannot serve on {address} port {port}: {error.strerror}; check address and port"
