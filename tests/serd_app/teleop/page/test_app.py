"""The page's server over HTTP and WebSocket: who is admitted, bad messages, one driver, layers."""

import asyncio
import json
import socket

import pytest
from aiohttp import WSServerHandshakeError
from aiohttp.test_utils import TestClient, TestServer

from serd_app.errors import TeleopError
from serd_app.teleop.page.hub import LARGEST_REQUEST_BYTES, Hold, Hub, parse_request
from serd_app.teleop.page.server import PageAccess, PageServer, admits_origin, make_app, read_token
from support.waiting import PATIENCE_S

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

    asyncio.run(asyncio.wait_for(run(), PATIENCE_S))


async def connect(client, **headers):
    origin = f"http://{client.host}:{client.port}"
    return await client.ws_connect("/socket", headers={"Origin": origin, **headers})


async def next_of(page, kind):
    message = await page.receive_json()
    return message if message["type"] == kind else await next_of(page, kind)


def requests_of(hub):
    return [hub.requests.get_nowait() for _ in range(hub.requests.qsize())]


async def until(condition):
    while not condition():
        await asyncio.sleep(0.01)


def test_the_page_and_its_files_come_with_headers_that_keep_others_out():
    async def use(client, _):
        for path, kind in (("/", "text/html"), ("/main.js", "javascript")):
            answer = await client.get(path)
            assert answer.status == 200
            assert kind in answer.content_type
            assert "default-src 'none'" in answer.headers["Content-Security-Policy"]
            assert "http://" not in (await answer.text()).replace("http://www.w3.org", "")
        assert (await client.get("/../hub.py")).status == 404

    with_client(LOCAL, use)


@pytest.mark.parametrize(
    "headers", [{"Origin": "http://evil.example"}, {"Origin": "null"}, {"Origin": ""}, {}]
)
def test_a_foreign_host_or_origin_cannot_connect_on_loopback(headers):
    async def use(client, _):
        assert (await client.get("/", headers={"Host": "robot.example"})).status == 403
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


def test_a_bad_message_is_answered_by_a_sentence_and_a_large_or_binary_one_ends_the_connection():
    async def use(client, hub):
        page = await connect(client)
        await page.send_str("{not json")
        assert "load the page again" in (await next_of(page, "notice"))["text"]
        await page.send_json(NORTH)
        await until(lambda: hub.requests.qsize())
        assert requests_of(hub) == [Hold(type="hold", direction="north")]
        await page.send_bytes(b"{}")
        assert (await page.receive()).data == 1003  # unsupported data
        other = await connect(client)
        await next_of(other, "scene")
        await other.send_str(" " * (LARGEST_REQUEST_BYTES + 1))
        assert (await other.receive()).data == 1009  # message too big

    with_client(LOCAL, use)


def test_the_server_takes_a_free_port_refuses_a_used_one_and_ends_with_its_connections():
    server = PageServer({"type": "scene"}, LOCAL, 0)
    assert server.url == f"http://127.0.0.1:{server.port}/"
    with pytest.raises(TeleopError, match=rf"port {server.port} of 127\.0\.0\.1 is in use; choose"):
        PageServer({}, LOCAL, server.port)
    server.show({"type": "state"})
    server.notify("hello")
    assert (server.take(), server.driving_page) == ([], 0)
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


def test_any_address_but_loopback_needs_a_token_of_16_characters():
    with pytest.raises(TeleopError, match=r"unless a token is given, got 0\.0\.0\.0"):
        PageAccess("0.0.0.0")
    with pytest.raises(TeleopError, match="at least 16 characters, got 15"):
        PageAccess("127.0.0.1", 15 * "a")
    assert GUARDED.admits_token(TOKEN)
    assert PageAccess("0.0.0.0", 16 * "a").admits_host("robot.example")
    for address in ("127.0.0.1", "::1", "localhost"):
        assert PageAccess(address).admits_token("")
    for token in ("", "a-long-random-toke", TOKEN + "x", "ü" * 20, "\udcff"):
        assert not GUARDED.admits_token(token)


def test_hosts_of_loopback_and_the_origin_of_the_server_are_admitted_and_no_others():
    for host in ("127.0.0.1:8765", "localhost", "[::1]:80"):
        assert LOCAL.admits_host(host)
    for host in ("robot.example:8765", "", "10.0.0.1", "[::1", "]", "127.0.0.1\u2100"):
        assert not LOCAL.admits_host(host)
    assert admits_origin("http://127.0.0.1:8765", "127.0.0.1:8765")
    for origin in (None, "null", "http://127.0.0.1:9999", "https://127.0.0.1:8765", "http://evil"):
        assert not admits_origin(origin, "127.0.0.1:8765")


def test_a_token_file_gives_its_first_line(tmp_path):
    file = tmp_path / "token"
    file.write_text(f" {TOKEN}\nanything else\n")
    assert read_token(file) == TOKEN
    assert read_token("") == ""
    file.write_text("\n")
    with pytest.raises(TeleopError, match="must hold a token in its first line, got none"):
        read_token(file)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "{",
        "[]",
        "null",
        '{"type": "fly"}',
        '{"type": "hold"}',
        '{"type": "hold", "direction": "up"}',
        '{"type": "hold", "direction": null, "extra": 1}',
        '{"type": "move", "linear": 1.5, "angular": 0}',
        '{"type": "move", "linear": NaN, "angular": 0}',
        '{"type": "move", "linear": "1", "angular": 0}',
        '{"type": "joy", "axes": [0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0], "buttons": []}',
        '{"type": "joy", "axes": [], "buttons": [2]}',
        '{"type": "e_stop", "engaged": 1}',
    ],
)
def test_anything_else_is_one_sentence(text):
    with pytest.raises(TeleopError, match=r"of a page's request: .*; load the page again"):
        parse_request(text)
