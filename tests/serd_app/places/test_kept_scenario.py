"""The scenario beside a model or a table: generated files are replaced, those of the user kept."""

import pytest

from serd_app.errors import AppError
from serd_app.places.kept_scenario import keep_scenario, kept_scenario_file, own_scenario_yaml
from serd_sim.scenario.scenario import load_scenario

HALLWAY = load_scenario("hallway")
MINE, OTHER = (
    own_scenario_yaml(HALLWAY.model_copy(update={"name": name})) for name in ("mine", "other")
)


@pytest.fixture
def table(tmp_path):
    return tmp_path / "office.csv"


def test_a_generated_scenario_is_replaced_and_deleted(table):
    file = kept_scenario_file(table)
    for text in (MINE, OTHER):
        keep_scenario(table, text)
        name = "mine" if text == MINE else "other"
        assert load_scenario(file) == HALLWAY.model_copy(update={"name": name})
    keep_scenario(table, "")
    assert not file.exists()


@pytest.mark.parametrize("text", [OTHER, ""])
@pytest.mark.parametrize("written", ["edited", f"# My office.\n{MINE}", "shopping: [milk]\n"])
def test_a_file_of_the_user_is_neither_replaced_nor_deleted(table, text, written):
    file = kept_scenario_file(table)
    if written == "edited":
        keep_scenario(table, MINE)
        written = file.read_text().replace("name: mine", "name: my own")
    file.write_text(written)
    with pytest.raises(AppError, match="edited or written by hand; move it to another name"):
        keep_scenario(table, text)
    assert file.read_text() == written


def test_a_scenario_of_the_user_that_is_in_use_stays_with_its_comments(table):
    file = kept_scenario_file(table)
    file.write_text(f"# My office.\n{MINE}")
    keep_scenario(table, MINE)
    assert file.read_text() == f"# My office.\n{MINE}"
