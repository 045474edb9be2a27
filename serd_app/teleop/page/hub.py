"""The open pages: which one drives, what they request, and the messages that wait for each.

A page requests by JSON objects with a `type`; all else is answered by an error.

A hub lives on the event loop of the server. Each page gets the newest notices, state and overlay,
so a slow connection only lowers the frame rate.
"""

import asyncio
import json
import queue
import time
from collections import deque
from collections.abc import Callable
from itertools import count
from typing import Annotated, Literal

from pydantic import Field, TypeAdapter, ValidationError

from serd_app.errors import TeleopError
from serd_files.yaml_config import StrictModel

SILENCE_S = 2.0
_MOST_NOTICES = 50
_OTHER_PAGE_DRIVES = "another page is driving; close it first"


LARGEST_REQUEST_BYTES = 4096
Mode = Literal["directions", "velocity"]
Direction = Literal["north", "east", "south", "west"]
_Share = Annotated[float, Field(ge=-1.0, le=1.0)]


class Hold(StrictModel):
    """Heartbeat of a page that drives by directions; direction: the one held now, if any."""

    type: Literal["hold"]
    direction: Direction | None


class Move(StrictModel):
    """Heartbeat of a page that drives by velocities, as shares of the greatest ones."""

    type: Literal["move"]
    linear: _Share
    angular: _Share


class Joystick(StrictModel):
    """State of a gamepad, up and left positive; also a heartbeat."""

    type: Literal["joy"]
    axes: Annotated[tuple[_Share, ...], Field(max_length=16)]
    buttons: Annotated[tuple[Annotated[int, Field(ge=0, le=1)], ...], Field(max_length=32)]


class Override(StrictModel):
    """The key that overrides the guard is held; repeated while it is."""

    type: Literal["override"]


class Away(StrictModel):
    """The page is no longer in front, or has gone."""

    type: Literal["away"]


class Episode(StrictModel):
    """Start, save or discard an episode."""

    type: Literal["episode"]
    do: Literal["start", "save", "discard"]


class EmergencyStop(StrictModel):
    """Engage the emergency stop, or release it."""

    type: Literal["e_stop"]
    engaged: bool


class SetMode(StrictModel):
    """Drive by directions or by velocities."""

    type: Literal["mode"]
    mode: Mode


PageRequest = Hold | Move | Joystick | Override | Away | Episode | EmergencyStop | SetMode
_REQUEST: TypeAdapter[PageRequest] = TypeAdapter(
    Annotated[PageRequest, Field(discriminator="type")]
)


def parse_request(text: str) -> PageRequest:
    """The request in a message of a page; TeleopError for anything else."""
    try:
        return _REQUEST.validate_json(text, strict=True)
    except ValidationError as error:
        first = error.errors(include_url=False, include_context=False)[0]
        place = ".".join(str(part) for part in first["loc"]) or "message"
        raise TeleopError(
            f"{place} of a page's request: {first['msg']}; load the page again"
        ) from None


class OpenPage:
    """The messages that wait to be sent to one page: few, also if it never reads."""

    def __init__(self, number: int, greeting: list[str]) -> None:
        self.number = number
        self.changed = asyncio.Event()
        self._greeting = greeting
        self._notices: deque[str] = deque(maxlen=_MOST_NOTICES)
        self._newest = {"overlay": "", "state": ""}
        self.changed.set()

    def add_notice(self, text: str) -> None:
        """Add a notice; the oldest of too many is left out."""
        self._notices.append(_message("notice", text=text))
        self.changed.set()

    def replace(self, kind: Literal["overlay", "state"], message: str) -> None:
        """Replace the overlay or the state that waits."""
        self._newest[kind] = message
        self.changed.set()

    def pending(self) -> list[str]:
        """Remove and return all messages, the state last."""
        newest = [message for message in self._newest.values() if message]
        messages = [*self._greeting, *self._notices, *newest]
        self._greeting, self._newest = [], dict.fromkeys(self._newest, "")
        self._notices.clear()
        self.changed.clear()
        return messages


class Hub:
    """Which page drives: one at a time, until it is away, closed or silent.

    requests: those of the driving page, in order, for the node that drives the robot.
    """

    def __init__(self, scene: str, clock: Callable[[], float] = time.monotonic) -> None:
        self.requests: queue.SimpleQueue[PageRequest] = queue.SimpleQueue()
        self.driving: int | None = None
        self._scene, self._clock = scene, clock
        self._overlay: str | None = None
        self._holder: int | None = None
        self._heard_s = 0.0
        self._pages: dict[int, OpenPage] = {}
        self._numbers = count(1)

    def open(self) -> OpenPage:
        """Register a new page."""
        number = next(self._numbers)
        overlays = [] if self._overlay is None else [self._overlay]
        page = OpenPage(number, [_message("hello", page=number), self._scene, *overlays])
        self._pages[number] = page
        return page

    def close(self, page: OpenPage) -> None:
        """Remove a page; if it was driving, no page drives."""
        self._pages.pop(page.number, None)
        self._release(page)
        self._update_driver()

    def receive(self, page: OpenPage, text: str) -> None:
        """Handle a message: the emergency stop of any page, all else of the driving page only."""
        try:
            request = parse_request(text)
        except TeleopError as error:
            page.add_notice(str(error))
            return
        if isinstance(request, EmergencyStop) and request.engaged:
            self.requests.put(request)
        elif isinstance(request, Away):
            self._release(page)
        elif self._holding() in (None, page.number):
            self._holder, self._heard_s = page.number, self._clock()
            self.requests.put(request)
        elif request.type in ("episode", "e_stop", "mode"):
            page.add_notice(_OTHER_PAGE_DRIVES)
        self._update_driver()

    def send_state(self, state: str) -> None:
        """Send the newest state to all pages."""
        self._update_driver()
        for page in self._pages.values():
            page.replace("state", state)

    def send_overlay(self, overlay: str) -> None:
        """Send the layers of the newest model to all pages, and to those opened later."""
        self._overlay = overlay
        for page in self._pages.values():
            page.replace("overlay", overlay)

    def send_notice(self, text: str) -> None:
        """Send a notice to all pages."""
        for page in self._pages.values():
            page.add_notice(text)

    def _holding(self) -> int | None:
        """Number of the page that may drive now, None where all may."""
        if self._holder is not None and self._clock() - self._heard_s > SILENCE_S:
            self._holder = None
        return self._holder

    def _release(self, page: OpenPage) -> None:
        if self._holder == page.number:
            self._holder = None

    def _update_driver(self) -> None:
        """Set `driving`, and request Away once when no page drives any more."""
        holder = self._holding()
        if self.driving is not None and holder is None:
            self.requests.put(Away(type="away"))
        self.driving = holder


def _message(kind: str, **values: object) -> str:
    return json.dumps({"type": kind, **values})
