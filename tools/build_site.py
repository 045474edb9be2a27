"""Copy documents, and files that they link to, into the folder that MkDocs reads.

Paths stay those of the repository, so that links hold in both. The README alone is overview.md: the
front page is theme/index.md. Pages of commands, of Python modules and of pictures are generated.
"""

import os
import re
import shutil
import subprocess
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from typer.cli import get_docs_for_click
from typer.main import get_command

from serd_cli.app import COMMANDS, command_named, make_app

ROOT = Path(__file__).resolve().parents[1]
SOURCE = ROOT / ".cache" / "site_source"
THEME = ROOT / "tools" / "theme"
README = "overview.md"  #: on the site
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


def documents() -> dict[str, str]:
    """By path on the site: the text of each tracked page and notebook, the README first."""
    words = ["git", "ls-files", "-z", "*.md", "*.ipynb"]
    names = subprocess.check_output(words, cwd=ROOT, text=True).split("\0")
    pages = {README: ""}
    for name in (name for name in names if (ROOT / name).is_file()):
        if not (ROOT / name).is_relative_to(THEME):
            readme = f"]({'../' * name.count('/')}README.md"
            text = (ROOT / name).read_text(encoding="utf-8")
            path = README if name == "README.md" else name
            pages[path] = text.replace(readme, readme.replace("README.md", README))
    return pages


def gallery(pages: Mapping[str, str]) -> str:
    """Each picture once, with its text as a link to its page (the README if no other has it)."""
    shown: dict[str, tuple[str, str]] = {}
    for page, text in pages.items():
        for words, target in re.findall(r"!\[([^\]]+)\]\(([^)\s]+\.(?:png|gif))\)", text):
            path = os.path.normpath(Path(page).parent / target)
            if shown.get(path, (README, ""))[0] == README:
                shown[path] = page, words[0].upper() + words[1:]
    rows = (f"- [![]({path}) {words}]({page})\n" for path, (page, words) in shown.items())
    return f'# Gallery\n\n<div class="gallery" markdown>\n\n{"".join(rows)}\n</div>\n'


def linked_files(pages: Mapping[str, str]) -> set[Path]:
    """Of the repository, pages apart, what the pages link to."""
    links = {
        Path(os.path.normpath(Path(page).parent / target))
        for page, text in pages.items()
        for target in re.findall(r"\]\(([^)\s#]+)", text)
    }
    return {path for path in links if (ROOT / path).is_file() and str(path) not in pages}


if __name__ == "__main__":
    os.environ["COLUMNS"] = "100"
    shutil.rmtree(SOURCE, ignore_errors=True)
    pages = documents()
    for path in linked_files(pages):
        (SOURCE / path).parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(ROOT / path, SOURCE / path)
    generated = {"gallery.md": gallery(pages), "reference/commands.md": commands_page()}
    for name, text in {**pages, **generated, **module_pages()}.items():
        (SOURCE / name).parent.mkdir(parents=True, exist_ok=True)
        (SOURCE / name).write_text(text, encoding="utf-8")
    shutil.copytree(THEME, SOURCE, dirs_exist_ok=True)
