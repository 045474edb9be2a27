"""Copy the documents, and all files that they link to, into the folder that MkDocs reads.

Paths stay those of the repository, so that links hold in both. Pages of commands and of Python
modules are generated from the code. A link to a folder leads to its README, or becomes plain text.
"""

import os
import re
import shutil
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


def copy_documents(target: Path) -> list[Path]:
    """The documents of the project, relative to its root; what they link to is copied too."""
    pages = [page for kind in _PAGES for page in (ROOT / "docs").rglob(f"*{kind}")]
    waiting = sorted([*ROOT.glob("*.md"), *pages])
    copied: list[Path] = []

    def replaced(match: re.Match[str]) -> str:
        shown, link, anchor = match[1], match[2], match[3] or ""
        shown = _LINK.sub(replaced, shown)  # a picture within a link
        file = (ROOT / copied[-1].parent / link).resolve()
        if file.is_dir():
            if not (file / "README.md").exists():
                return shown
            file, link = file / "README.md", f"{link.rstrip('/')}/README.md"
        waiting.append(file)
        return f"[{shown}]({link}{anchor})"

    while waiting:
        file = waiting.pop()
        name = file.relative_to(ROOT)
        if file.suffix not in _PAGES:
            (target / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(file, target / name)
        elif name not in copied:
            copied.append(name)
            _write(target / name, _LINK.sub(replaced, file.read_text(encoding="utf-8")))
    return copied


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


def main() -> None:
    """Entry point."""
    shutil.rmtree(SOURCE, ignore_errors=True)
    os.environ["COLUMNS"] = "100"
    copied = copy_documents(SOURCE)
    _write(SOURCE / "reference" / "commands.md", commands_page())
    for name, text in module_pages().items():
        _write(SOURCE / name, text)
    shutil.copytree(ROOT / "tools" / "theme", SOURCE, dirs_exist_ok=True)
    print(f"{len(copied)} documents in {SOURCE}")


def _write(path: Path, text: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
