"""The scenario that is kept beside a model or a table of decisions, where it is not built in.

Its first line holds a checksum of the others: a file that was edited or written by hand is neither
replaced nor deleted.
"""

from hashlib import blake2b
from pathlib import Path

from serd_app.errors import AppError
from serd_bag.errors import FileError
from serd_bag.files import atomic_write_text, delete_file, read_text
from serd_files.yaml_config import model_yaml, yaml_model
from serd_sim.scenario.names import builtin_scenarios
from serd_sim.scenario.scenario import Scenario, load_scenario


def kept_scenario_file(beside: Path) -> Path:
    """Where the scenario of a model or a table is kept: `model.scenario.yaml`."""
    return beside.with_suffix(".scenario.yaml")


def own_scenario_yaml(scenario: Scenario) -> str:
    """The scenario as the text of a file; empty where its name is enough, for it is built in."""
    name = scenario.name
    if name in builtin_scenarios() and load_scenario(name) == scenario:
        return ""
    return model_yaml(scenario)


def keep_scenario(beside: Path, text: str) -> None:
    """Write the text beside the file, or delete that of an earlier one where it is empty.

    A file that was edited is left as it is; see `require_replaceable`.
    """
    require_replaceable(beside, text)
    file = kept_scenario_file(beside)
    if not text:
        delete_file(file)
    elif not file.is_file() or _is_generated(file):
        atomic_write_text(file, _first_line(text) + text)


def require_replaceable(beside: Path, text: str) -> None:
    """AppError where an edited file with another scenario is in the place of the text."""
    file = kept_scenario_file(beside)
    if not file.is_file() or _is_generated(file):
        return
    try:
        same = bool(text) and load_scenario(file) == yaml_model(text, Scenario, name=str(file))
    except FileError:
        same = False
    if not same:
        raise AppError(
            f"{file} must be as it was generated, or hold the scenario in use, got another one that"
            " was edited or written by hand; move it to another name"
        )


def scenario_of_model(model: Path, name: str) -> str:
    """The scenario that is kept beside a model, or that it names; AppError where it has none."""
    file = kept_scenario_file(model)
    found = str(file) if file.is_file() else name
    if not found:
        raise AppError(
            f"--scenario must be given, for {model} was learned on a fitted grid and there is no"
            f" {file}, which 'serd learn' writes where the cells are"
            " connected; name one, or learn again"
        )
    return found


def _first_line(text: str) -> str:
    checksum = blake2b(text.encode(), digest_size=8).hexdigest()
    return f"# Generated, and replaced by the next run unless edited; checksum {checksum}\n"


def _is_generated(file: Path) -> bool:
    first, _, text = read_text(file).partition("\n")
    return f"{first}\n" == _first_line(text)
