"""The one base error of the package."""


class SerdError(ValueError):
    """An input breaks a rule; the sentence names the argument, the rule, the value and the fix."""

    def __str__(self) -> str:
        """The message as one line, whatever line ends the value received contains."""
        return " ".join(super().__str__().splitlines())
