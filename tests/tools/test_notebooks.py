"""Notebooks of the tutorials show what they print; pictures are compared by their description.

If one fails: `python -m nbconvert --to notebook --execute --inplace
--ExecutePreprocessor.record_timing=False docs/tutorials/NAME.ipynb`.
"""

import json
import os
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
NOTEBOOKS = sorted((ROOT / "docs").rglob("*.ipynb"))
each_notebook = pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)


def printed_by_cells(path):
    """What each cell of code prints; for a picture its description."""
    cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
    printed = []
    for cell in (cell for cell in cells if cell["cell_type"] == "code"):
        outputs = cell["outputs"]
        assert not [output for output in outputs if "ename" in output]
        texts = (each.get("text") or each["data"]["text/plain"] for each in outputs)
        printed.append("".join("".join(text) for text in texts))  # streams are divided anywhere
    return printed


@each_notebook
def test_each_notebook_was_executed_and_names_no_folder_of_a_machine(path):
    printed = printed_by_cells(path)
    assert len(list(filter(None, printed))) >= 3
    assert not [text for text in printed if "/home/" in text or str(ROOT) in text]
    assert path.name in (ROOT / "mkdocs.yml").read_text(encoding="utf-8")


@each_notebook
@pytest.mark.slow
@pytest.mark.skipif(find_spec("nbconvert") is None, reason="needs what make site installs")
def test_each_notebook_prints_what_it_shows(path, tmp_path):
    folders = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    words = ("nbconvert", "--to", "notebook", "--execute", "--output-dir", tmp_path, path)
    environment = {**os.environ, "PATH": folders, "COLUMNS": "100"}
    subprocess.run([sys.executable, "-m", *words], check=True, env=environment)
    assert printed_by_cells(tmp_path / path.name) == printed_by_cells(path)
