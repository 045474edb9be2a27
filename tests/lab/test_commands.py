"""`python -m lab`: its list, the help of everything that it runs, results as files, and faults."""

import json
import shlex

import numpy as np
import pytest
import yaml
from typer.testing import CliRunner

from lab.__main__ import app_of
from lab.catalogue import BENCHMARKS, EXPERIMENTS, NAMES, STUDIES
from lab.crowd import comparison, corridor_measures
from serd_sim.crowd.social_force import model_names

#: Words of a command and of the sentence by which it is refused.
REFUSED = (
    ("hallwya", "no experiment or benchmark is named 'hallwya'; did you mean 'hallway'?"),
    ("benchmarks gradeint", "got 'gradeint'; did you mean 'gradient'?"),
    ("bench --method serdd", "got 'serdd'; did you mean 'serd'?"),
    ("bench --task hazards", "got 'hazards'; did you mean 'hazard'?"),
    ("rust", "--data must be given for rust: the folder of Rust's odometer files"),
    ("rust --data . --bins many", "n_bins must be an integer, "),
    ("gridworld --discount 1", "discount must be less than 1, got '1'"),
    ("gridworld --temperature hot", "temperature must be a number, "),
    ("hallway --quick --output afile", "a file of this name is in the way"),
    ("hallway --config people.yaml --output out", "people"),
    ("hallway --config arival.yaml --output out", "did you mean 'arrival'"),
    ("robots --quick --output noted", "holds results of 'python -m lab priors"),
    ("faults --fault scan_nam --output faults.csv", "did you mean 'scan_nan'"),
    ("faults --robot fsat --output f.csv", "did you mean 'fast'"),
    ("faults --stack robot --output f.csv", "--stack and --guard belong to --robot"),
    ("faults --robot fast --guard cmd_vel --output f.csv", "--guard must be written RAW:OUT"),
    ("faults --robot fast --fault people_stop --output f.csv", "--fault must be one of scan_stops"),
    ("faults --robot fast --stack nav2 --output f.csv", "--stack must be one of robot, robot_peo"),
    ("crowd --output crowd.jpg", "--output must end in .png, got crowd.jpg"),
    ("crowd --recording none.txt", "lab: cannot read none.txt: it does not exist"),
    ("crowd --output afile/x.png", "cannot write afile: a file of this name is in the way"),
    ("crowd --recroding none.txt", "No such option"),
    ("crowd --fps 0", "--fps must be above 0, got 0"),
    ("crowd --recording one.txt --output crowd.png", "lab: one.txt: "),
    ("crowd --recording far.txt --output crowd.png", "check the unit"),
)


def test_everything_is_listed_with_a_line_and_has_a_help(lab, root):
    lines = lab().out.splitlines()
    for name in NAMES:
        (line,) = [line for line in lines if line.startswith(f"  {name} ")]
        assert line.split(name, 1)[1].strip()
        assert len(line) <= 100
        shown = CliRunner().invoke(app_of(name), ["--help"])
        assert shown.exit_code == 0, shown.output
        # Runs of long work can be sent to other machines.
        assert ("--jobs" in shown.output) == (name in {*STUDIES, *EXPERIMENTS, "faults", "bench"})
    defining = {
        ".".join(path.relative_to(root).with_suffix("").parts)
        for path in (root / "lab" / "benchmarks").rglob("*.py")
        if "\ndef run(" in path.read_text()
    }
    assert {work.module for work in BENCHMARKS.values()} == defining


@pytest.fixture(scope="module")
def recording():
    """Eight people in a corridor of 4 m, four each way: half a person per square metre."""
    person, frame = (each.ravel() for each in np.indices((8, 150)))
    x_cm = np.where(person % 2, 4.0, -4.0) * (frame - 75)
    return np.stack([person, frame, x_cm, 40 * person - 150, np.full(1200, 170)], axis=1)


def save_recording(name, rows, unit="cm"):
    np.savetxt(name, rows, header=f"framerate: 25\nid frame x/{unit} y/{unit} z/{unit}")


def test_what_is_wrong_gets_a_sentence_before_anything_runs(lab, recording, tmp_path):
    here = tmp_path / "here"
    (here / "afile").touch()
    (here / "people.yaml").write_text("people: 0\n")
    (here / "arival.yaml").write_text("arival: {episodes: 3}\n")
    save_recording("one.txt", recording[recording[:, 0] == 0])
    save_recording("far.txt", recording, "mm")
    assert lab("priors", "--angles", "36", "--output", "noted").code == 0
    before = set(here.rglob("*"))
    for line, sentence in REFUSED:
        ended = lab(*line.split())
        assert ended.code == 2, line
        assert sentence in " ".join(ended.err.split())
        assert set(here.rglob("*")) == before


def test_an_experiment_leaves_its_tables_and_the_command_beside_them(lab, tmp_path):
    words = ("priors", "--n-angles", "36")
    ended = lab(*words, "--output", "out")
    folder = tmp_path / "here" / "out"
    assert (folder / "optimal_distributions.csv").read_text().count("\n") > 4
    assert ended.out.splitlines()[-1].startswith("results: ")
    (noted,) = yaml.safe_load((folder / "provenance.yaml").read_text())["runs"]
    given = (*words, "--jobs", "-1", "--output")
    assert shlex.split(noted["command"])[:-1] == ["python", "-m", "lab", *given]
    assert "n_angles=36" in noted["settings"]
    assert noted["finished"]
    assert noted["packages"]["numpy"]


def test_rows_of_faults_are_written_with_a_picture_and_a_second_run_reuses_them(lab, tmp_path):
    table = tmp_path / "faults.csv"
    words = ("faults", "--scenario", "crossing", "--people", "2", "--seeds", "1", "--jobs", "1")
    words += ("--fault", "scan_nan", "--output", table)
    without, guarded = json.loads(lab(*words, "--json").out)["faults"]
    assert (without["n_stood"], guarded["n_stood"]) == (0, 1)
    assert without["largest_stood_m"] is None
    assert guarded["largest_stood_m"] < 0.6
    assert table.with_suffix(".png").read_bytes().startswith(b"\x89PNG")
    written = table.read_bytes()
    assert "scan_nan" in lab(*words).out
    assert table.read_bytes() == written


def test_every_model_of_crowds_is_compared_with_weidmann_and_with_a_recording(
    lab, recording, monkeypatch
):
    pytest.importorskip("pedpy", reason="PedPy needs Python 3.11")
    monkeypatch.setattr(comparison, "DENSITIES", (0.5,))
    quick = corridor_measures.measure_simulation.__kwdefaults__
    quick = quick | {"settle_s": 5.0, "duration_s": 5.0}
    monkeypatch.setattr(corridor_measures.measure_simulation, "__kwdefaults__", quick)
    save_recording("people.txt", recording)
    ended = lab("crowd", "--recording", "people.txt", "--output", "crowd.png", "--json")
    rows = json.loads(ended.out)["rows"]
    assert [(row["model"], row["place"], row["flow"]) for row in rows] == [
        (model, *place)
        for model in model_names()
        for place in (("Weidmann", "one way"), ("people", "two ways"))
    ]
    weidmann, people = rows[:2]
    assert weidmann["measured_speed_mps"] == pytest.approx(1.30, abs=0.01)
    assert people["measured_speed_mps"] == pytest.approx(1.0, abs=0.01)
    assert 0.4 <= people["measured_nearest_m"] <= 0.8
    assert 0.8 < weidmann["speed_mps"] < 1.5
    assert "8 people, corridor of 3.2 m along x, two ways" in ended.err
