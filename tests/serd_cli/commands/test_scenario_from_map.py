"""`serd scenario from-map`: a scenario file with comments, and a plan."""

import pytest

from serd_sim.scenario.scenario import load_scenario
from support.ros_maps import depot, maze, write_map


def test_a_map_becomes_a_scenario_file_and_a_picture(serd, tmp_path):
    path = write_map(tmp_path, "depot", depot())
    ended = serd("scenario", "from-map", path, "--robot-radius-m", 0.18, "--max-speed-mps", 0.4)
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


def test_the_numbers_as_json_name_the_files(serd, tmp_path):
    path = write_map(tmp_path, "maze", maze(cells=6))
    words = (
        "--cell-size-m",
        0.4,
        "--robot-radius-m",
        0.15,
        "--output",
        "m.yaml",
    )
    values = serd("scenario", "from-map", path, *words, "--json").values
    assert values["file"] == str(tmp_path / "here" / "m.yaml")
    assert (values["cell_size_m"], values["patience_s"]) == (0.4, 4.0)
    assert values["cells_area_m2"] < values["free_area_m2"]


def test_an_area_becomes_a_scenario(serd, tmp_path):
    (tmp_path / "hall.wkt").write_text("POLYGON ((0 0, 12 0, 12 4, 4 4, 4 12, 0 12, 0 0))")
    ended = serd("scenario", "from-map", tmp_path / "hall.wkt", "--cell-size-m", 0.8)
    assert ended.code == 0, ended.err
    assert ended.out.startswith("a free area of 80 m2 with 6 walls and 0 solids in it; ")
    text = (tmp_path / "here" / "hall-scenario.yaml").read_text()
    assert text.startswith("# Place of the area hall.wkt.\n")


def test_an_edited_scenario_is_replaced_only_where_output_names_it(serd, tmp_path):
    words = ("scenario", "from-map", write_map(tmp_path, "maze", maze(cells=6)))
    words += ("--cell-size-m", 0.4, "--robot-radius-m", 0.15)
    assert serd(*words).code == 0
    assert serd(*words).code == 0
    file = tmp_path / "here" / "maze-scenario.yaml"
    generated = file.read_text()
    edited = generated.replace("count: 0", "count: 0  # nights only")
    file.write_text(edited)
    assert "give --output maze-scenario.yaml to replace it" in serd(*words).refusal
    assert file.read_text() == edited
    assert serd(*words, "--output", "maze-scenario.yaml").code == 0
    assert file.read_text() == generated


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (("none.yaml",), "none.yaml: it does not exist"),
        (("none",), "none"),
        (("MAP", "--goal", "here"), "goal must be two numbers 'x, y' (m), got 'here'"),
        (("MAP", "--start", "99,99"), "the point (99.0, 99.0) m must lie in the free area"),
        (("MAP", "--cell-size-m", "-1"), "cell_size_m must be greater than 0, got -1"),
        (("MAP", "--cell-size-m", "0.001"), "cell_size_m must make at most 40000 cells of the"),
        (("MAP", "--max-speed-mps", "9"), "control_period_s must be at most 0.2 s"),
        (("MAP", "--output", "MAP"), "--output must not overwrite what is read"),
        (("MAP", "--output", "plan.png"), "--output must end in .yaml, .yml, got plan.png"),
    ],
)
def test_bad_input_gets_a_sentence(serd, tmp_path, words, sentence):
    path = write_map(tmp_path, "maze", maze(cells=6))
    refusal = serd(
        "scenario", "from-map", *(path if word == "MAP" else word for word in words)
    ).refusal
    assert sentence in refusal
    assert not list((tmp_path / "here").iterdir())
