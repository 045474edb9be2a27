"""What the README shows runs, and what it names exists."""

import re
import shlex

import pytest
from typer.core import TyperGroup
from typer.main import get_command

from serd_cli.app import make_app


@pytest.fixture(scope="module")
def readme(root):
    return (root / "README.md").read_text(encoding="utf-8")


def test_its_python_code_runs(readme, capsys):
    blocks = re.findall(r"```python\n(.*?)```", readme, re.DOTALL)
    assert blocks
    for block in blocks:
        exec(compile(block, "README.md", "exec"), {})
    assert capsys.readouterr().out


def test_its_make_targets_exist(readme, root):
    makefile = (root / "Makefile").read_text()
    named = set(
        re.findall(r"make (\w+)", "\n".join(re.findall(r"```bash\n(.*?)```", readme, re.S)))
    )
    assert named
    for target in named:
        assert re.search(rf"^{target}:", makefile, re.M), target


def test_its_files_and_pictures_exist(readme, root):
    for link in re.findall(r"\]\((?!http)([^)#]+)\)", readme):
        assert (root / link).exists(), link
    rows = re.findall(r"`(serd_core/[\w/.]+\.py)`(?:, `([\w/.]+\.py)`)?", readme)
    assert rows
    for first, second in rows:
        assert (root / first).is_file(), first
        assert not second or (root / "serd_core" / second).is_file(), second


def test_its_serd_commands_have_the_arguments_and_options_shown(readme):
    lines = re.findall(r"^\.venv/bin/serd (.*)$", readme, re.MULTILINE)
    assert len(lines) > 10
    for line in lines:
        words = shlex.split(line, comments=True)
        if "--help" not in words:
            parse(get_command(make_app()), "serd", words)


def parse(command, name, words, parent=None):
    """Parse as the command line does, without running it; its own complaint where it is wrong."""
    context = command.make_context(name, list(words), parent=parent)
    if isinstance(command, TyperGroup):
        inner = command.get_command(context, words[0])
        assert inner is not None, (name, words)
        parse(inner, words[0], words[1:], context)
