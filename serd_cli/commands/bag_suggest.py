"""`serd bag suggest`: a mapping file for a bag of another robot."""

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from serd_app.demonstrations.suggestion.suggest import Suggestion, suggest_mapping
from serd_cli.options import AsJson
from serd_cli.output.paths import require_suffix
from serd_cli.output.terminal import console, print_json
from storage.files import atomic_write_text
from storage.quantities import counted


def suggest(
    bag: Annotated[Path, typer.Argument(metavar="BAG", help="bag folder, or file of one")],
    output: Annotated[Path, typer.Option(help="mapping file to write, ending in .yaml")] = Path(
        "mapping.yaml"
    ),
    as_json: AsJson = False,
) -> None:
    """Write a mapping file for 'serd demos' from the topics of a bag of another robot.

    serd bag suggest BAG --output mapping.yaml

    Poses and velocity commands are found by type and name, and tested against each other: how long
    does the robot follow a command, after what delay, and how often do command and motion disagree?
    Where commands do not explain the motion, the motion is the action. The file states as comments
    what was found and assumed.
    """
    require_suffix(output, ".yaml")
    found = suggest_mapping(bag)
    text = found.yaml(output)
    atomic_write_text(output, text)
    if as_json:
        reports = {str(period_s): asdict(each) for period_s, each in found.reports.items()}
        values = {"bag": bag, "mapping": found.mapping.model_dump(mode="json")}
        print_json({**values, "comments": found.comments, "reports": reports, "file": output})
        return
    console.print(text, markup=False, soft_wrap=True)
    for line in _given(found):
        console.print(line, markup=False, soft_wrap=True)
    console.print(f"mapping: {output.resolve()}", markup=False, soft_wrap=True)
    console.print(f"next: {found.command(output)}", markup=False, soft_wrap=True)


def _given(found: Suggestion) -> list[str]:
    """What the mapping gives with each decision period."""
    return [
        f"with a period of {period_s:g} s: {counted(each.n_decisions, 'decision')},"
        f" {each.n_moving_waits} of them waits while the robot moves"
        for period_s, each in found.reports.items()
    ]
