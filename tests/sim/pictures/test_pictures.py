"""Pictures and movies of the world."""

import numpy as np
import pytest
from PIL import Image

from serd_core.errors import SerdError
from sim.command import STOP, Command
from sim.pictures.camera import Camera, chase_camera
from sim.pictures.movie import save_gif, save_mp4, save_png
from sim.pictures.top_view import TopView
from sim.pictures.trajectory import TrajectoryRecorder
from sim.scenario import load_scenario
from sim.world import HallwayWorld

HALLWAY = load_scenario("hallway").with_pedestrian_count(5)
VIEW = TopView(HALLWAY, pixels_per_m=20.0)


def pixel(frame, x_m, y_m):
    return frame[round((24.3 - y_m) * 20), round((x_m + 0.3) * 20)].astype(int)


def is_blue(colour):
    return colour[2] > colour[0] + 60


def is_orange(colour):
    return colour[0] > colour[2] + 60


@pytest.fixture(scope="module")
def trajectory():
    recorder = TrajectoryRecorder()
    with HallwayWorld(HALLWAY, seed=1) as world:
        seen = world.reset(0)
        for _ in range(20):
            recorder.see(seen, STOP, 0)
            seen = world.step(Command(0.5, 0.0))
    return recorder.trajectory


def test_robot_and_people_are_drawn_where_they_are():
    frame = VIEW.frame((3.0, 8.0, 0.0), [[1.0, 2.0], [5.0, 20.0]])
    assert frame.dtype == np.uint8
    assert is_blue(pixel(frame, 3.0, 8.0))
    assert is_orange(pixel(frame, 1.0, 2.0))
    assert is_orange(pixel(frame, 5.0, 20.0))
    assert not is_orange(pixel(frame, 2.0, 12.0))


def test_the_plan_shows_the_loops_people_walk():
    plan, empty = VIEW.plan(), VIEW.background
    assert not np.array_equal(pixel(plan, 4.5, 10.0), pixel(empty, 4.5, 10.0))
    np.testing.assert_array_equal(pixel(plan, 3.0, 10.0), pixel(empty, 3.0, 10.0))


def test_somebody_outside_the_picture_is_left_out():
    np.testing.assert_array_equal(VIEW.frame(None, [[100.0, 100.0], [-50.0, 3.0]]), VIEW.background)


def test_a_trajectory_gives_one_frame_per_tick(trajectory):
    frames = list(VIEW.frames(trajectory.every(5)))
    assert len(frames) == 4
    x_m, y_m, _ = trajectory.robot_pose[15]
    assert is_blue(pixel(frames[3], x_m, y_m))


def test_png_and_gif_hold_the_frames(trajectory, tmp_path):
    frames = list(VIEW.frames(trajectory.every(5)))
    save_png(frames[0], tmp_path / "one.png")
    np.testing.assert_array_equal(np.asarray(Image.open(tmp_path / "one.png")), frames[0])
    save_gif(frames, tmp_path / "all.gif", frames_per_s=4.0)
    with Image.open(tmp_path / "all.gif") as movie:
        assert movie.n_frames == 4
        assert movie.info["duration"] == 250


def test_an_mp4_without_ffmpeg_is_refused_with_the_fix(trajectory, tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(SerdError, match="apt-get install ffmpeg"):
        save_mp4(VIEW.frames(trajectory), tmp_path / "all.mp4")


def test_a_movie_of_nothing_is_refused(tmp_path):
    with pytest.raises(SerdError, match="record an episode first"):
        save_gif([], tmp_path / "none.gif")
    with pytest.raises(SerdError, match="nothing was recorded"):
        _ = TrajectoryRecorder().trajectory


def test_the_three_dimensional_picture_shows_robot_and_people():
    with HallwayWorld(HALLWAY, seed=1) as world:
        seen = world.reset(0)
        overview = world.picture()
        chase = world.picture(chase_camera(seen.pose))
    assert overview.shape == chase.shape == (480, 640, 3)
    greenish = (overview[..., 1] > overview[..., 0].astype(int) + 30).sum()
    blueish = (chase[..., 2] > chase[..., 0].astype(int) + 30).sum()
    assert greenish > 50
    assert blueish > 50


def test_a_camera_without_distance_is_refused():
    with pytest.raises(SerdError, match="step back"):
        Camera(target_m=(0.0, 0.0, 0.0), distance_m=0.0)
