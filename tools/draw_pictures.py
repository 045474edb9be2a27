"""Draw the pictures of README, tutorials and how-to pages in docs/pictures; pages need Chromium.

`make pictures` draws all of them but those of the demo, `make pictures ARGS=NAME` one. `--demo
FOLDER` copies those of the demo, and its model, from a run of it.
"""

import argparse
import io
import shutil
import subprocess
import sys
import tempfile
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from serd_app.teleop.page import view as shown
from serd_app.teleop.page.server import PageAccess, PageServer
from serd_core.demonstrations.crossings import CellTracker
from serd_sim.drivers.catalogue import make_driver
from serd_sim.drivers.strategy import load_strategy
from serd_sim.episodes.episode import run_episode
from serd_sim.planning.local_planner import make_planner
from serd_sim.scenario.grid import grid_of
from serd_sim.scenario.scenario import load_scenario
from serd_sim.world.waypoint import waypoint_of_intent
from serd_sim.world.world import HallwayWorld

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "tests")]

from lab.truth.recordings import KINDS, write_recording  # noqa: E402
from support.browser import chromium  # noqa: E402
from support.ros_maps import depot, write_map  # noqa: E402
from support.waiting import wait_until  # noqa: E402

PICTURES = ROOT / "docs" / "pictures"
#: Of the demo, for the page that shows it.
MODEL = PICTURES / "demo_model.yaml"
HALLWAY = load_scenario("hallway")
GRID = grid_of(HALLWAY)
Message = dict[str, Any]
#: Figures of a run of the demo.
OF_DEMO = ("visitation", "policy", "arrival")


def draw_episode(path: Path) -> None:
    """A demonstration from above, as a movie."""
    _serd("scenario", "film", "hallway", "--output", path)


def draw_map_scenario(path: Path) -> None:
    """The scenario that `serd scenario from-map` makes of a scanned hall."""
    with tempfile.TemporaryDirectory() as name:
        plan = Path(name) / "depot-scenario.yaml"
        options = ("--robot-radius-m", "0.18", "--max-speed-mps", "0.4", "--output", plan)
        _serd("scenario", "from-map", write_map(Path(name), "depot", depot()), *options)
        shutil.copy(plan.with_suffix(".png"), path)


def draw_report_page(path: Path) -> None:
    """The page that commands make of laps of the stand-in robot: its top, and its maps."""
    with tempfile.TemporaryDirectory() as name, chromium(width=900, height=1140) as browser:
        decisions, model = Path(name) / "decisions.csv", Path(name) / "model.yaml"
        bag, mapping = write_recording(KINDS["laps"], Path(name) / "laps", 1), Path(name) / "m.yaml"
        _serd("bag", "suggest", bag, "--output", mapping)
        _serd("demos", bag, "--mapping", mapping, "--output", decisions)
        _serd("learn", decisions, "--output", model, "--report", name)
        browser.get((Path(name) / "report.html").as_uri())
        # The time of day is another in each run.
        browser.execute_script(
            "const line = document.querySelector('.byline');"
            "line.textContent = line.textContent.replace(/, finished .*/, '')"
        )
        halves = [browser.get_screenshot_as_png()]
        browser.execute_script("document.querySelector('.maps').scrollIntoView()")
        halves.append(browser.get_screenshot_as_png())
    pictures = [np.asarray(Image.open(io.BytesIO(half))) for half in halves]
    Image.fromarray(np.hstack(pictures)).save(path)


def draw_teleop_page(path: Path) -> None:
    """The page for driving by hand, during an episode."""
    driver = {
        "mux": {"e_stop": "False"},
        "guard": {"action": "DO_NOTHING", "overridden": "False"},
        "recorder": {"recording": "True", "messages": "0", "free_mb": "10000"},
        "there": True,
        "mode": "directions",
    }
    _draw_page(path, shown.scene_of(HALLWAY, GRID), driver)


