"""How a person drives by hand, and the direction that counts in the next decision period."""

from typing import Literal

from serd_core.grid.grid import Action

Mode = Literal["directions", "velocity"]


class DirectionChoice:
    """The direction chosen for the next decision period, else wait.

    A held key counts as long as it is held; one that is released before the period begins counts
    for one period. Held keys count once none has been held since the start, or since `clear`.
    """

    def __init__(self) -> None:
        self._pressed = Action.WAIT
        self._held: Action | None = None
        self._was_released = False

    @property
    def upcoming(self) -> Action:
        """The action if the period began now."""
        return self._held if self._held is not None else self._pressed

    def hold(self, action: Action | None) -> None:
        """Set the direction that is held now, None for none; repeated calls change nothing."""
        if action is None:
            self._was_released = True
        if not self._was_released:
            return
        if action is not None and action != self._held:
            self._pressed = action
        self._held = action

    def clear(self) -> None:
        """Reset to wait; a key that is held now counts after it has been released."""
        self._pressed, self._held, self._was_released = Action.WAIT, None, False

    def decide(self) -> Action:
        """The action of the period that begins now."""
        action, self._pressed = self.upcoming, Action.WAIT
        return action
