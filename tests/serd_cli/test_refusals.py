"""What a person may write wrong: one sentence with the fix, exit code 2, and no file."""

import pytest

from serd_files.yaml_config import save_yaml_model
from support.commands import run_serd
from support.ros_maps import maze, write_map
from tests.conftest import model_of
from tests.serd_cli.conftest import write_drive

PLAN = "scenario from-map maze.yaml"
FILM = "scenario film hallway --output"
BATCH = "batch --scenario hallway --output r.csv"
DEMOS = "demos empty --scenario hallway"
LEARN = "learn decisions.csv"

REFUSED = (
    ("bga", "No such command 'bga'. Did you mean 'bag'?"),
    ("learn ''", "TABLE must name a file or folder, got an empty text; write . for"),
    ("bag rescue bag --output=", "--output must name a file or folder, got an empty text"),
    ("bag info nowhere", "cannot read nowhere: it does not exist"),
    ("bag convert bag --compression gzip", "'none', 'zstd'"),
    ("bag play bag --topic intnt", "did you mean '/intent'?"),
    ("bag play bag --remap intent", "--remap must be written FROM:=TO, got 'intent'"),
    ("bag play bag --rate 1e300", "less than or equal to 1000000"),
    ("batch --scenario hallway --output r.txt", "must end in .csv, got r.txt; rename it to r.csv"),
    (f"{BATCH} --policy expart", "did you mean 'expert'?"),
    (f"{BATCH} --seeds 2000000000", "at most 100000, got 2000000000; run them"),
    ("demos empty", "empty must hold rows of values, it holds none"),
    ("demos bag", "either --scenario or --cell-size-m must be given for bag, got neither"),
    (f"{DEMOS} --cell-size-m 1", "must be given, got both"),
    ("demos empty --period-s 1", "or after patience_s (docs/scenarios.md)"),
    (f"{DEMOS} --output a.txt", "--output must end in .csv"),
    (f"{DEMOS} --mapping m.yaml --output m.csv", "m.csv would overwrite m.yaml"),
    ("demos empty --scenario m.yaml --output m.csv", "--output must not overwrite what is read"),
    ("demos bag people.csv --cell-size-m 1 --mapping cm.yaml", "must be for bags or for tables"),
    ("demos bag --scenario hallway --mapping wish.yaml", "needs no mapping; run 'serd demos bag"),
    ("demos amcl --scenario hallway", "it holds no robot_pose but /amcl, /episode, /intent; "),
    ("demos far --scenario hallway", "no decision to learn from"),
    (f"{LEARN} --goal 0.5", "goal must be two numbers 'x, y' (m), got '0.5'"),
    (f"{LEARN} --flow recorded", "decisions.flow.csv, for the bags hold no people; use --flow n"),
    (f"{LEARN} --scenario corridor", "must be the grid of the scenario 'corridor'"),
    (f"{LEARN} --minimum-decisions 100000", "at least minimum_decisions = 100000"),
    (f"{LEARN} --discount 1", "discount must be less than 1, got 1"),
    (f"{LEARN} --output decisions.yaml", "--output must not overwrite what is read"),
    ("learn bag", "TABLE must be a table of decisions, got bag; of a bag 'serd demos' makes"),
    ("navigate model.yaml --goal 9,3", "goal must be in a walkable cell"),
    ("navigate model.yaml --start-area trian", "did you mean 'train'?"),
    ("navigate model.yaml --scenario corridor", "was made for another grid of the scenario 'hall"),
    ("report m.yaml", "m.yaml: "),
    ("report model.yaml --episodes none.csv", "none.csv: it does not exist"),
    ("report other.yaml --start 99,99", "start must be in a walkable cell, got (99, 99) m"),
    ("report other.yaml --output m.yaml", "cannot write m.yaml"),
    ("scenario show halway", "did you mean 'hallway'?"),
    ("scenario show hallway --output p.jpg", "--output must end in .png, got p.jpg"),
    (f"{FILM} e.avi", "--output must end in .png, .gif, got e.avi"),
    (f"{FILM} e.gif --at 3", "--at must be left out for a movie, got 3"),
    (f"{FILM} empty/x.png", "cannot write empty: a file of this name is in the way"),
    (f"{PLAN} --start 99,99", "the point (99.0, 99.0) m must lie in the free area"),
    (f"{PLAN} --cell-size-m 0.001", "cell_size_m must make at most 40000 cells of the"),
    (f"{PLAN} --max-speed-mps 9", "control_period_s must be at most 0.2 s"),
    (f"{PLAN} --output maze.yaml", "--output must not overwrite what is read"),
    ("watch nowhere", "nowhere"),
    ("watch --address 0.0.0.0", "unless a token is given"),
    ("watch --namespace 1", "namespace must be letters"),
    ("teleop --no-page", "always have their page"),
    ("teleop --token-file nowhere", "nowhere"),
    ("launch demonstrat", "did you mean 'demonstrate'?"),
    ("run serd_ros gaurd", "did you mean 'guard'?"),
    ("launch live sede:=3", "did you mean 'seed'?"),
    ("launch live seed=3", "must be written name:=value"),
    ("demo --resume .", "demo.yaml: it does not exist"),
    ("demo --output empty", "a part of the path is a file, not a folder; check"),
)


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """A folder with whole files of each kind."""
    folder = tmp_path_factory.mktemp("place")
    for name, options in {
        "bag": {}, "far": {"x_m": 40.0}, "amcl": {"pose": "/amcl"},
    }.items():  # fmt: skip
        write_drive(folder / name, **options)
    next((folder / "bag").glob("*.mcap")).rename(folder / "bag" / "bag.mcap")
    text = (folder / "bag" / "metadata.yaml").read_text()
    (folder / "bag" / "metadata.yaml").write_text(text.replace("bag_0.mcap", "bag.mcap"))
    for name in ("empty", "m.yaml"):
        (folder / name).touch()
    (folder / "people.csv").write_text("t,x,y\n0,1,1\n1,2,1\n")
    (folder / "cm.yaml").write_text("unit: m\n")
    (folder / "wish.yaml").write_text("pose_topic: /nowhere\n")
    write_map(folder, "maze", maze(cells=6))
    for name in ("model", "other"):
        save_yaml_model(folder / f"{name}.yaml", model_of())
    table = folder / "decisions.csv"
    assert run_serd("demos", folder / "bag", "--scenario", "hallway", "--output", table) == 0
    for file in list(folder.glob("decisions*")):
        for name in ("model.learning", "model.grid"):
            copy = folder / file.name.replace("decisions", name)
            copy.write_bytes(file.read_bytes())
    return folder


def files_in(folder):
    return {path: path.stat().st_mtime_ns for path in folder.rglob("*") if path.is_file()}


@pytest.mark.parametrize(("line", "sentence"), REFUSED)
def test_a_wrong_word_gets_a_sentence_and_changes_nothing(
    serd, place, ros_env, line, sentence, monkeypatch
):
    for name, value in ros_env.items():
        monkeypatch.setenv(name, value)
    monkeypatch.chdir(place)
    before = files_in(place)
    ended = serd(*("" if word == "''" else word for word in line.split()))
    assert sentence in ended.refusal
    assert ended.out == ""
    assert "Traceback" not in ended.err
    assert files_in(place) == before
    assert not list(place.glob("*_output"))
