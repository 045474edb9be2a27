"""What is sound of a bag, for a replay that plays it and then says what was damaged."""

from collections.abc import Iterable, Iterator

from bags.errors import BagError
from bags.topic import RawMessage


class UntilDamage(Iterator[RawMessage]):
    """Ends where the reader complains; `damage` is its sentence then, empty before.

    An error out of the middle of a replay would take the messages read just before with it.
    """

    def __init__(self, messages: Iterable[RawMessage]) -> None:
        self._messages = iter(messages)
        self.damage = ""

    def __next__(self) -> RawMessage:
        """The next message."""
        try:
            return next(self._messages)
        except BagError as error:
            self.damage = str(error)
            raise StopIteration from None
