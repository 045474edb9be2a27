"""The project's documents: what they link to and name exists, their commands and programs run."""

import re
import shlex
from pathlib import Path

import pytest
from typer.core import TyperGroup
from typer.main import get_command

from lab.__main__ import app_of
from lab.catalogue import NAMES
from serd_bag.writer import BagWriter
from serd_cli import options
from serd_cli.app import make_app

FOLDERS = ("bags", "docs", "examples", "lab", "ros_ws", "serd_core", "sim")
ROOT = Path(__file__).resolve().parents[1]


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


def test_links_and_pictures_of_all_documents_exist_and_each_picture_is_used(root):
    named = {path for document in documents(root) for path in links(document)}
    assert len(named) > 20
    assert not [path for path in named if not path.exists()]
    files = (root / "docs" / "pictures").iterdir()
    pictures = {path for path in files if path.suffix in (".gif", ".png", ".svg")}
    assert not {path.resolve() for path in pictures} - {path.resolve() for path in named}


def test_files_that_documents_name_in_code_exist(root):
    for document in documents(root):
        text = document.read_text(encoding="utf-8")
        for name in re.findall(r"`((?:[\w-]+/)+[\w-]+\.(?:py|md|sh|yaml|xml))`", text):
            folders = (root, document.parent, root / "serd_core", root / "serd_ros")
            assert any((folder / name).exists() for folder in folders), (document.name, name)


#: Pages whose programs are run by tests of their own, or need what is not installed.
RUN_ELSEWHERE = {
    "docs/library.md",
    "serd_core/README.md",
}


PROGRAMS = {
    str(document.relative_to(ROOT))
    for document in documents(ROOT)
    if "```python\n" in document.read_text(encoding="utf-8")
}


@pytest.mark.parametrize("page", sorted(PROGRAMS - RUN_ELSEWHERE))
def test_the_programs_of_a_page_run_and_print_what_it_shows(
    root, page, capsys, tmp_path, monkeypatch
):
    """A block `text` right after a block `python` is its output; there is a bag `drive` to read."""
    monkeypatch.chdir(tmp_path)
    with BagWriter("drive") as writer:
        writer.add_topic("/odom", "nav_msgs/msg/Odometry")
        writer.write("/odom", b"", 1)
    text = (root / page).read_text(encoding="utf-8")
    names: dict[str, object] = {}
    for program, shown in re.findall(r"```python\n(.*?)```\n(?:\n```text\n(.*?)```)?", text, re.S):
        exec(compile(program, page, "exec"), names)
        printed = capsys.readouterr().out
        assert not shown or printed == shown


def test_serd_commands_have_the_arguments_and_options_that_documents_show(root, monkeypatch):
    monkeypatch.setattr(options, "require_readable", lambda _: None)
    group = get_command(make_app())
    n_lines = 0
    for document in documents(root):
        text = document.read_text(encoding="utf-8")
        for block in re.findall(r"```bash\n(.*?)```", text, re.S):
            for line in re.findall(
                r"^(?:\.venv/bin/)?serd (.*)$", block.replace("\\\n", " "), re.M
            ):
                words = shlex.split(line, comments=True)
                n_lines += 1
                if "--help" not in words and "..." not in words:
                    parse(group, "serd", words)
    assert n_lines > 50


def test_commands_of_the_lab_have_the_arguments_and_options_that_documents_show(root):
    lines = {
        line
        for document in documents(root)
        if document.name != "CHANGELOG.md"  # it names what left
        for line in re.findall(
            r"(?:^|`)(?:\.venv/bin/)?python -m lab ([^`\n]*)",
            document.read_text(encoding="utf-8"),
            re.M,
        )
    }
    assert len(lines) > 20
    for line in lines:
        name, *words = shlex.split(line, comments=True) or ["--help"]
        # A name alone may stand for its command in a sentence.
        if words and "--help" not in words and "..." not in words:
            parse(get_command(app_of(name)), name, words)
        else:
            assert name in (*NAMES, "--help", "NAME"), line


def parse(command, name, words, parent=None):
    """Parse as the command line does, without running it; its own error where it is wrong."""
    context = command.make_context(name, list(words), parent=parent)
    if isinstance(command, TyperGroup):
        _, inner, more = command.resolve_command(context, list(words))
        parse(inner, words[0], more, context)


@pytest.mark.parametrize(
    ("file", "line"),
    [
        ("ros_ws/src/serd_ros/package.xml", r"<version>(.+)</version>"),
        ("ros_ws/src/serd_ros/setup.py", r"version='(.+)'"),
        ("ros_ws/src/serd_bringup/package.xml", r"<version>(.+)</version>"),
        ("ros_ws/src/serd_bringup/setup.py", r"version='(.+)'"),
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


def test_the_readme_is_short_and_its_make_targets_exist(root):
    readme, makefile = (root / "README.md").read_text("utf-8"), (root / "Makefile").read_text()
    assert len(readme.split()) <= 710
    blocks = re.findall(r"```bash\n(.*?)```", readme, re.S)
    first = [line.split()[:2] for line in blocks[0].splitlines()]
    assert first == [["make", "demo"], ["make", "test"]]
    for target in re.findall(r"make (\w+)", "\n".join(blocks)):
        assert re.search(rf"^{target}:", makefile, re.M), target
