"""From the bytes a terminal sends to names of keys: one character, or up, down, left, right, ..."""

_NAMED = {"\r": "enter", "\n": "enter", " ": "space", "\t": "tab", "\x7f": "backspace"}
_ARROWS = {"A": "up", "B": "down", "C": "right", "D": "left"}
_ESCAPE = "\x1b"


class KeyNames:
    """Keeps the beginning of an escape sequence until its rest has come."""

    def __init__(self) -> None:
        self._rest = ""

    def feed(self, data: bytes) -> list[str]:
        """Keys that are complete now; call it with b"" when nothing came, to let Escape through."""
        text, self._rest = self._rest + data.decode("utf-8", errors="ignore"), ""
        keys: list[str] = []
        while text:
            key, text = _next(text)
            if key is None and data:
                self._rest = text
                break
            if key is None:
                key, text = "escape", ""
            if key:
                keys.append(key)
        return keys


def _next(text: str) -> tuple[str | None, str]:
    """First key and what follows it; None where an escape sequence is not complete yet.

    The key is empty for a sequence that is none of ours.
    """
    if text[0] != _ESCAPE:
        return _NAMED.get(text[0], text[0]), text[1:]
    if len(text) == 1 or (text[1] in "[O" and len(text) == 2):
        return None, text
    if text[1] not in "[O":
        return "escape", text[1:]
    end = 2
    while end < len(text) and not "@" <= text[end] <= "~":
        end += 1
    if end == len(text):
        return None, text
    known = _ARROWS.get(text[end], "") if end == 2 else ""
    return known, text[end + 1 :]
