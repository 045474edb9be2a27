"""What a person has chosen for the decision period that begins next: a direction, else wait.

A tap counts for one period. A held key counts as long as it is held; a key that is let go before
the period begins still counts as a tap.
"""

from serd_core.grid.grid import Action


class DirectionChoice:
    """Collects presses between two decisions."""

    def __init__(self) -> None:
        self._tapped = Action.WAIT
        self._held: Action | None = None

    @property
    def coming(self) -> Action:
        """What would be decided now."""
        return self._held if self._held is not None else self._tapped

    def tap(self, action: Action) -> None:
        """Choose for the next period; WAIT takes an earlier choice back."""
        self._tapped = action

    def hold(self, action: Action | None) -> None:
        """Say which direction is held now, None for none; said again, it changes nothing."""
        if action is not None and action != self._held:
            self._tapped = action
        self._held = action

    def clear(self) -> None:
        """Forget everything: nobody drives."""
        self._tapped, self._held = Action.WAIT, None

    def decide(self) -> Action:
        """The action of the period that begins now."""
        action, self._tapped = self.coming, Action.WAIT
        return action
