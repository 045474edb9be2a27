"""Who may open the page, and what it may request."""

import pytest

from serd_app.errors import TeleopError
from serd_app.teleop.page.access import PageAccess, admits_origin, read_token
from serd_app.teleop.page.requests import Hold, Joystick, parse_request

TOKEN = "a-long-random-token"


def test_any_address_but_loopback_needs_a_token():
    with pytest.raises(TeleopError, match=r"unless a token is given, got 0\.0\.0\.0"):
        PageAccess("0.0.0.0")
    assert PageAccess("0.0.0.0", TOKEN).admits_token(TOKEN)
    for address in ("127.0.0.1", "::1", "localhost"):
        assert PageAccess(address).admits_token("")


def test_a_short_token_is_refused():
    with pytest.raises(TeleopError, match="at least 16 characters, got 3"):
        PageAccess("127.0.0.1", "abc")


@pytest.mark.parametrize("token", ["", "a-long-random-toke", TOKEN + "x", "ü" * 20, "\udcff"])
def test_a_wrong_token_is_not_admitted(token):
    assert not PageAccess("0.0.0.0", TOKEN).admits_token(token)


def test_on_loopback_the_host_must_be_a_name_of_loopback():
    access = PageAccess("127.0.0.1")
    assert all(access.admits_host(host) for host in ("127.0.0.1:8765", "localhost", "[::1]:80"))
    assert not any(access.admits_host(host) for host in ("robot.example:8765", "", "10.0.0.1"))
    assert not any(access.admits_host(host) for host in ("[::1", "]", "127.0.0.1\u2100"))


def test_only_the_servers_own_origin_may_connect():
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


def test_requests_are_read():
    assert parse_request('{"type": "hold", "direction": "north"}') == Hold(
        type="hold", direction="north"
    )
    joy = parse_request('{"type": "joy", "axes": [0.5, -1], "buttons": [0, 1]}')
    assert joy == Joystick(type="joy", axes=(0.5, -1.0), buttons=(0, 1))


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
