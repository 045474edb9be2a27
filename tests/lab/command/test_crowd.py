"""`python -m lab crowd`: the crowd against measured ones, as a table and a picture."""

import json

import numpy as np
import pytest

from lab.crowd import comparison, corridor_measures
from serd_sim.crowd.social_force import model_names

pytest.importorskip("pedpy", reason="PedPy needs Python 3.11")


@pytest.fixture(autouse=True)
def _quick(monkeypatch):
    monkeypatch.setattr(comparison, "DENSITIES", (0.5,))
    defaults = corridor_measures.measure_simulation.__kwdefaults__
    quick = defaults | {"settle_s": 5.0, "duration_s": 5.0}
    monkeypatch.setattr(corridor_measures.measure_simulation, "__kwdefaults__", quick)


HEADER = "framerate: 25\nid frame x/cm y/cm z/cm"


@pytest.fixture
def recording(tmp_path):
    """Eight people in a corridor of 4 m, four each way: half a person per square metre."""
    frames = np.arange(150)
    along = (frames - 75) / 25.0
    rows = []
    for person in range(8):
        way, y_cm = (1, -150 + 40 * person) if person % 2 else (-1, -150 + 40 * person)
        rows += [[person, f, 100 * way * x, y_cm, 170] for f, x in zip(frames, along, strict=True)]
    path = tmp_path / "people.txt"
    np.savetxt(path, rows, header=HEADER)
    return path


def test_every_model_is_compared_with_weidmann_and_with_the_recording(lab, recording, tmp_path):
    picture = tmp_path / "crowd.png"
    ended = lab("crowd", "--recording", recording, "--output", picture, "--json")
    rows = json.loads(ended.out)["rows"]
    assert picture.read_bytes().startswith(b"\x89PNG")
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


def test_what_cannot_be_compared_is_refused_by_the_name_of_the_file(lab, recording, tmp_path):
    rows = np.loadtxt(recording)
    one, far = tmp_path / "one.txt", tmp_path / "far.txt"
    np.savetxt(one, rows[rows[:, 0] == 0], header=HEADER)
    np.savetxt(far, rows, header="framerate: 25\nid frame x/mm y/mm z/mm")
    for path, sentence in ((one, "at least 2, got 1"), (far, "check the unit")):
        words = ("--recording", recording, "--recording", path)
        ended = lab("crowd", *words, "--output", tmp_path / "crowd.png")
        assert ended.code == 2
        assert f"lab: {path}: " in ended.err
        assert sentence in " ".join(ended.err.split())


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (("--output", "crowd.jpg"), "--output must end in .png, got crowd.jpg"),
        (("--recording", "none.txt"), "lab: cannot read none.txt: it does not exist"),
        (
            ("--output", "here.png/x.png"),
            "cannot write here.png: a file of this name is in the way",
        ),
        (("--recroding", "none.txt"), "No such option"),
        (("--fps", "0"), "--fps must be above 0, got 0"),
    ],
)
def test_bad_input_gets_a_sentence_and_exit_code_2(lab, words, sentence, tmp_path):
    (tmp_path / "here" / "here.png").touch()
    ended = lab("crowd", *words)
    assert ended.code == 2
    assert sentence in ended.err
