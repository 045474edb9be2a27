"""One episode as a movie or as one moment of it: what `serd scenario film` does."""

from bisect import bisect_left
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

from serd_bag.files import require_file_place
from serd_sim.drivers.catalogue import make_driver
from serd_sim.episodes.batch import EpisodeTask, scenario_of
from serd_sim.episodes.episode import EpisodeRecord, run_episode
from serd_sim.episodes.film import TopView, save_gif, save_png
from serd_sim.perception.scanning_planner import planner_in_world
from serd_sim.scenario.scenario import Scenario
from serd_sim.world.observation import Observation
from serd_sim.world.world import HallwayWorld

#: Endings of the files that can be written.
SUFFIXES = (".png", ".gif")
#: Of a movie, and of its view from above.
FRAMES_PER_S, PIXELS_PER_M = 10.0, 24.0
Track = Callable[[Sequence[int]], Iterable[int]]


def film(
    task: EpisodeTask,
    output: Path,
    *,
    speed: float = 4.0,
    at_s: float | None = None,
    track: Track = iter,
) -> EpisodeRecord:
    """Drive the episode and draw it; what became of it.

    output: of `SUFFIXES`. speed: of a movie, times real time. at_s: the moment of a picture, its
    end when None. track: passes on the ticks that are drawn.
    """
    require_file_place(output)
    place = scenario_of(task.scenario, task.n_people)
    record, seen = _drive(task, place)
    drawn, last = TopView(place, PIXELS_PER_M), len(seen) - 1
    if output.suffix.lower() == ".png":
        times_s, begin_s = [each.time_s for each in seen], seen[0].time_s
        tick = last if at_s is None else min(bisect_left(times_s, begin_s + at_s), last)
        save_png(drawn.frame_at(seen, tick), output)
        return record
    # Every n-th tick, at exactly the given speed.
    period_s = place.control_period_s
    step = max(1, round(speed / (FRAMES_PER_S * period_s)))
    frames = (drawn.frame_at(seen, tick) for tick in track([*range(0, last, step), last]))
    save_gif(frames, output, speed / (step * period_s))
    return record


def _drive(task: EpisodeTask, scenario: Scenario) -> tuple[EpisodeRecord, list[Observation]]:
    driver = make_driver(task.driver, scenario, task.seed)
    with HallwayWorld(scenario, seed=task.seed) as world:
        seen: list[Observation] = []
        planner = planner_in_world(world, task.people_from)
        record = run_episode(
            world,
            planner,
            driver,
            episode=task.episode,
            start_area=task.start_area,
            observer=lambda observation, *_: seen.append(observation),
        )
    return record, seen
