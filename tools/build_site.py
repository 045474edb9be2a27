"""Copy the documents, and all files that they link to, into the folder that MkDocs reads.

Paths stay those of the repository, so that links hold in both. Pages of commands and of Python
modules are generated from the code. A link to a folder leads to its README, or becomes plain text.
"""

import os
import re
import shutil
import sys
from pathlib import Path
from typing import Any

from typer.cli import get_docs_for_click
from typer.main import get_command

from serd_cli.app import COMMANDS, command_named, make_app

ROOT = Path(__file__).resolve().parents[1]
SOURCE = ROOT / ".cache" / "site_source"
#: Packages that are used as libraries, and the folders that they lie in.
LIBRARIES = {"serd_core": ROOT, "serd_bag": ROOT / "bags"}
_PAGES = (".md", ".ipynb")
_LINK = re.compile(r"\[((?:[^\[\]]|\[[^\]]*\])*)\]\((?!\w+:)([^)#\s]+)(#[^)]*)?\)")
#: Style and script of all pages.
_LOOK = Path(__file__).parent / "theme"


def copy_documents(target: Path) -> list[Path]:
    """The documents of the project, relative to its root; what they link to is copied too."""
    pages = [each for kind in _PAGES for each in (ROOT / "docs").rglob(f"*{kind}")]
    waiting = sorted([*ROOT.glob("*.md"), *pages])
    copied: list[Path] = []
    while waiting:
        document = waiting.pop()
        name = document.relative_to(ROOT)
        if (target / name).exists():
            continue
        text = _with_links(document.read_text(encoding="utf-8"), document, waiting, target)
        _write(target / name, text)
        copied.append(name)
    return copied


def _with_links(text: str, document: Path, waiting: list[Path], target: Path) -> str:
    def replaced(match: re.Match[str]) -> str:
        shown, link, anchor = match[1], match[2], match[3] or ""
        shown = _LINK.sub(replaced, shown)  # a picture within a link
        file = (document.parent / link).resolve()
        if file.is_dir():
            if not (file / "README.md").exists():
                return shown
            file, link = file / "README.md", f"{link.rstrip('/')}/README.md"
        if file.suffix in _PAGES:
            waiting.append(file)
        else:
            copy = target / file.relative_to(ROOT)
            copy.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(file, copy)
        return f"[{shown}]({link}{anchor})"

    return _LINK.sub(replaced, text)


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
    pages, index = {}, ["# Python modules", ""]
    for library, beside in LIBRARIES.items():
        found = [beside / library, *sorted((beside / library).rglob("*"))]
        folders = [path for path in found if not {"build", "dist"} & set(path.parts)]
        for folder in (path for path in folders if (path / "__init__.py").exists()):
            dotted = ".".join(folder.relative_to(beside).parts)
            modules = sorted(f"{dotted}.{path.stem}" for path in folder.glob("[!_]*.py"))
            if modules:
                text = "\n\n".join(f"::: {module}" for module in modules)
                pages[f"reference/python/{dotted}.md"] = f"# {dotted}\n\n{text}\n"
                names = ", ".join(module.rpartition(".")[2] for module in modules)
                index.append(f"- [{dotted}](python/{dotted}.md): {names}")
    return {**pages, "reference/python.md": "\n".join(index) + "\n"}


def main() -> int:
    """Entry point; `--quick` leaves the modules out, which take a minute."""
    shutil.rmtree(SOURCE, ignore_errors=True)
    os.environ["COLUMNS"] = "100"
    copied = copy_documents(SOURCE)
    _write(SOURCE / "reference" / "commands.md", commands_page())
    for name, text in module_pages().items():
        _write(SOURCE / name, text if "--quick" not in sys.argv else text.replace(":::", "-"))
    shutil.copytree(_LOOK, SOURCE, dirs_exist_ok=True)
    print(f"{len(copied)} documents in {SOURCE}")
    return 0


def _write(path: Path, text: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    sys.exit(main())
