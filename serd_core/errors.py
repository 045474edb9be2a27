"""The one base error of the package."""


class SerdError(ValueError):
    """An input breaks a rule; the sentence names the argument, the rule, the value and the fix."""
