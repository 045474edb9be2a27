"""Pictures and movies of the world."""

import numpy as np
import pytest
from PIL import Image

from serd_files.errors import USER_ERRORS
from serd_sim.episodes.film import TopView, save_gif, save_png
from serd_sim.scenario.scenario import load_scenario
from serd_sim.world.command import Command
from serd_sim.world.world import HallwayWorld

HALLWAY = load_scenario("hallway").with_pedestrian_count(5)
RED, BLUE = 0, 2
VIEW = TopView(HALLWAY, pixels_per_m=20.0)


def pixel(frame, x_m, y_m):
    return frame[round((24.3 - y_m) * 20), round((x_m + 0.3) * 20)].astype(int)


def is_coloured(frame, first, by=60):
    """Pixels, or one, whose channel `first` is above its opposite by as much."""
    pixels = frame.astype(int)
    return pixels[..., first] > pixels[..., 2 - first] + by


@pytest.fixture(scope="module")
def seen():
    with HallwayWorld(HALLWAY, seed=1) as world:
        return [world.reset(0), *(world.step(Command(0.5, 0.0)) for _ in range(19))]


def test_robot_and_people_are_drawn_where_they_are():
    frame = VIEW.frame((3.0, 8.0, 0.0), [[1.0, 2.0], [5.0, 20.0]])
    assert frame.dtype == np.uint8
    assert is_coloured(pixel(frame, 3.0, 8.0), BLUE)
    places = ((1.0, 2.0), (5.0, 20.0), (2.0, 12.0))
    assert [is_coloured(pixel(frame, *each), RED) for each in places] == [True, True, False]
    np.testing.assert_array_equal(VIEW.frame(None, [[100.0, 100.0], [-50.0, 3.0]]), VIEW.frame())


def test_png_and_gif_hold_the_frames(seen, tmp_path):
    frames = [VIEW.frame_at(seen, tick) for tick in range(0, 20, 5)]
    save_png(frames[0], tmp_path / "one.png")
    np.testing.assert_array_equal(np.asarray(Image.open(tmp_path / "one.png")), frames[0])
    save_gif(frames, tmp_path / "all.gif", frames_per_s=4.0)
    with Image.open(tmp_path / "all.gif") as movie:
        assert (movie.n_frames, movie.info["duration"]) == (4, 250)


def test_a_movie_without_frames_or_whose_frames_fail_leaves_nothing_behind(tmp_path):
    def failing():
        yield VIEW.frame()
        raise RuntimeError("no more")

    with pytest.raises(USER_ERRORS, match="record an episode first"):
        save_gif([], tmp_path / "none.gif")
    with pytest.raises(RuntimeError, match="no more"):
        save_gif(failing(), tmp_path / "half.gif")
    assert not list(tmp_path.iterdir())
