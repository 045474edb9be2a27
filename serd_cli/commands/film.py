"""`serd scenario film`: one episode driven in process, as a movie or a picture."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Annotated, Literal

import typer

from serd_cli.errors import UsageError
from serd_cli.options import AsJson, option, require_suffix, validated
from serd_files.settings import setting
from serd_files.yaml_config import StrictModel
from serd_sim.drivers.catalogue import driver_names
from serd_sim.episodes.settings import EpisodeSettings, WorldSettings


class MovieSettings(StrictModel):
    """How fast an episode is shown."""

    speed: float = setting(4.0, "times real time", gt=0, le=1000)


Output = Annotated[Path, typer.Option(help="file to write: .mp4, .gif or .png")]
ScenarioName = Annotated[str, typer.Argument(help="built-in scenario or YAML file")]
Policy = Annotated[str, typer.Option(help=f"{', '.join(driver_names())} or a learned model's file")]
PeopleFrom = Annotated[
    str, typer.Option(help="given: people as they are; scan: from the lidar alone")
]
View = Annotated[
    Literal["top", "overview", "chase"],
    typer.Option(help="from above, the whole in 3-D, or behind the robot in 3-D"),
]
At = Annotated[
    float | None, typer.Option("--at", help="time of a .png (s), the end when not given", min=0)
]


def film(
    output: Output,
    scenario: ScenarioName = "hallway",
    policy: Policy = "expert",
    planner: str = option(WorldSettings, "planner"),
    people_from: PeopleFrom = "given",
    seed: int = option(EpisodeSettings, "seed", default=1),
    episode: Annotated[int, typer.Option(min=0, help="number of the episode")] = 0,
    people: int | None = option(WorldSettings, "people"),
    start_area: str = option(WorldSettings, "start_area"),
    view: View = "top",
    speed: float = option(MovieSettings, "speed"),
    at_s: At = None,
    as_json: AsJson = False,
) -> None:
    """Drive one episode and write it as a movie, or one moment of it as a picture.

    serd scenario film crossing --output episode.mp4

    serd scenario film --view chase --at 20 --output episode.png

    The same seed and policy give the same drive as in serd batch.
    """
    from serd_app.journeys.film import SUFFIXES
    from serd_app.journeys.film import film as drive_and_draw
    from serd_cli.output.terminal import console, print_json
    from serd_sim.episodes.batch import EpisodeTask

    require_suffix(output, *SUFFIXES)
    validated(MovieSettings, speed=speed)
    if at_s is not None and output.suffix.lower() != ".png":
        raise UsageError(f"--at must be left out for a movie, got {at_s:g}; --output names a .png")
    task = EpisodeTask(scenario, seed, episode, people, start_area, planner, policy, people_from)
    done = drive_and_draw(task, output, view=view, speed=speed, at_s=at_s, track=_with_bar)
    if as_json:
        values = {"outcome": done.outcome, "duration_s": done.duration_s}
        print_json({**values, "picture": str(output.resolve())})
        return
    console.print(f"{done.outcome} after {done.duration_s:.1f} s")
    print(f"picture: {output.resolve()}")


def _with_bar(ticks: Sequence[int]) -> Iterator[int]:
    from serd_cli.output.terminal import counting_bar

    with counting_bar("frames") as bar:
        yield from bar.track(ticks)
