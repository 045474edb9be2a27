"""The web server of the page: static files and one WebSocket, from this machine on loopback,
elsewhere with a token. It runs in a thread of its own, beside the node that drives the robot.

Pages of other sites must not drive: the WebSocket requires the origin of this server, and on
loopback the Host header must be a loopback name (DNS rebinding).
"""

import asyncio
import contextlib
import errno
import hmac
import ipaddress
import json
import logging
import threading
from collections.abc import Awaitable, Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from aiohttp import WSMsgType, web
from aiohttp.http_exceptions import HttpProcessingError
from aiohttp.log import server_logger

from serd_app.errors import TeleopError
from serd_app.teleop.page.hub import LARGEST_REQUEST_BYTES, Hub, OpenPage, PageRequest
from serd_bag.files import read_text

_COOKIE = "serd_token"
_STATIC = Path(__file__).with_name("static")
_HEADERS = {
    "Content-Security-Policy": "default-src 'none'; script-src 'self'; style-src 'self'; "
    "img-src 'self'; connect-src 'self'; base-uri 'none'; form-action 'none'; "
    "frame-ancestors 'none'",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cache-Control": "no-store",
}
_PING_PERIOD_S = 5.0
_START_LIMIT_S = 60.0
_SHUTDOWN_S = 0.5
SHORTEST_TOKEN = 16
_LOOPBACK_NAME = "localhost"
Handler = Callable[[web.Request], Awaitable[web.StreamResponse]]


@dataclass(frozen=True)
class PageAccess:
    """address: what the server binds to; token: empty for none, allowed on loopback only."""

    address: str
    token: str = ""

    def __post_init__(self) -> None:
        if not self.token and not is_loopback(self.address):
            raise TeleopError(
                f"address must be 127.0.0.1 unless a token is given, got {self.address}"
                "; others could drive the robot, so give a token file"
            )
        if self.token and len(self.token) < SHORTEST_TOKEN:
            raise TeleopError(
                f"token must have at least {SHORTEST_TOKEN} characters, got {len(self.token)}"
                "; take a longer random one"
            )

    def admits_host(self, host: str) -> bool:
        """Whether a Host header names this server."""
        return not is_loopback(self.address) or is_loopback(_name_of(host))

    def admits_token(self, token: str) -> bool:
        """Whether a token is the right one, compared in constant time."""
        # Bytes of a header that are no UTF-8 are surrogates.
        given = token.encode(errors="surrogatepass")
        return not self.token or hmac.compare_digest(self.token.encode(), given)


def admits_origin(origin: str | None, host: str) -> bool:
    """Whether a WebSocket is opened by a page of this server."""
    return origin is not None and origin == f"http://{host}"


def _name_of(host: str) -> str:
    """The name in a Host header; empty where it has none."""
    try:
        return urlsplit(f"//{host}").hostname or ""
    except ValueError:
        return ""


def is_loopback(address: str) -> bool:
    """Whether an address or name is this machine's own."""
    if address == _LOOPBACK_NAME:
        return True
    try:
        return ipaddress.ip_address(address).is_loopback
    except ValueError:
        return False


def read_token(path: str | Path) -> str:
    """The first line of a token file; empty without a path."""
    if not path:
        return ""
    lines = read_text(path).splitlines()
    if not lines or not lines[0].strip():
        raise TeleopError(f"token_file {path} must hold a token in its first line, got none")
    return lines[0].strip()


def make_app(hub: Hub, access: PageAccess) -> web.Application:
    """The application; every request passes the access rules first."""

    @web.middleware
    async def guarded(request: web.Request, handler: Handler) -> web.StreamResponse:
        if not access.admits_host(request.host):
            raise web.HTTPForbidden(text="this server is reached as 127.0.0.1 only")
        given = request.query.get("token")
        if given is not None and access.token and access.admits_token(given):
            return _with_cookie(given)
        if not access.admits_token(request.cookies.get(_COOKIE, "")):
            raise web.HTTPForbidden(text="open the address with its token: /?token=TOKEN")
        return await handler(request)

    async def connect(request: web.Request) -> web.StreamResponse:
        if not admits_origin(request.headers.get("Origin"), request.host):
            raise web.HTTPForbidden(text="only the page of this server may connect")
        return await _serve_socket(request, hub)

    app = web.Application(middlewares=[guarded])
    app.on_response_prepare.append(_harden)

    async def index(_: web.Request) -> web.StreamResponse:
        return web.FileResponse(_STATIC / "index.html")

    app.router.add_get("/socket", connect)
    app.router.add_get("/", index)
    app.router.add_static("/", _STATIC)
    return app


