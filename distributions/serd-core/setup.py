"""The package `serd_core`, from the root of the repository."""

import re
from pathlib import Path

from setuptools import find_packages, setup

ROOT = Path("../..")

(version,) = re.findall(r'^version = "(.+)"$', (ROOT / "pyproject.toml").read_text(), re.MULTILINE)
setup(
    version=version,
    package_dir={"": str(ROOT)},
    packages=find_packages(str(ROOT), include=["serd_core", "serd_core.*"]),
    package_data={"serd_core": ["py.typed", "*.pyi"]},
)
