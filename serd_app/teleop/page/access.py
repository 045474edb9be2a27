"""Access to the page: from this machine on loopback, elsewhere with a token.

Pages of other sites must not drive: the WebSocket requires the origin of this server, and on
loopback the Host header must be a loopback name (DNS rebinding).
"""

import hmac
import ipaddress
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import urlsplit

from serd_app.errors import TeleopError
from serd_bag.files import read_text

SHORTEST_TOKEN = 16
_LOOPBACK_NAME = "localhost"


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
