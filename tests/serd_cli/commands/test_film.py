"""`serd scenario film`: one episode as a picture or a movie."""

import imageio_ffmpeg
import pytest
from PIL import Image

from serd_app.journeys import film

SMALL = ("scenario", "film", "crossing", "--people", "4")


@pytest.fixture(autouse=True)
def _small(monkeypatch):
    monkeypatch.setattr(film, "PIXELS_PER_M", 8.0)


def test_a_movie_shows_the_whole_episode_at_the_speed_asked_for(serd, tmp_path):
    path = tmp_path / "episode.mp4"
    summary = serd(*SMALL, "--output", path, "--speed", "20", "--json").values
    assert summary["outcome"] == "arrived"
    assert summary["picture"] == str(path)
    _, seconds = imageio_ffmpeg.count_frames_and_secs(str(path))
    assert seconds == pytest.approx(summary["duration_s"] / 20.0, abs=0.3)


def test_a_gif_moves_and_a_picture_shows_the_end(serd, tmp_path):
    assert serd(*SMALL, "--output", tmp_path / "e.gif", "--speed", "40").code == 0
    with Image.open(tmp_path / "e.gif") as movie:
        assert movie.n_frames > 3
    ended = serd(*SMALL, "--output", tmp_path / "e.png", "--view", "overview")
    assert "arrived after" in ended.out
    with Image.open(tmp_path / "e.png") as picture:
        assert picture.size[0] >= 480


def test_a_picture_shows_the_moment_asked_for(serd, tmp_path):
    shown = {}
    for at, words in {"end": (), "late": ("--at", "999"), "start": ("--at", "0")}.items():
        assert serd(*SMALL, *words, "--output", tmp_path / f"{at}.png").code == 0
        with Image.open(tmp_path / f"{at}.png") as picture:
            shown[at] = picture.tobytes()
    assert shown["late"] == shown["end"] != shown["start"]


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (("--output", "e.avi"), "--output must end in .png, .gif, .mp4, got e.avi"),
        (("--output", "e.mp4", "--speed", "0"), "speed must be greater than 0, got 0"),
        (("--output", "e.mp4", "--at", "3"), "--at must be left out for a movie, got 3"),
        (("--output", "e.mp4", "--view", "side"), "'side' is not one of"),
        (("--output", "e.mp4", "--policy", "exprt"), "did you mean 'expert'?"),
        (("--output", "e.mp4", "--start-area", "trian"), "did you mean 'train'?"),
    ],
)
def test_bad_input_gets_a_sentence_and_exit_code_2(serd, words, sentence, tmp_path):
    assert sentence in serd("scenario", "film", "hallway", *words).refusal
    assert not list((tmp_path / "here").iterdir())


def test_a_picture_below_a_file_is_refused_before_anything_drives(serd, tmp_path):
    (tmp_path / "here" / "afile").touch()
    refusal = serd("scenario", "film", "hallway", "--output", "afile/x.png").refusal
    assert "cannot write afile: a file of this name is in the way" in refusal