async def _harden(_: web.Request, response: web.StreamResponse) -> None:
    response.headers.update(_HEADERS)


def _with_cookie(token: str) -> web.Response:
    """Move the token from the address bar into a cookie that scripts cannot read."""
    response = web.Response(status=303, headers={"Location": "/"})
    response.set_cookie(_COOKIE, token, httponly=True, samesite="Strict")
    return response


async def _serve_socket(request: web.Request, hub: Hub) -> web.StreamResponse:
    socket = web.WebSocketResponse(max_msg_size=LARGEST_REQUEST_BYTES, heartbeat=_PING_PERIOD_S)
    await socket.prepare(request)
    page = hub.open()
    sender = asyncio.create_task(_send_all(socket, page))
    try:
        async for message in socket:
            if message.type == WSMsgType.TEXT:
                hub.receive(page, message.data)
            elif message.type == WSMsgType.BINARY:
                await socket.close(code=1003)
    finally:
        hub.close(page)
        sender.cancel()
        with contextlib.suppress(asyncio.CancelledError, ConnectionError):
            await sender
    return socket


async def _send_all(socket: web.WebSocketResponse, page: OpenPage) -> None:
    while not socket.closed:
        await page.changed.wait()
        for message in page.pending():
            await socket.send_str(message)


def _in_one_line(record: logging.LogRecord) -> bool:
    """Log requests that cannot be read as HTTP in one line: anybody may send them."""
    if record.exc_info and isinstance(record.exc_info[1], HttpProcessingError):
        host = str(record.args[0]) if isinstance(record.args, tuple) and record.args else "?"
        record.msg = f"refused a request from {host} that cannot be read as HTTP"
        record.args, record.exc_info = (), None
    return True


class PageServer:
    """Serves from construction until `close`; with port 0, `port` is the free port it took."""

    def __init__(self, scene: Mapping[str, Any], access: PageAccess, port: int) -> None:
        self.access, self.port = access, port
        self._hub = Hub(json.dumps(scene))
        self._loop = asyncio.new_event_loop()
        self._runner: web.AppRunner | None = None
        self._thread = threading.Thread(target=self._loop.run_forever, name="page", daemon=True)
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

    def take(self) -> list[PageRequest]:
        """Remove and return the requests of the driving page."""
        waiting = self._hub.requests
        return [waiting.get_nowait() for _ in range(waiting.qsize())]

    def show(self, state: Mapping[str, Any]) -> None:
        """Send the newest state to all pages."""
        text = json.dumps(state, allow_nan=False)
        self._loop.call_soon_threadsafe(self._hub.send_state, text)

    def show_overlay(self, overlay: Mapping[str, Any]) -> None:
        """Send the layers of the newest model to all pages, and to those opened later."""
        text = json.dumps(overlay, allow_nan=False)
        self._loop.call_soon_threadsafe(self._hub.send_overlay, text)

    def notify(self, text: str) -> None:
        """Send a notice to all pages."""
        self._loop.call_soon_threadsafe(self._hub.send_notice, text)

    def close(self) -> None:
        """End all connections and the thread; a second call does nothing."""
        if not self._thread.is_alive():
            return
        if self._runner is not None:
            self._call(self._runner.cleanup())
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join()
        self._loop.close()

    def _call(self, coroutine: Any) -> None:
        asyncio.run_coroutine_threadsafe(coroutine, self._loop).result(_START_LIMIT_S)

    async def _begin(self) -> None:
        server_logger.addFilter(_in_one_line)
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
