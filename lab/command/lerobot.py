"""`python -m lab lerobot`: recordings as a LeRobot dataset."""

from pathlib import Path
from typing import Annotated

import typer

from lab.exports.lerobot import save_lerobot
from serd_app.demonstrations.recorded import demonstrations_of_all
from serd_app.demonstrations.recordings import read_recordings
from serd_app.drives.mapped.mapping import BagMapping
from serd_cli.errors import UsageError
from serd_files.yaml_config import load_yaml_model
from serd_sim.scenario.grid import grid_of
from serd_sim.scenario.scenario import load_scenario


def lerobot(
    bags: Annotated[list[Path], typer.Argument(metavar="BAG", help="bag folders or files")],
    output: Annotated[Path, typer.Option(help="new folder for the dataset")],
    scenario: Annotated[
        str, typer.Option(help="built-in scenario or YAML file they were recorded in")
    ] = "hallway",
    mapping: Annotated[
        Path | None, typer.Option(help="YAML file that maps the topics of a bag")
    ] = None,
) -> None:
    """Write all episodes of recordings as a LeRobot dataset, format v3.0; needs pyarrow.

    python -m lab lerobot BAG --output dataset

    Ten frames per second have the place as observation.state and the direction of the decision in
    force as action.
    """
    place = load_scenario(scenario)
    chosen = load_yaml_model(mapping, BagMapping) if mapping is not None else None
    period_s = place.decision_period_s
    recordings = read_recordings(
        bags, period_s, mapping=chosen, scenario=place, tolerant=False, hidden=False
    )
    for found in demonstrations_of_all(recordings.all, grid_of(place), period_s):
        if found.decisions.hidden.any():
            raise UsageError(
                f"a dataset needs actions, which are hidden in {found.bag}; set action_from: motion"
                " in a --mapping to take the displacement as action"
            )
    n_episodes = save_lerobot(output, recordings.drives, period_s)
    print(f"{n_episodes} episodes: {output.resolve()}")
