"""A bag of your own: python own_bag.py BAG, from the recording to what it says about the robot.

Without a scenario the cells are fitted to where the robot was. Each drive has the goal where it
ended, or all have the goal that is clustered from their ends. Writes decisions.csv, model.yaml and
the page report/report.html, as `serd demos` and `serd learn` do.
"""

import sys
from pathlib import Path

from serd_app.journeys.demonstrate import PlaceChoice, demonstrate
from serd_app.journeys.learn import learn_from_table
from serd_app.learning.settings import LearningSettings
from serd_files.errors import USER_ERRORS


def main(bag: Path) -> None:
    """Make the table of decisions, learn from it and print what was learned."""
    made = demonstrate([bag], Path("decisions.csv"), PlaceChoice(cell_size_m=1.0))
    for recorded in made.found:
        print(recorded.bag.name, recorded.decisions)
    table, output = Path("decisions.csv"), Path("model.yaml")
    learned = learn_from_table(table, output, LearningSettings(), report=Path("report"))
    print(learned.outcome.fit.summary(learned.certainty.errors))
    print("page:", learned.page)


if __name__ == "__main__":
    try:
        main(Path(sys.argv[1]))
    except USER_ERRORS as error:  # one sentence: what is wrong, and what to do
        sys.exit(f"own_bag: {error}")
