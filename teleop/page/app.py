"""The page's HTTP side: static files and one WebSocket, behind the rules of `access`."""

import asyncio
import contextlib
from collections.abc import Awaitable, Callable
from importlib.resources import files

from aiohttp import WSMsgType, web

from teleop.page.access import PageAccess, admits_origin
from teleop.page.hub import Hub, OpenPage
from teleop.page.wishes import LARGEST_WISH_BYTES

_COOKIE = "serd_token"
_TYPES = {
    ".html": "text/html",
    ".css": "text/css",
    ".js": "text/javascript",
    ".svg": "image/svg+xml",
}
_HEADERS = {
    "Content-Security-Policy": "default-src 'none'; script-src 'self'; style-src 'self'; "
    "img-src 'self'; connect-src 'self'; base-uri 'none'; form-action 'none'; "
    "frame-ancestors 'none'",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cache-Control": "no-store",
}
_PING_PERIOD_S = 5.0
Handler = Callable[[web.Request], Awaitable[web.StreamResponse]]


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

    async def talk(request: web.Request) -> web.StreamResponse:
        if not admits_origin(request.headers.get("Origin"), request.host):
            raise web.HTTPForbidden(text="only the page of this server may connect")
        return await _talk(request, hub)

    app = web.Application(middlewares=[guarded])
    app.on_response_prepare.append(_harden)
    app.router.add_get("/socket", talk)
    for name, content in _static_files().items():
        app.router.add_get("/" if name == "index.html" else f"/{name}", _sender(name, content))
    return app


def _static_files() -> dict[str, bytes]:
    folder = files("teleop.page") / "static"
    return {each.name: each.read_bytes() for each in folder.iterdir() if each.is_file()}


def _sender(name: str, content: bytes) -> Handler:
    kind = _TYPES["." + name.rsplit(".", 1)[-1]]

    async def send(_: web.Request) -> web.StreamResponse:
        charset = None if kind.startswith("image/") else "utf-8"
        return web.Response(body=content, content_type=kind, charset=charset)

    return send


async def _harden(_: web.Request, response: web.StreamResponse) -> None:
    response.headers.update(_HEADERS)


def _with_cookie(token: str) -> web.Response:
    """Keep the token out of the address bar, and away from scripts and other sites."""
    response = web.Response(status=303, headers={"Location": "/"})
    response.set_cookie(_COOKIE, token, httponly=True, samesite="Strict")
    return response


async def _talk(request: web.Request, hub: Hub) -> web.StreamResponse:
    socket = web.WebSocketResponse(max_msg_size=LARGEST_WISH_BYTES, heartbeat=_PING_PERIOD_S)
    await socket.prepare(request)
    page = hub.open()
    sender = asyncio.create_task(_send_all(socket, page))
    try:
        async for message in socket:
            if message.type == WSMsgType.TEXT:
                hub.hear(page, message.data)
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
