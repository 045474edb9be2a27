"""serd navigate model.yaml --goal 3.5,20.5 --episodes 30

Rerun an interrupted drive in process with the same --output to resume it.
"""

from os.path import realpath
from pathlib import Path
from typing import Annotated, Any

from serd_app.navigation.settings import DriveSettings
from serd_cli.options import AsJson, arg, opt, resolved_scenario, validated, with_settings

Model = Annotated[Path, arg("file of a learned model")]
ScenarioName = Annotated[str, opt("built-in scenario or YAML file, the model's own when not given")]
Output = Annotated[Path | None, opt("folder for tables and arrival.png, else nothing is kept")]


@with_settings(
    DriveSettings,
    patience_decisions="--patience",
    minimum_arrival_probability="--minimum-probability",
)
def navigate(
    model: Model,
    scenario: ScenarioName = "",
    output: Output = None,
    as_json: AsJson = False,
    **options: Any,
) -> None:
    """Parse the options, let the model drive and print prediction and measurement."""
    from serd_app.journeys.navigate import navigate as drive_and_compare
    from serd_app.places.kept_scenario import scenario_of_model
    from serd_cli.output.arrival import arrival_values, drive_in_process, print_arrival
    from serd_cli.output.terminal import print_json
    from serd_files.model_file import load_model

    place = scenario or scenario_of_model(model, load_model(model).scenario)
    settings = validated(
        DriveSettings, model=realpath(model), scenario=resolved_scenario(place), **options
    )
    done = drive_and_compare(settings, output, drive_in_process)
    if as_json:
        print_json(arrival_values(done))
    else:
        print_arrival(done, output)
