"""The project's documents: links, pictures, files and the version they name exist."""

import re
from pathlib import Path

import pytest

FOLDERS = ("bags", "benchmarks", "docs", "experiments", "ros_ws", "serd_core", "sim")
PICTURES = {".gif", ".png", ".svg"}


def documents(root: Path) -> list[Path]:
    found = [
        *root.glob("*.md"),
        *(path for each in FOLDERS for path in root.glob(f"{each}/**/*.md")),
    ]
    return [path for path in found if not {"build", "install"} & set(path.parts)]


def links(document: Path) -> list[Path]:
    """What its relative links and pictures name."""
    text = document.read_text(encoding="utf-8")
    targets = re.findall(r"\]\(([^)\s]+)\)", text)
    return [
        document.parent / target.split("#")[0]
        for target in targets
        if target.split("#")[0] and not target.startswith(("http://", "https://"))
    ]


def test_links_and_pictures_of_all_documents_exist(root):
    named = {document: links(document) for document in documents(root)}
    assert sum(map(len, named.values())) > 20
    missing = [
        (document.relative_to(root), path)
        for document, paths in named.items()
        for path in paths
        if not path.exists()
    ]
    assert not missing


def test_files_that_documents_name_in_code_exist(root):
    for document in documents(root):
        text = document.read_text(encoding="utf-8")
        for name in re.findall(r"`((?:[\w-]+/)+[\w-]+\.(?:py|md|sh|yaml|xml))`", text):
            folders = (root, document.parent, root / "serd_core", root / "serd_ros")
            assert any((folder / name).exists() for folder in folders), (document.name, name)


@pytest.mark.parametrize("folder", ["docs/pictures"])
def test_no_picture_lies_about_unused(root, folder):
    shown = {path.resolve() for document in documents(root) for path in links(document)}
    pictures = {path.resolve() for path in (root / folder).iterdir() if path.suffix in PICTURES}
    assert pictures <= shown, sorted(path.name for path in pictures - shown)


@pytest.mark.parametrize(
    ("file", "line"),
    [
        ("ros_ws/src/serd_ros/package.xml", r"<version>(.+)</version>"),
        ("ros_ws/src/serd_ros/setup.py", r'version="(.+)"'),
        ("serd_core/__init__.py", r'^__version__ = "(.+)"$'),
        ("CITATION.cff", r"^version: (.+)$"),
        ("CHANGELOG.md", r"^## \[(\d.+)\]"),
    ],
)
def test_the_version_is_the_same_everywhere(root, file, line):
    found = re.search(line, (root / file).read_text(encoding="utf-8"), re.M)
    project = re.search(r'^version = "(.+)"$', (root / "pyproject.toml").read_text(), re.M)
    assert found is not None
    assert project is not None
    assert found[1] == project[1]
