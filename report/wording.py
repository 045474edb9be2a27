"""How names and numbers are written in figures, tables and sentences."""


def in_words(name: str) -> str:
    """A code name for people: `with_flow` becomes `with flow`."""
    return name.replace("_", " ")


def seconds_in_words(seconds: float) -> str:
    """A duration to the second, in minutes where that reads better."""
    if round(seconds) < 120:
        return f"{seconds:.0f} s" if seconds >= 10 else f"{seconds:.1f} s"
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes} min {rest:02d} s" if rest else f"{minutes} min"


def percent(share: float) -> str:
    """A share of one as a percentage without needless digits."""
    value = 100 * share
    return f"{value:.0f} %" if abs(value - round(value)) < 0.05 else f"{value:.1f} %"


def counted(number: int, noun: str) -> str:
    """`3 episodes`, `1 episode`."""
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"