def draw_watch_page(path: Path) -> None:
    """The page that watches, with the policy of the demo's model."""
    overlay = shown.overlay_of(load_strategy(str(MODEL), HALLWAY, "optimal"))
    nobody = {**dict.fromkeys(("mux", "guard", "recorder")), "there": False, "mode": ""}
    _draw_page(path, shown.watched_scene_of(HALLWAY, GRID), nobody, overlay)


def _draw_page(path: Path, scene: Message, more: Message, layers: Message | None = None) -> None:
    """The page after some seconds of an episode that the expert drives in process.

    more: of each state, besides world and episode. The page draws the robot's way from the states,
    so each is sent until the page shows it.
    """
    server = PageServer(scene, PageAccess("127.0.0.1"), 0)
    cells, entered, began_s = CellTracker(GRID), [], []
    counts = dict.fromkeys(("number", "kept", "arrived", "discarded"), 0)

    def see(observation: Any, _: Any, action: Any) -> bool:
        began_s.append(observation.time_s)
        entered.extend(cells.see(observation.time_s, observation.x_m, observation.y_m))
        passed_s = observation.time_s - began_s[0]
        state = {
            "type": "state", "is_stale": False, "next_start": None, **more,
            "choice": action.name.lower(),
            "waypoint": shown.point(waypoint_of_intent(HALLWAY.cells, observation, action)),
            "episode": {
                "phase": "running", "outcome": "", "other_driver": "", **counts,
                "duration_s": round(passed_s, 1), "decisions": len(entered),
            },
        }  # fmt: skip
        if world.is_scan_tick and round(passed_s / 0.2, 6).is_integer():
            state["world"] = shown.world_state(observation, world.scan(observation))
            wait_until(lambda: is_shown(state))
        return passed_s < 20.0

    def is_shown(state: Message) -> bool:
        server.show({**state, "page": server.driving_page})
        text: str | None = browser.find_element("id", "duration").get_attribute("textContent")
        return text == f"{state['episode']['duration_s']:.1f}"

    size = {"width": 1280, "height": 860}
    with closing(server), chromium(**size) as browser, HallwayWorld(HALLWAY, seed=1) as world:
        browser.get(server.url)
        driver = make_driver("expert", HALLWAY, 1)
        run_episode(world, make_planner(HALLWAY), driver, episode=0, observer=see)
        if layers is not None:
            server.show_overlay(layers)
            wait_until(lambda: browser.find_elements("css selector", "[data-layer=policy]"))
            browser.find_element("css selector", "[data-layer=policy]").click()
        browser.save_screenshot(str(path))


def _serd(*words: str | Path) -> None:
    command = [Path(sys.executable).with_name("serd"), *words]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)


DRAWN = {
    "episode.gif": draw_episode,
    "map_scenario.png": draw_map_scenario,
    "report_page.png": draw_report_page,
    "teleop_page.png": draw_teleop_page,
    "watch_page.png": draw_watch_page,
}


def main() -> None:
    parser = argparse.ArgumentParser(prog="make pictures ARGS=...", description=__doc__)
    parser.add_argument("names", nargs="*", choices=[[], *DRAWN], help="all when none is named")
    parser.add_argument("--demo", type=Path, help="a run of the demo, for the pictures of it alone")
    given = parser.parse_args()
    paths = [PICTURES / name for name in given.names or DRAWN]
    if given.demo:
        shutil.copy(given.demo / "model.yaml", MODEL)
        paths = [PICTURES / f"demo_{name}.png" for name in OF_DEMO]
    for path in paths:
        if given.demo:
            shutil.copy(given.demo / "figures" / path.name.removeprefix("demo_"), path)
        else:
            DRAWN[path.name](path)
        if path.suffix == ".png":  # 256 colours take a third of the bytes
            picture = Image.open(path).convert("RGB")
            kind, dither = Image.Quantize.MAXCOVERAGE, Image.Dither.NONE
            picture.quantize(256, kind, dither=dither).save(path, optimize=True)
        print(f"drawn: docs/pictures/{path.name}")


if __name__ == "__main__":
    main()
