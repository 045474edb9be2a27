"""How a person drives by hand, and the direction that is held."""

from typing import Literal

from serd_core.grid.grid import Action

Mode = Literal["directions", "velocity"]


class DirectionChoice:
    """The direction that a person holds, else wait.

    After `clear`, a key counts when it is pressed anew. One that is held from the start on counts.
    """

    def __init__(self) -> None:
        self._held: Action | None = None
        self._counts = True

    @property
    def action(self) -> Action:
        """What the person wants now."""
        return Action.WAIT if self._held is None or not self._counts else self._held

    def hold(self, action: Action | None) -> None:
        """Set the direction that is held now, None for none; repeated calls change nothing."""
        self._held, self._counts = action, self._counts or action is None

    def clear(self) -> None:
        """Reset to wait; a key that is held now counts after it has been released."""
        self._held, self._counts = None, False
