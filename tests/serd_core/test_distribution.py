"""`serd-core` as its own distribution: NumPy and SciPy, and every module."""

import re
import subprocess
import sys
import zipfile

import pytest

pytestmark = pytest.mark.slow


def test_it_needs_numpy_and_scipy_and_has_every_module_and_the_list_of_names(root, tmp_path):
    options = ("--no-deps", "--no-build-isolation", "--quiet", "--wheel-dir", tmp_path)
    source = root / "distributions" / "serd-core"
    subprocess.run([sys.executable, "-m", "pip", "wheel", *options, source], check=True)
    (file,) = tmp_path.glob("serd_core-*.whl")
    with zipfile.ZipFile(file) as archive:
        names = set(archive.namelist())
        (metadata,) = (archive.read(name).decode() for name in names if name.endswith("METADATA"))
    needed = re.findall(r"^Requires-Dist: ([\w-]+)[^;\n]*$", metadata, re.MULTILINE)
    assert sorted(needed) == ["numpy", "scipy"]
    assert (
        f'version = "{re.search(r"^Version: (.+)$", metadata, re.M)[1]}"'
        in (root / "pyproject.toml").read_text()
    )
    modules = {str(path.relative_to(root)) for path in (root / "serd_core").rglob("*.py")}
    assert modules | {"serd_core/__init__.pyi", "serd_core/py.typed"} <= names
