"""Copy documents, and files that they link to, into the folder that MkDocs reads.

Paths stay those of the repository, so that links hold in both. Pages of commands and of Python
modules are generated from the code.
"""

import os
import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

from typer.cli import get_docs_for_click
from typer.main import get_command

from serd_cli.app import COMMANDS, command_named, make_app

ROOT = Path(__file__).resolve().parents[1]
SOURCE = ROOT / ".cache" / "site_source"
_KINDS = ("md", "ipynb", "svg", "png", "gif", "csv", "yaml", "cff")
#: Packages that are used as libraries, and the folders that they lie in.
LIBRARIES = {"serd_core": ROOT, "serd_bag": ROOT / "bags"}


def commands_page() -> str:
    """Every command with its help, its arguments and its options."""
    group: Any = get_command(make_app())
    group.commands = {name: command_named(name) for name in COMMANDS}
    with group.context_class(group, info_name="serd") as context:
        page: str = get_docs_for_click(obj=group, ctx=context, name="serd", title="Commands")
    page = page.replace("* `--help`: Show this message and exit.\n", "")
    page = page.replace("**Options**:\n\n\n", "")  # of a group
    page = page.replace("\n# yaml-", "\n\\# yaml-")  # a line of a help, no heading
    return re.sub(r"(?<=\n\n)(serd .*)(?=\n\n)", r"```bash\n\1\n```", page)


def module_pages() -> dict[str, str]:
    """By path: a page of modules for each folder of the libraries, and the list of pages."""
    pages, index = {}, "# Python modules\n\n"
    for library, beside in LIBRARIES.items():
        for package in sorted((beside / library).rglob("__init__.py")):
            folder = package.parent.relative_to(beside)
            names = sorted(path.stem for path in package.parent.glob("[!_]*.py"))
            if names and not {"build", "dist"} & set(folder.parts):
                dotted = ".".join(folder.parts)
                text = "\n\n".join(f"::: {dotted}.{name}" for name in names)
                pages[f"reference/python/{dotted}.md"] = f"# {dotted}\n\n{text}\n"
                index += f"- [{dotted}](python/{dotted}.md): {', '.join(names)}\n"
    return {**pages, "reference/python.md": index}


if __name__ == "__main__":
    os.environ["COLUMNS"] = "100"
    shutil.rmtree(SOURCE, ignore_errors=True)
    words = ["git", "ls-files", "-z", *(f"*.{kind}" for kind in _KINDS)]
    names = subprocess.check_output(words, cwd=ROOT, text=True).split("\0")
    for name in (name for name in names if (ROOT / name).is_file()):
        (SOURCE / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(ROOT / name, SOURCE / name)
    for name, text in {"reference/commands.md": commands_page(), **module_pages()}.items():
        (SOURCE / name).parent.mkdir(parents=True, exist_ok=True)
        (SOURCE / name).write_text(text, encoding="utf-8")
    shutil.copytree(ROOT / "tools" / "theme", SOURCE, dirs_exist_ok=True)
