"""One colour, marker and line for each method, assumption and expert, in all figures."""

from dataclasses import dataclass

from report import style


@dataclass(frozen=True)
class Look:
    """How a curve is drawn; never told apart by colour alone."""

    colour: str
    marker: str
    line: str = "-"


METHOD_LOOKS = {
    "MDCE SERD": Look(style.BLUE, "o"),
    "SERD, free belief": Look(style.CYAN, "D"),
    "MDCE IRL, likelihood": Look(style.PURPLE, "s", "--"),
    "MDCE IRL, entropy": Look(style.RED, "^", "--"),
    "REIRL": Look(style.GREEN, "v", "-."),
    "cloning": Look(style.YELLOW, "X", ":"),
}
ASSUMPTION_LOOKS = {
    "fixed (IRL)": Look(style.PURPLE, "s", "--"),
    "tied": Look(style.BLUE, "o"),
    "coupled": Look(style.GREEN, "P"),
    "free": Look(style.CYAN, "D"),
    "told the truth (IRL)": Look(style.MUTED, "*", ":"),
}
EXPERT_TITLES = {
    "knows": "knows the crowd",
    "ignores_crowd": "ignores the crowd",
    "fears_crowd": "fears the crowd",
}
