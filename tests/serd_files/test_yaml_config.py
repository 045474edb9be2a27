"""Strict YAML: what is read is what is written; every fault is one sentence."""

from pathlib import Path
from typing import Literal

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import Field, field_validator

from serd_bag.errors import FileError
from serd_files.yaml_config import StrictModel, load_yaml_model, read_yaml, write_yaml, yaml_model


class Wall(StrictModel):
    name: str
    height_m: float = Field(default=3.0, gt=0)


class Room(StrictModel):
    length_m: float = Field(gt=0)
    side: Literal["left", "right"] = "left"
    count: int = 1
    lit: bool = False
    walls: tuple[Wall, ...] = ()
    doors: dict[str, Wall] = Field(default_factory=dict)
    start_m: tuple[float, float] = (0.0, 0.0)

    @field_validator("count")
    @classmethod
    def _odd(cls, count: int) -> int:
        if count % 2 == 0:
            raise ValueError(f"must be odd, got {count}; add one")
        return count


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("lenght_m: 1", "lenght_m is not a known key; did you mean 'length_m'? (1 more fault)"),
        ("{}", "length_m is required but missing; add it"),
        ("", "length_m is required but missing; add it"),
        ("length_m: -1", "length_m must be greater than 0, got -1"),
        ("length_m: .nan", "length_m must be a finite number, got nan"),
        ("length_m: .inf", "length_m must be a finite number, got inf"),
        ("length_m: '3'", "length_m must be a number, got '3'"),
        ("length_m: true", "length_m must be a number, got True"),
        ("length_m: 1:30", "length_m must be a number, got '1:30'"),
        ("{length_m: 1, lit: 1}", "lit must be a boolean, got 1"),
        ("{length_m: 1, count: 1.5}", "count must be an integer, got 1.5"),
        ("{length_m: 1, count: 4}", "count must be odd, got 4; add one"),
        ("{length_m: 1, side: lft}", "side must be 'left' or 'right', got 'lft'; did you mean "),
        ("{length_m: 1, walls: 3}", "walls must be a list, got 3"),
        ("{length_m: 1, walls: [3]}", "walls[0] must hold keys and values, got 3"),
        (
            "{length_m: 1, walls: [{nme: x}]}",
            "walls[0].nme is not a known key; did you mean 'name'",
        ),
        ("{length_m: 1, doors: {a: {nme: x}}}", "doors.a.nme is not a known key; did you mean 'na"),
        ("{length_m: 1, walls: [{name: a, height_m: 0}]}", "walls[0].height_m must be greater th"),
        ("{length_m: 1, start_m: [1]}", "start_m[1] is required but missing"),
        ("{length_m: 1, start_m: [1, 2, 3]}", "start_m must have at most 2 items, not 3"),
        ("- 1", "must hold keys and values ('key: value'), got a list"),
        ("just words", "must hold keys and values ('key: value'), got a str"),
    ],
)
def test_a_wrong_value_gets_a_sentence_with_key_rule_value_and_fix(text: str, sentence: str):
    with pytest.raises(FileError) as caught:
        yaml_model(text, Room, name="room.yaml")
    assert str(caught.value).startswith(f"room.yaml: {sentence}")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("length_m: 1\nlength_m: 2", "room.yaml, line 2, column 1: not valid YAML: the key 'len"),
        ("length_m: &a 1\ncount: *a", "line 2, column 8: not valid YAML: aliases are refused"),
        ("length_m: [1", "line 1, column 13: not valid YAML"),
        ("length_m: !!python/object:os.system x", "tags are refused; write the value out"),
        ("? [1]\n: 2", "unhashable key"),
        ("length_m: \0", "is it a text file?"),
        ("[" * 5000, "nested too deeply"),
        ("a: 1\n---\nb: 2", "not valid YAML"),
        (b"a: \xff\xfe", "must be UTF-8 text, got byte 0xff at offset 3"),
    ],
)
def test_broken_yaml_gets_a_sentence_with_the_place(tmp_path, monkeypatch, text, sentence):
    monkeypatch.chdir(tmp_path)
    Path("room.yaml").write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(FileError) as caught:
        load_yaml_model("room.yaml", Room)
    assert sentence in str(caught.value)
    assert "\n" not in str(caught.value)


def test_numbers_follow_yaml_1_2():
    values = read_yaml("{a: 1e-3, b: 0777, c: no, d: 1:30, e: 2024-01-01, f: null, g: .5}", "x")
    assert values == {
        "a": 1e-3, "b": 777, "c": "no", "d": "1:30", "e": "2024-01-01", "f": None, "g": 0.5,
    }  # fmt: skip


@given(
    st.recursive(
        st.none()
        | st.booleans()
        | st.integers()
        | st.floats(allow_nan=False)
        | st.text(st.characters(codec="utf-8", exclude_categories=["Cc", "Cs"])),
        lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text("abc:#"), inner),
        max_leaves=8,
    )
)
def test_values_survive_a_round_trip_through_text(values):
    assert read_yaml(write_yaml(values), "x") == values


@given(st.text() | st.text("length_mcoun:[]{}-.0123 \n&*!?|>'\"#%,"))
def test_any_text_is_a_model_or_a_sentence(text):
    sentence = ""
    try:
        yaml_model(text, Room, name="x.yaml")
    except FileError as error:
        sentence = str(error)
    assert not sentence or (sentence.startswith("x.yaml") and "\n" not in sentence)
