"""How each learner is drawn, the same in every figure: colour, marker and line."""

from dataclasses import dataclass

from report.style import BLUE, CYAN, GREEN, MUTED, PURPLE, RED, YELLOW


@dataclass(frozen=True)
class LearnerStyle:
    """Colour, marker and line style of one learner."""

    colour: str
    marker: str
    line: str


STYLES = {
    "MDCE SERD": LearnerStyle(BLUE, "o", "-"),
    "PM SERD": LearnerStyle(CYAN, "D", "-"),
    "PM SERD, regularised": LearnerStyle(BLUE, "o", "-"),
    "MDCE IRL": LearnerStyle(PURPLE, "s", "-"),
    "MDCE IRL, likelihood": LearnerStyle(PURPLE, "s", "-"),
    "MDCE IRL, entropy": LearnerStyle(YELLOW, "v", "-"),
    "REIRL": LearnerStyle(RED, "^", "--"),
}
SPARE = (LearnerStyle(GREEN, "P", "-."), LearnerStyle(MUTED, "X", ":"))


def style_of(learner: str, n_unknown: int = 0) -> LearnerStyle:
    """The learner's style, or a spare one where it has none."""
    return STYLES.get(learner, SPARE[n_unknown % len(SPARE)])
