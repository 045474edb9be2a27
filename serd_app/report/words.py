"""Names and shares as people read them, without Matplotlib."""


def in_words(name: str) -> str:
    """A code name for people: `with_flow` becomes `with flow`."""
    return name.replace("_", " ")


def percent(share: float) -> str:
    """A share of one as a percentage without needless digits."""
    value = 100 * share
    return f"{value:.0f} %" if abs(value - round(value)) < 0.05 else f"{value:.1f} %"
