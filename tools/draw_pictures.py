"""Draw the pictures of README, tutorials and how-to pages in docs/pictures.

`make pictures` draws all of them, `make pictures ARGS=NAME` one. Those of the demo are drawn from
docs/pictures/demo; `--demo FOLDER` takes this data from a run of the demo first. `--check` leaves
the pictures as they are and fails where pixels would change. Pages need Chromium.
"""

import argparse
import io
import shutil
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from PIL import Image
from selenium.webdriver import Chrome

from serd_app.demonstrations.decision_table import load_decisions
from serd_app.report.figures.arrival import draw_comparison
from serd_app.report.figures.maps import draw_policy_map, draw_visitation
from serd_app.report.style import png_bytes
from serd_app.teleop.page.server import PageAccess, PageServer
from serd_app.teleop.page.view import (
    overlay_of,
    point,
    scene_of,
    watched_scene_of,
    world_state,
)
from serd_cli.demo.folder import DemoFolder
from serd_cli.demo.report import read_recording
from serd_core.arrival.trap_states import trap_states
from serd_core.demonstrations.crossings import CellTracker
from serd_core.demonstrations.decisions import state_counts
from serd_core.grid.grid import Action
from serd_files.table import load_episodes
from serd_sim.drivers.catalogue import make_driver
from serd_sim.drivers.strategy import Strategy, load_strategy, start_distribution
from serd_sim.episodes.episode import run_episode
from serd_sim.planning.catalogue import make_planner
from serd_sim.scenario.grid import grid_of
from serd_sim.scenario.scenario import load_scenario
from serd_sim.world.command import Command
from serd_sim.world.observation import Observation
from serd_sim.world.waypoint import waypoint_of_intent
from serd_sim.world.world import HallwayWorld

ROOT = Path(__file__).resolve().parents[1]
PICTURES = ROOT / "docs" / "pictures"
#: What the pictures of the demo are drawn from.
KEPT = PICTURES / "demo"
#: Writes a picture, from the kept data where it is of the demo.
Draw = Callable[[Path, Path], None]
sys.path.insert(0, str(ROOT / "tests"))

from support.browser import start_chromium, view  # noqa: E402
from support.pixels import MOST_OTHER, share_of_other_pixels  # noqa: E402
from support.ros_maps import depot, write_map  # noqa: E402
from support.waiting import wait_until  # noqa: E402

HALLWAY = load_scenario("hallway")
BAG = ROOT / "bags" / "data" / "hallway" / "training"
#: Tracks are kept to this distance.
_TRACK_M = 0.005
#: The moment that pages show (s), and the step of the states before it, which draw the way (s).
_SHOWN_S, _STATE_S = 20.0, 0.2


def keep_demo(run: Path, kept: Path) -> None:
    """Copy what the pictures of the demo are drawn from, without paths of this machine."""
    folder = DemoFolder(run)
    kept.mkdir(parents=True, exist_ok=True)
    shutil.copy(folder.model, kept / "model.yaml")
    shutil.copy(folder.navigation / "episodes.csv", kept / "episodes.csv")
    text = folder.decisions.read_text(encoding="utf-8")
    (kept / "decisions.csv").write_text(text.replace(f"{folder.bag}", "demo"), encoding="utf-8")
    rows = [
        (episode, round(x_m, 3), round(y_m, 3))
        for episode, track in enumerate(read_recording(folder.bag).poses)
        for x_m, y_m in shapely.LineString(track[:, :2]).simplify(_TRACK_M).coords
    ]
    np.savetxt(kept / "tracks.csv", rows, fmt="%g", delimiter=",", header="episode,x_m,y_m")


def draw_demo_visitation(path: Path, kept: Path) -> None:
    """Where demonstrations took decisions, and their tracks."""
    rows = np.loadtxt(kept / "tracks.csv", delimiter=",")
    tracks_m = [rows[rows[:, 0] == episode, 1:] for episode in np.unique(rows[:, 0])]
    grid = _strategy(kept).problem.grid
    visits = state_counts(load_decisions(kept / "decisions.csv"), grid.n_states)
    path.write_bytes(png_bytes(draw_visitation(HALLWAY, grid, visits, tracks_m)))


def _strategy(kept: Path) -> Strategy:
    return load_strategy(str(kept / "model.yaml"), HALLWAY, "optimal")


def draw_demo_policy(path: Path, kept: Path) -> None:
    """The learned policy on the value of each cell."""
    strategy = _strategy(kept)
    policy, grid, goals = strategy.policy, strategy.problem.grid, strategy.problem.goal_states
    traps = trap_states(grid.neighbours, policy.greedy, goals)
    figure = draw_policy_map(HALLWAY, grid, policy.value, policy.greedy, goals, traps)
    path.write_bytes(png_bytes(figure))


