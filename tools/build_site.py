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
from serd_core import __version__

ROOT = Path(__file__).resolve().parents[1]
SOURCE = ROOT / ".cache" / "site_source"
THEME = ROOT / "tools" / "theme"
README = "overview.md"  #: on the site


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


def python_pages() -> dict[str, str]:
    """By path: public names of serd_core, modules of serd_bag, and a list of these pages."""
    stub = (ROOT / "serd_core" / "__init__.pyi").read_text(encoding="utf-8")
    contents: dict[str, list[str]] = {}
    for module, name in re.findall(r"from (\S+) import (?:\(\s*)?(\w+) as \2\b", stub):
        contents.setdefault(".".join(module.split(".")[:2]), []).append(f"{module}.{name}")
    for path in sorted((ROOT / "bags" / "serd_bag").rglob("[!_]*.py")):
        folder = ".".join(path.parent.relative_to(ROOT / "bags").parts)
        contents.setdefault(folder, []).append(f"{folder}.{path.stem}")
    pages, index = {}, "# Python\n\n"
    for folder, names in contents.items():
        text = "\n\n".join(f"::: {name}" for name in names)
        pages[f"reference/python/{folder}.md"] = f"# {folder}\n\n{text}\n"
        links = (f"[{name.rsplit('.')[-1]}](python/{folder}.md#{name})" for name in names)
        index += f"- {folder}: {', '.join(links)}\n"
    return {**pages, "reference/python.md": index}


def documents() -> dict[str, str]:
    """By path on the site: the text of each tracked page and notebook, the README first."""
    words = ["git", "ls-files", "-z", "*.md", "*.ipynb"]
    names = subprocess.check_output(words, cwd=ROOT, text=True).split("\0")
    pages = {README: ""}
    for name in (name for name in names if (ROOT / name).is_file()):
        if not (ROOT / name).is_relative_to(THEME):
            path = README if name == "README.md" else name
            pages[path] = (ROOT / name).read_text(encoding="utf-8")
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


def on_config(config: Any) -> None:
    """MkDocs calls this: each page has the version that it documents at its foot."""
    config.copyright = f"SERD {__version__}"


if __name__ == "__main__":
    os.environ["COLUMNS"] = "100"
    shutil.rmtree(SOURCE, ignore_errors=True)
    pages = documents()
    for path in linked_files(pages):
        (SOURCE / path).parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(ROOT / path, SOURCE / path)
    generated = {"gallery.md": gallery(pages), "reference/commands.md": commands_page()}
    for name, text in {**pages, **generated, **python_pages()}.items():
        (SOURCE / name).parent.mkdir(parents=True, exist_ok=True)
        (SOURCE / name).write_text(text, encoding="utf-8")
    shutil.copytree(THEME, SOURCE, dirs_exist_ok=True)
