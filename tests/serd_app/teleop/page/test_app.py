"""The page's server over HTTP and WebSocket: token, origin, host, bad messages, one driver."""

import asyncio
import json
import socket

import pytest
from aiohttp import WSServerHandshakeError
from aiohttp.test_utils import TestClient, TestServer

from serd_app.errors import TeleopError
from serd_app.teleop.page.access import PageAccess
from serd_app.teleop.page.hub import Hub
from serd_app.teleop.page.requests import Away, Hold
from serd_app.teleop.page.server import PageServer, make_app

TOKEN = "a-long-random-token"
LOCAL = PageAccess("127.0.0.1")
GUARDED = PageAccess("0.0.0.0", TOKEN)
NORTH = {"type": "hold", "direction": "north"}


def with_client(access, use):
    """Run `use(client, hub)` against a server of its own."""

    async def run():
        hub = Hub(json.dumps({"type": "scene"}))
        async with TestClient(TestServer(make_app(hub, access))) as client:
            await use(client, hub)

    asyncio.run(run())


async def connect(client, **headers):
    origin = f"http://{client.host}:{client.port}"
    return await client.ws_connect("/socket", headers={"Origin": origin, **headers})


async def next_of(page, kind):
    while True:
        message = await page.receive_json()
        if message["type"] == kind:
            return message


def requests_of(hub):
    return [hub.requests.get_nowait() for _ in range(hub.requests.qsize())]


async def until(condition):
    while not condition():
        await asyncio.sleep(0.01)


def test_the_page_and_its_files_come_with_headers_that_keep_others_out():
    async def use(client, _):
        for path, kind in (("/", "text/html"), ("/main.js", "text/javascript")):
            answer = await client.get(path)
            assert answer.status == 200
            assert answer.content_type == kind
            assert "default-src 'none'" in answer.headers["Content-Security-Policy"]
            assert "http://" not in (await answer.text()).replace("http://www.w3.org", "")
        assert (await client.get("/../hub.py")).status == 404

    with_client(LOCAL, use)


def test_a_foreign_host_name_is_refused_on_loopback():
    async def use(client, _):
        answer = await client.get("/", headers={"Host": "robot.example"})
        assert answer.status == 403

    with_client(LOCAL, use)


@pytest.mark.parametrize(
    "headers", [{"Origin": "http://evil.example"}, {"Origin": "null"}, {"Origin": ""}, {}]
)
def test_a_foreign_origin_cannot_connect(headers):
    async def use(client, _):
        with pytest.raises(WSServerHandshakeError) as refused:
            await client.ws_connect("/socket", headers=headers)
        assert refused.value.status == 403

    with_client(LOCAL, use)


def test_with_a_token_everything_is_closed_until_it_is_given_and_it_leaves_the_address_bar():
    async def use(client, _):
        for path in ("/", "/main.js", "/?token=wrong-wrong-wrong", "/socket"):
            assert (await client.get(path)).status == 403
        answer = await client.get(f"/?token={TOKEN}", allow_redirects=False)
        assert (answer.status, answer.headers["Location"]) == (303, "/")
        cookie = answer.cookies["serd_token"]
        assert cookie["httponly"]
        assert cookie["samesite"] == "Strict"
        headers = {"Cookie": f"serd_token={TOKEN}"}
        assert (await client.get("/", headers=headers)).status == 200
        page = await connect(client, **headers)
        assert (await next_of(page, "hello"))["page"] == 1

    with_client(GUARDED, use)


def test_a_bad_message_is_answered_by_a_sentence_and_the_connection_lives():
    async def use(client, hub):
        page = await connect(client)
        await page.send_str("{not json")
        assert "load the page again" in (await next_of(page, "notice"))["text"]
        await page.send_json(NORTH)
        await until(lambda: hub.requests.qsize())
        assert requests_of(hub) == [Hold(type="hold", direction="north")]

    with_client(LOCAL, use)


def test_a_message_that_is_too_large_ends_the_connection():
    async def use(client, hub):
        page = await connect(client)
        await next_of(page, "scene")
        await page.send_str(" " * 10_000)
        assert (await page.receive()).data == 1009  # message too big
        assert requests_of(hub) == []

    with_client(LOCAL, use)


def test_a_driver_whose_connection_ends_is_away_and_another_takes_over():
    async def use(client, hub):
        first, second = await connect(client), await connect(client)
        await first.send_json(NORTH)
        await until(lambda: hub.driving == 1)
        await first.close()
        await until(lambda: hub.driving is None)
        assert requests_of(hub)[-1] == Away(type="away")
        await second.send_json(NORTH)
        await until(lambda: hub.driving == 2)

    with_client(LOCAL, use)


def test_a_port_in_use_is_named_with_the_fix():
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        with pytest.raises(TeleopError, match=rf"port {port} of 127\.0\.0\.1 is in use; choose"):
            PageServer({}, LOCAL, port)


def test_the_server_takes_a_free_port_and_ends_with_its_connections():
    server = PageServer({"type": "scene"}, LOCAL, 0)
    assert server.url == f"http://127.0.0.1:{server.port}/"
    server.show({"type": "state"})
    server.notify("hello")
    assert server.take() == []
    assert server.driving_page == 0
    server.close()
    server.close()
    with socket.socket() as again:
        assert again.connect_ex(("127.0.0.1", server.port)) != 0


@pytest.mark.parametrize("lines", ["Bad Header: x", "Content-Length: -1", "Transfer-Encoding: no"])
def test_a_request_that_cannot_be_read_is_refused_and_logged_in_one_line(lines, caplog):
    server = PageServer({"type": "scene"}, LOCAL, 0)
    try:
        with socket.create_connection(("127.0.0.1", server.port)) as client:
            client.sendall(f"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\n{lines}\r\n\r\n".encode())
            answer = client.makefile("rb").read()
    finally:
        server.close()
    assert answer.startswith((b"HTTP/1.0 400", b"HTTP/1.1 400"))
    assert caplog.messages == ["refused a request from 127.0.0.1 that cannot be read as HTTP"]
    assert "Traceback" not in caplog.text