def draw_demo_arrival(path: Path, kept: Path) -> None:
    """Predicted and measured time of arrival."""
    strategy = _strategy(kept)
    law = strategy.law_from(start_distribution(HALLWAY, "train"))
    rows = load_episodes(kept / "episodes.csv")
    times_s = np.array([row.time_of_arrival_s if row.arrived else np.inf for row in rows])
    path.write_bytes(png_bytes(draw_comparison(law, times_s, strategy.timeout_s)))


def draw_episode(path: Path, _kept: Path) -> None:
    """A demonstration from above, as a movie."""
    _serd("scenario", "film", "hallway", "--output", path)


def draw_episode_3d(path: Path, _kept: Path) -> None:
    """A moment of it behind the robot, among more people."""
    options = ("--people", "60", "--view", "chase", "--at", "13")
    _serd("scenario", "film", "hallway", *options, "--output", path)


def draw_map_scenario(path: Path, _kept: Path) -> None:
    """The scenario that `serd scenario from-map` makes of a scanned hall."""
    with tempfile.TemporaryDirectory() as name:
        plan = Path(name) / "depot-scenario.yaml"
        options = ("--robot-radius-m", "0.18", "--max-speed-mps", "0.4", "--output", plan)
        _serd("scenario", "from-map", write_map(Path(name), "depot", depot()), *options)
        shutil.copy(plan.with_suffix(".png"), path)


def draw_report_page(path: Path, _kept: Path) -> None:
    """The page that two commands make of a shipped recording: its top, and its maps."""
    with tempfile.TemporaryDirectory() as name, _browser() as browser:
        folder = Path(name)
        decisions, model = folder / "decisions.csv", folder / "model.yaml"
        _serd("demos", BAG, "--cell-size-m", "1", "--output", decisions)
        _serd("learn", decisions, "--output", model, "--report", folder / "report")
        view(browser, width=900, height=1140, scheme="light")
        browser.get((folder / "report" / "report.html").as_uri())
        # The time of day is another in each run.
        browser.execute_script(
            "const line = document.querySelector('.byline');"
            "line.textContent = line.textContent.replace(/, finished .*/, '')"
        )
        halves = [_screenshot(browser)]
        browser.execute_script("document.querySelector('.maps').scrollIntoView()")
        halves.append(_screenshot(browser))
    Image.fromarray(np.hstack([np.asarray(half) for half in halves])).save(path)


def draw_teleop_page(path: Path, _kept: Path) -> None:
    """The page for driving by hand, during an episode."""
    driver = {
        "mux": {"e_stop": "False"},
        "guard": {"action": "DO_NOTHING", "overridden": "False"},
        "recorder": {"recording": "True", "messages": "0", "free_mb": "10000"},
        "there": True,
        "mode": "directions",
    }
    with _shown_page(scene_of(HALLWAY, grid_of(HALLWAY)), driver) as browser:
        _screenshot(browser).save(path)


def draw_watch_page(path: Path, kept: Path) -> None:
    """The page that watches, with the policy of the demo's model."""
    strategy = _strategy(kept)
    scene = watched_scene_of(HALLWAY, grid_of(HALLWAY))
    layers = overlay_of(strategy)
    with _shown_page(scene, {"there": False, "mode": ""}, layers) as browser:
        browser.find_element("css selector", "[data-layer=policy]").click()
        _screenshot(browser).save(path)


@contextmanager
def _shown_page(
    scene: dict[str, Any], more: dict[str, Any], layers: dict[str, Any] | None = None
) -> Iterator[Chrome]:
    """A browser with the page of the server after some seconds of an episode.

    more: of each state, besides world and episode. The page draws the robot's way from the states,
    so each is sent until the page shows it, and the last one until the end.
    """
    server = PageServer(scene, PageAccess("127.0.0.1"), 0)
    ended = threading.Event()
    state: dict[str, Any] = {}

    def send() -> None:
        while not ended.wait(0.02):
            if state:
                server.show({**state, **more, "page": server.driving_page})

    sender = threading.Thread(target=send)
    sender.start()
    try:
        if layers is not None:
            server.show_overlay(layers)
        with _browser() as browser:
            view(browser, width=1280, height=860, scheme="light")
            browser.get(server.url)
            for each in _episode_states():
                state = each
                seconds = f"{each['episode']['duration_s']:.1f}"
                shown = browser.find_element("id", "duration")
                wait_until(lambda: shown.get_attribute("textContent") == seconds)  # noqa: B023
            yield browser
    finally:
        ended.set()
        sender.join()
        server.close()


