"""Notebooks of the tutorials show what they print; the site fails where they print otherwise."""

import json
import runpy
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
TOOL = runpy.run_path(str(ROOT / "tools" / "run_notebooks.py"))
NOTEBOOKS = TOOL["NOTEBOOKS"]


def notebook(*outputs):
    return {"cells": [{"cell_type": "markdown"}, {"outputs": list(outputs)}]}


def stream(text):
    return {"output_type": "stream", "text": text}


def test_another_number_is_a_difference_and_named_with_its_cell():
    shown, found = notebook(stream("a\nweight 3.2\n")), notebook(stream("a\nweight 3.3\n"))
    assert TOOL["differences"](shown, found)[-2:] == ["-cell 2: weight 3.2", "+cell 2: weight 3.3"]


def test_a_picture_is_compared_by_its_description_and_lines_however_they_are_stored():
    picture = {"data": {"image/png": "iVBORw0KGgo", "text/plain": ["<Figure>"]}}
    shown = notebook(stream(["a\n", "b\n"]), picture)
    found = notebook(stream("a\nb\n"), {"data": {"image/png": "other", "text/plain": "<Figure>"}})
    assert TOOL["differences"](shown, found) == []
    assert TOOL["differences"](shown, notebook(stream("a\nb\n"))) != []


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_each_notebook_was_executed_and_names_no_folder_of_a_machine(path):
    content = json.loads(path.read_text(encoding="utf-8"))
    code = [cell for cell in content["cells"] if cell["cell_type"] == "code"]
    assert sum(bool(cell["outputs"]) for cell in code) >= 3
    assert not [cell for cell in code for each in cell["outputs"] if "ename" in each]
    printed = "\n".join(TOOL["printed_lines"](content))
    assert "/home/" not in printed
    assert str(ROOT) not in printed
    assert path.name in (ROOT / "mkdocs.yml").read_text(encoding="utf-8")
