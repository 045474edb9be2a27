"""The base error of the package."""

from serd_core.errors import SerdError


class AppError(SerdError):
    """The request is not possible; the message names the fix."""


class TeleopError(SerdError):
    """Driving by hand is impossible as requested; the message names the fix."""


class ReportError(SerdError):
    """An input of the report breaks a rule; the message names it and the fix."""


class MappingError(AppError):
    """A bag that another mapping may read; sentence: what is wrong, without the remedy."""

    def __init__(self, sentence: str, remedy: str) -> None:
        super().__init__(f"{sentence}; {remedy}")
        self.sentence = sentence
