"""The pages that are open: who drives, what they ask for, what they are shown.

Lives on the server's event loop. Each page is sent every sentence but only the newest state, so a
slow one falls behind in nothing but smoothness.
"""

import asyncio
import json
import queue
import time
from collections.abc import Callable
from itertools import count

from teleop.errors import TeleopError
from teleop.page.lease import Lease
from teleop.page.wishes import Away, EmergencyStop, Wish, parse_wish

_ELSE_DRIVES = "another page is driving; close it first"


class OpenPage:
    """What waits to be sent to one page."""

    def __init__(self, number: int, greeting: list[str]) -> None:
        self.number = number
        self.changed = asyncio.Event()
        self._sentences = greeting
        self._state: str | None = None
        self.changed.set()

    def say(self, message: str) -> None:
        """Queue a message that must arrive."""
        self._sentences.append(message)
        self.changed.set()

    def show(self, state: str) -> None:
        """Put the newest state in the place of an older one."""
        self._state = state
        self.changed.set()

    def pending(self) -> list[str]:
        """Everything to send now."""
        state = [] if self._state is None else [self._state]
        messages, self._sentences, self._state = [*self._sentences, *state], [], None
        self.changed.clear()
        return messages


class Hub:
    """wishes: of the driving page, for whoever drives the robot to take."""

    def __init__(self, scene: str, clock: Callable[[], float] = time.monotonic) -> None:
        self.wishes: queue.SimpleQueue[Wish] = queue.SimpleQueue()
        self.driving: int | None = None
        self._scene, self._clock = scene, clock
        self._lease = Lease()
        self._pages: dict[int, OpenPage] = {}
        self._numbers = count(1)

    def open(self) -> OpenPage:
        """A page has come."""
        number = next(self._numbers)
        page = OpenPage(number, [_message("hello", page=number), self._scene])
        self._pages[number] = page
        return page

    def close(self, page: OpenPage) -> None:
        """A page has gone; if it was driving, nobody is."""
        self._pages.pop(page.number, None)
        if self._lease.release(page.number):
            self.wishes.put(Away(type="away"))
        self._look_who_drives()

    def hear(self, page: OpenPage, text: str) -> None:
        """Take what a page sent: the emergency stop of any, everything else of the driver's."""
        try:
            wish = parse_wish(text)
        except TeleopError as error:
            page.say(_message("said", text=str(error)))
            return
        if isinstance(wish, EmergencyStop) and wish.engaged:
            self.wishes.put(wish)
        elif isinstance(wish, Away):
            if self._lease.release(page.number):
                self.wishes.put(wish)
        elif self._lease.claim(page.number, self._clock()):
            self.wishes.put(wish)
        elif wish.type in ("episode", "e_stop", "mode"):
            page.say(_message("said", text=_ELSE_DRIVES))
        self._look_who_drives()

    def show(self, state: str) -> None:
        """Send the newest state to all pages."""
        self._look_who_drives()
        for page in self._pages.values():
            page.show(state)

    def say(self, sentence: str) -> None:
        """Send a sentence to all pages."""
        for page in self._pages.values():
            page.say(_message("said", text=sentence))

    def _look_who_drives(self) -> None:
        holder = self._lease.holder(self._clock())
        if self.driving is not None and holder is None:
            self.wishes.put(Away(type="away"))
        self.driving = holder


def _message(kind: str, **values: object) -> str:
    return json.dumps({"type": kind, **values})
