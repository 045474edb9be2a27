"""The one base error of the package."""

import re

#: Control characters, which a terminal obeys, and those that turn the direction of writing.
_OBEYED = re.compile("[\x00-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069]")


class SerdError(ValueError):
    """The error of wrong input: a sentence with the argument, the rule, the value and the fix."""

    def __str__(self) -> str:
        """The message as one line, whatever line ends the value received contains."""
        return printable(" ".join(super().__str__().splitlines()))


def printable(text: str) -> str:
    """The text with the escapes of characters that a terminal or a YAML comment would not show."""
    return _OBEYED.sub(lambda found: repr(found[0])[1:-1], text)
