"""Packages `bags`, and the modules of `storage` and `serd_core` that it imports."""

import re
from pathlib import Path

from setuptools import find_packages, setup
from setuptools.command.build_py import build_py

ROOT = Path("../..")
NEEDED = {
    "storage": {"__init__", "errors", "files", "nearest", "quantities", "standard_output"},
    "serd_core": {"__init__", "arrays", "errors"},
}


class BuildNeeded(build_py):
    """Leaves out the other modules of these packages."""

    def find_package_modules(self, package: str, package_dir: str) -> list[tuple[str, str, str]]:
        """(package, module, file) of each module that is installed."""
        found = super().find_package_modules(package, package_dir)
        return [each for each in found if each[1] in NEEDED.get(package, {each[1]})]


(version,) = re.findall(r'^version = "(.+)"$', (ROOT / "pyproject.toml").read_text(), re.MULTILINE)
setup(
    version=version,
    package_dir={"": str(ROOT)},
    packages=[*find_packages(str(ROOT), include=["bags", "bags.*"]), *NEEDED],
    package_data={"bags": ["py.typed"], "serd_core": ["__init__.pyi"]},
    cmdclass={"build_py": BuildNeeded},
)
