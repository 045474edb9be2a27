"""The README is short and keeps the commands of the set-up, the main job and the tests."""

import re

import pytest


@pytest.fixture(scope="module")
def readme(root):
    return (root / "README.md").read_text(encoding="utf-8")


def test_it_has_at_most_900_words(readme):
    assert len(readme.split()) <= 900


def test_its_first_commands_are_the_main_job_and_the_tests(readme):
    first = re.search(r"```bash\n(.*?)```", readme, re.S)
    assert [line.split()[:2] for line in first[1].splitlines()] == [
        ["make", "demo"],
        ["make", "test"],
    ]


def test_its_make_targets_exist(readme, root):
    makefile = (root / "Makefile").read_text()
    blocks = "\n".join(re.findall(r"```bash\n(.*?)```", readme, re.S))
    named = set(re.findall(r"make (\w+)", blocks))
    assert named
    for target in named:
        assert re.search(rf"^{target}:", makefile, re.M), target
