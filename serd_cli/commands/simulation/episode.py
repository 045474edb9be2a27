"""`serd episode`: one episode driven in process, as a picture or a movie."""

from contextlib import ExitStack, closing
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
import typer

from serd_bag.files import require_file_place
from serd_cli.errors import UsageError
from serd_cli.options import AsJson, option, require_suffix, validated
from serd_cli.output.terminal import console, counting_bar, print_json
from serd_files.settings import setting
from serd_files.yaml_config import StrictModel
from serd_ros.settings import StackConfig
from serd_sim.drivers.catalogue import driver_names, make_driver
from serd_sim.episodes.batch import EpisodeTask, scenario_of
from serd_sim.episodes.episode import EpisodeRecord, run_episode
from serd_sim.episodes.settings import EpisodeSettings, WorldSettings
from serd_sim.pictures.camera import Frame
from serd_sim.pictures.movie import MOVIE_WRITERS, save_png, with_caption
from serd_sim.pictures.scene import SceneView
from serd_sim.pictures.top_view import TopView
from serd_sim.planning.catalogue import planner_in_world
from serd_sim.scenario.scenario import Scenario
from serd_sim.world.observation import Observation
from serd_sim.world.world import HallwayWorld

_SUFFIXES = (".png", *MOVIE_WRITERS)


class MovieSettings(StrictModel):
    """How an episode is shown."""

    speed: float = setting(4.0, "times real time", gt=0, le=1000)
    frames_per_s: float = setting(10.0, "frames per second of the movie", gt=0, le=60)
    pixels_per_m: float = setting(24.0, "size of the view from above", gt=0, le=200)


group = typer.Typer(
    no_args_is_help=True, suggest_commands=True, help="Drive one episode and render it."
)


@group.command(no_args_is_help=True)
def render(
    output: Annotated[Path, typer.Option(help="file to write: .mp4, .gif or .png")],
    scenario: Annotated[str, typer.Argument(help="built-in scenario or YAML file")] = "hallway",
    policy: Annotated[
        str, typer.Option(help=f"{', '.join(driver_names())} or a learned model's file")
    ] = "expert",
    planner: str = option(WorldSettings, "planner"),
    people_from: str = option(StackConfig, "people_from"),
    seed: int = option(EpisodeSettings, "seed", default=1),
    episode: Annotated[int, typer.Option(min=0, help="number of the episode")] = 0,
    people: int | None = option(WorldSettings, "people"),
    start_area: str = option(WorldSettings, "start_area"),
    view: Annotated[
        Literal["top", "overview", "chase"],
        typer.Option(help="from above, the whole in 3-D, or behind the robot in 3-D"),
    ] = "top",
    speed: float = option(MovieSettings, "speed"),
    frames_per_s: float = option(MovieSettings, "frames_per_s"),
    pixels_per_m: float = option(MovieSettings, "pixels_per_m"),
    at_s: Annotated[
        float | None, typer.Option("--at", help="time of a .png (s), the end when not given", min=0)
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Drive an episode and write it as a movie, or one moment of it as a picture.

    serd episode render crossing --output episode.mp4

    serd episode render --view chase --at 20 --output episode.png

    The same seed, episode and policy give the same drive as in serd batch.
    """
    require_suffix(output, *_SUFFIXES)
    require_file_place(output)
    movie = validated(
        MovieSettings, speed=speed, frames_per_s=frames_per_s, pixels_per_m=pixels_per_m
    )
    if at_s is not None and output.suffix.lower() != ".png":
        raise UsageError(f"--at must be left out for a movie, got {at_s:g}; --output names a .png")
    task = EpisodeTask(scenario, seed, episode, people, start_area, planner, policy, people_from)
    place = scenario_of(scenario, people)
    record, seen = _drive(task, place)
    with ExitStack() as stack:
        drawn: TopView | SceneView = TopView(place, movie.pixels_per_m)
        if view != "top":
            drawn = stack.enter_context(closing(SceneView(place, chasing=view == "chase")))
        _write(drawn, seen, place, output, movie, at_s)
    if as_json:
        print_json({"outcome": record.outcome, "duration_s": record.duration_s,
                    "picture": str(output.resolve())})  # fmt: skip
        return
    console.print(f"{record.outcome} after {record.duration_s:.1f} s")
    print(f"picture: {output.resolve()}")


def _drive(task: EpisodeTask, scenario: Scenario) -> tuple[EpisodeRecord, list[Observation]]:
    driver = make_driver(task.driver, scenario, task.seed)
    with HallwayWorld(scenario, seed=task.seed) as world:
        seen: list[Observation] = []
        planner = planner_in_world(task.planner, world, task.people_from)
        record = run_episode(
            world,
            planner,
            driver,
            episode=task.episode,
            start_area=task.start_area,
            observer=lambda observation, *_: seen.append(observation),
        )
    return record, seen


def _write(
    drawn: TopView | SceneView,
    seen: list[Observation],
    scenario: Scenario,
    output: Path,
    movie: MovieSettings,
    at_s: float | None,
) -> None:
    """One moment as PNG; else a movie of every n-th tick at exactly the given speed."""
    times_s = [each.time_s for each in seen]

    def captioned(tick: int) -> Frame:
        passed_s = times_s[tick] - times_s[0]
        return with_caption(drawn.frame_at(seen, tick), f"{scenario.name}, {passed_s:.1f} s{times}")

    last = len(seen) - 1
    suffix = output.suffix.lower()
    times = "" if suffix == ".png" else f", x{movie.speed:g}"
    if suffix == ".png":
        at = last if at_s is None else int(np.searchsorted(times_s, times_s[0] + at_s))
        save_png(captioned(min(at, last)), output)
        return
    step = max(1, round(movie.speed / (movie.frames_per_s * scenario.control_period_s)))
    shown_per_s = movie.speed / (step * scenario.control_period_s)
    ticks = [*range(0, last, step), last]
    with counting_bar("frames") as bar:
        MOVIE_WRITERS[suffix](map(captioned, bar.track(ticks)), output, shown_per_s)
