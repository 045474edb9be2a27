"""Pictures and movies of the world."""

import subprocess
from contextlib import closing

import imageio_ffmpeg
import numpy as np
import pytest
from PIL import Image

from serd_files.errors import USER_ERRORS
from serd_sim.pictures.movie import save_gif, save_mp4, save_png
from serd_sim.pictures.scene import SceneView
from serd_sim.pictures.top_view import TopView
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


def decoded(path):
    """All pixels of a movie, one after the other."""
    command = [imageio_ffmpeg.get_ffmpeg_exe(), "-loglevel", "error", "-i", str(path)]
    command += ["-f", "rawvideo", "-pix_fmt", "rgb24", "-"]
    return np.frombuffer(subprocess.run(command, check=True, capture_output=True).stdout, np.uint8)


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


def test_an_mp4_holds_as_many_frames_as_were_given_in_their_colours(seen, tmp_path):
    frames = [VIEW.frame_at(seen, tick) for tick in range(20)]
    path = tmp_path / "new" / "all.mp4"
    save_mp4(frames, path, frames_per_s=10.0)
    height, width = (size // 2 * 2 for size in frames[0].shape[:2])
    shown = decoded(path).reshape(20, height, width, 3)
    assert is_coloured(pixel(shown[-1], *seen[-1].pose[:2]), BLUE)
    assert imageio_ffmpeg.count_frames_and_secs(str(path)) == (20, pytest.approx(2.0))
    assert [each.name for each in path.parent.iterdir()] == ["all.mp4"]


def test_what_gives_no_picture_is_refused(tmp_path):
    with pytest.raises(USER_ERRORS, match="record an episode first"):
        save_gif([], tmp_path / "none.gif")


@pytest.mark.parametrize("save", [save_gif, save_mp4])
def test_a_movie_whose_frames_fail_leaves_nothing_behind(save, tmp_path):
    def failing():
        yield VIEW.frame()
        raise RuntimeError("no more")

    with pytest.raises(RuntimeError, match="no more"):
        save(failing(), tmp_path / "half.mp4")
    assert not list(tmp_path.iterdir())


def test_a_scene_view_draws_an_episode_from_afar_or_behind_the_robot(seen):
    with closing(SceneView(HALLWAY)) as whole, closing(SceneView(HALLWAY, chasing=True)) as behind:
        first, last = whole.frame_at(seen, 0), whole.frame_at(seen, 19)
        near = behind.frame_at(seen, 19)
    assert (first.shape, near.shape) == ((640, 480, 3), (480, 640, 3))
    assert is_coloured(first, RED).sum() > 50
    assert is_coloured(near, BLUE, 30).sum() > 3 * is_coloured(last, BLUE, 30).sum()
    assert not np.array_equal(first, last)
