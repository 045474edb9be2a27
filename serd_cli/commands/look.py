"""serd look BAG
serd look TABLE --output page

The page needs no model: a map from the recording's own scans or its occupancy grid, where the
robot drove and how fast, with a time line, which drives were found and why they end, command
against motion, what the robot does when it is told to go forward, people, and the quality of the
recording. The first sentence states what is missing before a model can claim anything.

A bag of another robot gets the mapping that 'serd bag suggest' finds; --mapping names another
one.
"""

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

from serd_cli.options import AsJson, arg, opt, present

Recorded = Annotated[Path, arg("bag folder or file, or table of trajectories", "BAG|TABLE")]
Output = Annotated[Path, opt("folder that gets look.html")]
Mapping = Annotated[Path | None, opt("mapping file as of 'serd demos'", callback=present)]


def look(
    recorded: Recorded,
    output: Output = Path("look"),
    mapping: Mapping = None,
    as_json: AsJson = False,
) -> None:
    """Parse the options, write the page and print what is known."""
    from serd_app.report.look import look as look_at
    from serd_app.report.look_page import write_look
    from serd_bag.files import require_folder
    from serd_cli.output.terminal import console, print_json

    require_folder(output)
    found = look_at(recorded, mapping)
    page = write_look(found, output)
    if as_json:
        drives = [asdict(each) for each in found.drives]
        counts = {"n_decisions": found.n_decisions, "outcomes": found.outcomes}
        print_json({"page": page, "enough": found.enough, "drives": drives, **counts})
        return
    console.print(found.enough, soft_wrap=True)
    console.print(f"page: {page}", soft_wrap=True)
    for line in found.next_commands():
        console.print(f"next: {line}", soft_wrap=True)