def _episode_states() -> list[dict[str, Any]]:
    """What a page is sent of an episode that the expert drives in process."""
    states: list[dict[str, Any]] = []
    grid, began_s, entered = grid_of(HALLWAY), [], []
    cells = CellTracker(grid)

    def see(observation: Observation, _: Command, action: Action) -> bool:
        began_s.append(observation.time_s)
        entered.extend(cells.see(observation.time_s, observation.x_m, observation.y_m))
        passed_s = observation.time_s - began_s[0]
        if world.is_scan_tick and round(passed_s / _STATE_S, 6).is_integer():
            states.append({
                "type": "state",
                "world": world_state(observation, world.scan(observation)),
                "is_stale": False,
                "choice": action.name.lower(),
                "waypoint": point(waypoint_of_intent(grid, observation, action)),
                "episode": {
                    "phase": "running", "outcome": "", "other_driver": "",
                    "duration_s": round(passed_s, 1), "decisions": len(entered),
                    **dict.fromkeys(("number", "kept", "arrived", "discarded"), 0),
                },
                **dict.fromkeys(("next_start", "mux", "guard", "recorder")),
            })  # fmt: skip
        return passed_s < _SHOWN_S

    with HallwayWorld(HALLWAY, seed=1) as world:
        driver = make_driver("expert", HALLWAY, 1)
        run_episode(world, make_planner("dwa", HALLWAY), driver, episode=0, observer=see)
    return states


@contextmanager
def _browser() -> Iterator[Chrome]:
    with tempfile.TemporaryDirectory() as name, ExitStack() as ends:
        browser = start_chromium(Path(name))
        ends.callback(browser.quit)
        yield browser


def _screenshot(browser: Chrome) -> Image.Image:
    return Image.open(io.BytesIO(browser.get_screenshot_as_png())).convert("RGB")


def _serd(*words: str | Path) -> None:
    command = [str(Path(sys.executable).with_name("serd")), *map(str, words)]
    found = subprocess.run(command, capture_output=True, text=True, check=False)
    if found.returncode:
        raise SystemExit(f"{' '.join(command)} ended with {found.returncode}:\n{found.stderr}")


OF_DEMO: dict[str, Draw] = {
    "demo_visitation.png": draw_demo_visitation,
    "demo_policy.png": draw_demo_policy,
    "demo_arrival.png": draw_demo_arrival,
}
OF_PAGES: dict[str, Draw] = {
    "report_page.png": draw_report_page,
    "teleop_page.png": draw_teleop_page,
    "watch_page.png": draw_watch_page,
}
DRAWN: dict[str, Draw] = {
    **OF_DEMO,
    "episode.gif": draw_episode,
    "episode_3d.png": draw_episode_3d,
    "map_scenario.png": draw_map_scenario,
    **OF_PAGES,
}


def drifted(names: Sequence[str], kept: Path = KEPT) -> list[str]:
    """The pictures that are not what is drawn now."""
    found = []
    with tempfile.TemporaryDirectory() as folder:
        for name in names:
            DRAWN[name](Path(folder) / name, kept)
            if share_of_other_pixels(Path(folder) / name, PICTURES / name) > MOST_OTHER:
                found.append(name)
    return found


def keep_few_colours(path: Path) -> None:
    """Write a PNG with 256 colours, which takes a third and stays within what the check allows."""
    if path.suffix == ".png":
        with Image.open(path) as picture:
            kind = Image.Quantize.MAXCOVERAGE
            few = picture.convert("RGB").quantize(256, kind, dither=Image.Dither.NONE)
        few.save(path, optimize=True)


def main() -> int:
    """Entry point."""
    parser = argparse.ArgumentParser(prog="make pictures ARGS=...", description=__doc__)
    parser.add_argument("names", nargs="*", choices=[[], *DRAWN], help="all when none is named")
    parser.add_argument("--demo", type=Path, help="a run of the demo, for the pictures of it alone")
    parser.add_argument("--check", action="store_true", help="draw nothing, fail where one drifted")
    given = parser.parse_args()
    if given.demo and not DemoFolder(given.demo).model.exists():
        got = f"got {given.demo}; run serd demo"
        parser.error(f"--demo must be the folder of a finished demo, {got}")
    names = given.names or [*(OF_DEMO if given.demo else DRAWN)]
    with tempfile.TemporaryDirectory() as folder:
        kept = Path(folder) if given.demo and given.check else KEPT
        if given.demo:
            keep_demo(given.demo, kept)
        if given.check:
            found = drifted(names, kept)
            for name in found:
                sentence = "is not what is drawn now: make pictures"
                print(f"docs/pictures/{name} {sentence}", file=sys.stderr)
            return int(bool(found))
    for name in names:
        DRAWN[name](PICTURES / name, KEPT)
        keep_few_colours(PICTURES / name)
        print(f"drawn: docs/pictures/{name}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
