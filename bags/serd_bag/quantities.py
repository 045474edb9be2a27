"""Numbers with their nouns and units, for sentences."""


def seconds_in_words(seconds: float) -> str:
    """A duration to the second, in minutes where that reads better."""
    if round(seconds) < 120:
        return f"{seconds:.0f} s" if seconds >= 10 else f"{seconds:.1f} s"
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes} min {rest:02d} s" if rest else f"{minutes} min"


def counted(number: int, noun: str) -> str:
    """`3 episodes`, `1 episode`."""
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"
