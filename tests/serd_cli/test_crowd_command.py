"""`serd crowd compare`: the crowd against measured ones, as a table and a picture."""

import json

import numpy as np
import pytest

from sim.crowd import comparison


@pytest.fixture(autouse=True)
def _quick(monkeypatch):
    monkeypatch.setattr(comparison.compare_one_way, "__defaults__", ((0.5,),))
    monkeypatch.setattr(comparison.compare_two_ways, "__defaults__", ((0.5,),))
    monkeypatch.setattr(comparison.one_way_speed_mps, "__kwdefaults__",
                        {"settle_s": 5.0, "duration_s": 5.0})  # fmt: skip


@pytest.fixture
def recording(tmp_path):
    """Eight people in a corridor of 4 m, four each way: half a person per square metre."""
    frames = np.arange(60)
    along = (frames - 30) / 25.0
    rows = []
    for person in range(8):
        way, y_cm = (1, -150 + 40 * person) if person % 2 else (-1, -150 + 40 * person)
        rows += [[person, f, 100 * way * x, y_cm, 170] for f, x in zip(frames, along, strict=True)]
    path = tmp_path / "people.txt"
    np.savetxt(path, rows)
    return path


def test_both_models_are_compared_with_weidmann_and_with_the_recording(serd, recording, tmp_path):
    picture = tmp_path / "crowd.png"
    ended = serd("crowd", "compare", "--recording", recording, "--output", picture, "--json")
    rows = json.loads(ended.out)["rows"]
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert [(row["model"], row["flow"]) for row in rows] == [
        ("circular_anisotropic", "one way"),
        ("circular_anisotropic", "two ways"),
        ("helbing_molnar_1995", "one way"),
        ("helbing_molnar_1995", "two ways"),
    ]
    assert rows[0]["expected_speed_mps"] == pytest.approx(1.30, abs=0.01)
    assert rows[1]["expected_speed_mps"] == pytest.approx(1.0, abs=0.01)
    assert 0.8 < rows[0]["speed_mps"] < 1.5


def test_without_a_recording_only_weidmann_is_there(serd, tmp_path):
    ended = serd("crowd", "compare", "--output", tmp_path / "crowd.png")
    assert "one way" in ended.out
    assert "two ways" not in ended.out


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (("--output", "crowd.jpg"), "--output must end in .png, got crowd.jpg"),
        (("--recording", "none.txt"), "serd: cannot read none.txt: it does not exist"),
        (
            ("--output", "here.png/x.png"),
            "cannot write here.png: a file of this name is in the way",
        ),
        (("--recroding", "none.txt"), "No such option"),
    ],
)
def test_bad_input_gets_a_sentence_and_exit_code_2(serd, words, sentence, tmp_path):
    (tmp_path / "here" / "here.png").touch()
    ended = serd("crowd", "compare", *words)
    assert ended.code == 2
    assert sentence in ended.err
