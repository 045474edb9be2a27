"""`serd scenario`: which places there are, and a picture of one."""

import json

import pytest
from PIL import Image

from serd_files.yaml_config import model_yaml
from serd_sim.scenario.grid import grid_of
from serd_sim.scenario.names import builtin_scenarios
from serd_sim.scenario.scenario import Scenario, load_scenario


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


def test_showing_a_scenario_draws_it(serd, tmp_path):
    ended = serd("scenario", "show", "hallway")
    picture = tmp_path / "here" / "hallway.png"
    assert ended.code == 0
    assert str(picture) in ended.out
    with Image.open(picture) as image:
        width, height = image.size
        assert image.format == "PNG"
        assert len(image.getcolors(1 << 20)) > 5
    assert height > width  # as the hallway is


def test_a_scenario_file_is_shown_like_a_built_in_one(serd, tmp_path):
    file = tmp_path / "mine.yaml"
    mine = load_scenario("corridor").model_copy(update={"description": "My own corridor."})
    file.write_text(model_yaml(mine))
    picture = tmp_path / "new" / "plan.png"
    values = serd("scenario", "show", file, "--output", picture, "--json").values
    assert values["description"] == "My own corridor."
    assert values["picture"] == str(picture)
    assert picture.read_bytes().startswith(b"\x89PNG")


def test_a_patience_too_short_for_a_cell_is_remarked(serd, tmp_path):
    file = tmp_path / "slow.yaml"
    mine = load_scenario("corridor").with_values("robot", max_vel_x_mps=0.2)
    file.write_text(model_yaml(mine))
    words = "scenario", "show", file, "--output", tmp_path / "plan.png"
    assert "drives 0.8 m within patience_s = 4 s, less than a cell of 1 m" in serd(*words).out
    assert serd(*words, "--json").values["remark"] == mine.patience_remark


def test_the_schema_names_every_key_of_a_scenario_file(serd, tmp_path):
    printed = serd("scenario", "schema").values
    assert set(printed["properties"]) == set(Scenario.model_fields)
    assert "walkable_area_m" in printed["required"]
    assert printed["additionalProperties"] is False
    path = tmp_path / "new" / "scenario.schema.json"
    assert serd("scenario", "schema", "--output", path).code == 0
    assert json.loads(path.read_text()) == printed


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (("show", "halway"), "did you mean 'hallway'?"),
        (("show", "none.yaml"), "cannot read none.yaml: it does not exist"),
        (("show", "hallway", "--output", "plan.jpg"), "--output must end in .png, got plan.jpg"),
        (("schema", "--output", "s.yaml"), "--output must end in .json, got s.yaml"),
        (("lst",), "Did you mean 'list'?"),
    ],
)
def test_bad_input_gets_a_sentence_and_exit_code_2(serd, words, sentence):
    ended = serd("scenario", *words)
    assert ended.code == 2
    assert sentence in ended.err
    assert ended.out == ""
