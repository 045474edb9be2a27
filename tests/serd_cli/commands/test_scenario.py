"""`serd scenario`: which places there are, pictures and movies of them, and places from maps."""

import pytest
from PIL import Image

from serd_app.journeys import film
from serd_files.yaml_config import model_yaml
from serd_sim.scenario.grid import grid_of
from serd_sim.scenario.names import builtin_scenarios
from serd_sim.scenario.scenario import load_scenario
from support.ros_maps import depot, maze, write_map


def test_every_built_in_scenario_is_listed(serd):
    ended = serd("scenario", "list")
    assert ended.code == 0
    for name in builtin_scenarios():
        assert name in ended.out
        assert load_scenario(name).description[:30] in ended.out
    values = {each["scenario"]: each for each in serd("scenario", "list", "--json").values}
    assert tuple(values) == builtin_scenarios()
    assert values["hallway"]["size_m"] == [14.0, 24.0]
    assert values["hallway"]["cells"] == grid_of(load_scenario("hallway")).n_states


def test_showing_a_scenario_or_a_file_of_one_draws_it(serd, tmp_path):
    ended = serd("scenario", "show", "hallway")
    assert str(tmp_path / "here" / "hallway.png") in ended.out
    with Image.open("hallway.png") as image:
        assert image.format == "PNG"
        assert image.size[1] > image.size[0]  # as the hallway is
        assert len(image.convert("RGB").getcolors(1 << 20)) > 5
    mine = load_scenario("corridor").with_values("robot", max_vel_x_mps=0.2)
    mine = mine.model_copy(update={"description": "My own corridor."})
    (tmp_path / "mine.yaml").write_text(model_yaml(mine))
    picture = tmp_path / "new" / "plan.png"
    words = "scenario", "show", tmp_path / "mine.yaml", "--output", picture
    values = serd(*words, "--json").values
    assert values["description"] == "My own corridor."
    assert values["picture"] == str(picture)
    assert values["remark"] == mine.patience_remark
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert "drives 0.8 m within patience_s = 4 s, less than a cell of 1 m" in serd(*words).out


def test_a_map_becomes_a_scenario_file_and_a_picture(serd, tmp_path):
    path = write_map(tmp_path, "depot", depot())
    words = ("scenario", "from-map", path, "--robot-radius-m", 0.18, "--max-speed-mps", 0.4)
    ended = serd(*words)
    assert ended.code == 0, ended.err
    assert "map of 600 x 300 cells: a free area of" in ended.out
    here = tmp_path / "here"
    text = (here / "depot-scenario.yaml").read_text()
    assert text.startswith("# Place of the map depot.yaml.\n")
    assert (here / "depot-scenario.png").read_bytes().startswith(b"\x89PNG")
    scenario = load_scenario(here / "depot-scenario.yaml")
    assert (scenario.name, scenario.cell_size_m, scenario.patience_s) == ("depot", 0.41, 4.0)
    assert scenario.robot.radius_m == 0.18
    assert serd("scenario", "show", "depot-scenario.yaml", "--json").values["people"] == 0
    values = serd(*words, "--output", "again.yaml", "--json").values
    assert values["file"] == str(here / "again.yaml")
    assert (values["cell_size_m"], values["patience_s"]) == (0.41, 4.0)
    assert values["cells_area_m2"] < values["free_area_m2"]


def test_an_edited_scenario_is_replaced_only_where_output_names_it(serd, tmp_path):
    words = ("scenario", "from-map", write_map(tmp_path, "maze", maze(cells=6)))
    words += ("--cell-size-m", 0.4, "--robot-radius-m", 0.15)
    assert [serd(*words).code for _ in range(2)] == [0, 0]
    file = tmp_path / "here" / "maze-scenario.yaml"
    generated = file.read_text()
    edited = generated.replace("count: 0", "count: 0  # nights only")
    file.write_text(edited)
    assert "give --output maze-scenario.yaml to replace it" in serd(*words).refusal
    assert file.read_text() == edited
    assert serd(*words, "--output", "maze-scenario.yaml").code == 0
    assert file.read_text() == generated


@pytest.fixture
def film_of(serd, monkeypatch):
    monkeypatch.setattr(film, "PIXELS_PER_M", 8.0)
    return lambda *words: serd("scenario", "film", "crossing", "--people", "4", *words)


def test_movies_show_the_whole_episode_at_the_speed_asked_for(film_of, tmp_path):
    path = tmp_path / "episode.gif"
    summary = film_of("--output", path, "--speed", "20", "--json").values
    assert summary["outcome"] == "arrived"
    assert summary["picture"] == str(path)
    with Image.open(path) as movie:
        seconds = movie.n_frames * movie.info["duration"] / 1000.0
    assert seconds == pytest.approx(summary["duration_s"] / 20.0, abs=0.3)


def test_a_picture_shows_the_moment_asked_for(film_of, tmp_path):
    shown = {}
    for at, words in {"end": (), "late": ("--at", "999"), "start": ("--at", "0")}.items():
        ended = film_of(*words, "--output", tmp_path / f"{at}.png")
        assert "arrived after" in ended.out
        with Image.open(tmp_path / f"{at}.png") as picture:
            shown[at] = picture.tobytes()
    assert shown["late"] == shown["end"] != shown["start"]
