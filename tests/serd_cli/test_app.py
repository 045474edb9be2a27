"""The command itself: help without imports, version, completion, near names, closed pipes."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from serd_cli.app import COMMANDS, command_named
from serd_core import __version__

#: Libraries that the overview needs not, and those that no help needs.
HEAVY = ("numpy", "scipy", "pandas", "matplotlib", "pybullet", "rclpy", "PIL", "mcap", "joblib")
HEAVIEST = ("pandas", "matplotlib", "pybullet", "rclpy", "joblib")


def serd(*words, stdout=subprocess.PIPE, preexec_fn=None, **environment):
    program = "import sys; from serd_cli.main import main; sys.argv[0] = 'serd'; sys.exit(main())"
    return subprocess.run(
        [sys.executable, "-c", program, *words],
        env={**os.environ, **environment},
        stdout=stdout,
        stderr=subprocess.PIPE,
        preexec_fn=preexec_fn,
        text=True,
        check=False,
    )


def all_commands():
    """Each command by its words, as `bag info`."""
    found = {}
    for name in COMMANDS:
        command = command_named(name)
        parts = getattr(command, "commands", {"": command})
        found |= {f"{name} {part}".strip(): each for part, each in parts.items()}
    return found


def imported(lines, libraries=HEAVY, **environment):
    """Whether one process, which runs several commands, imports none of the libraries by each."""
    program = (
        "import sys\n"
        "from serd_cli.main import main\n"
        f"for line in {list(lines)}:\n"
        "    sys.argv[1:] = line.split()\n"
        "    try: main()\n"
        "    except SystemExit: pass\n"
        f"    print(line, [name for name in {libraries} if name in sys.modules], file=sys.stderr)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", program],
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        check=False,
    )
    return {line: f"{line} []" in done.stderr.splitlines() for line in lines}


def test_the_overview_and_the_version_import_no_library():
    lines = ("", "-h", "--version", "bagg")
    found = imported(lines)
    assert [line for line in lines if not found[line]] == []


def test_helps_and_errors_of_usage_import_no_large_library():
    commands = all_commands()
    assert len(commands) > 20
    lines = [f"{words} --help" for words in commands]
    lines += [f"{words} --misspelt" for words in commands if words != "run"]
    found = imported(lines, HEAVIEST)
    assert [line for line in lines if not found[line]] == []


def test_the_overview_fits_a_screen_with_whole_sentences():
    for words in ([], ["bag"], ["scenario"]):
        shown = serd(*words, "--help", COLUMNS="80").stdout
        assert len(shown.splitlines()) <= 40
        assert "…" not in shown
        assert all(f"{about} " in shown for about in (COMMANDS.values() if not words else ()))


def test_inputs_that_are_not_there_are_refused_before_a_large_library_is_imported():
    lines = (
        "learn nowhere.csv",
        f"demos {__file__} --mapping nowhere.yaml",
        f"report {__file__} --demonstrations nowhere.csv",
        f"report {__file__} --episodes nowhere.csv",
        f"navigate {__file__} --scenario hallwy",
        "scenario show nowhere.yaml",
        "scenario film hallwy --output picture.png",
        "batch --scenario hallwy --output runs.csv",
        "demo --scenario hallwy",
    )
    found = imported(lines, HEAVIEST)
    assert [line for line in lines if not found[line]] == []


def test_a_missing_table_is_refused_before_any_library_is_imported():
    assert imported(["learn nowhere.csv"]) == {"learn nowhere.csv": True}


def test_each_module_of_commands_defines_the_command_of_its_name(root):
    files = (root / "serd_cli" / "commands").glob("[!_]*.py")
    assert {path.stem for path in files} - {"film"} == set(COMMANDS)


def test_each_command_prints_its_result_as_json_on_request():
    for words, command in all_commands().items():
        assert "--json" in [opt for each in command.params for opt in each.opts], words


@pytest.mark.parametrize(
    ("words", "name"),
    [
        (["learn", ""], "TABLE"),
        (["learn", "a", "--output", ""], "--output"),
        (["bag", "info", "a", ""], "BAG"),
        (["bag", "recover", "a", "--output="], "--output"),
    ],
)
def test_an_empty_path_is_refused(words, name):
    done = serd(*words)
    assert done.returncode == 2
    assert f"{name} must name a file or folder, got an empty text; write . for" in done.stderr


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (("bga",), "No such command 'bga'. Did you mean 'bag'?"),
        (("bag", "nfo"), "No such command 'nfo'. Did you mean 'info'?"),
        (("xyz",), "No such command 'xyz'."),
    ],
)
def test_near_names_are_suggested_and_others_are_not(words, sentence):
    done = serd(*words)
    assert done.returncode == 2
    assert f"│ {sentence} " in done.stderr


def test_the_version():
    assert serd("--version").stdout == f"serd {__version__}\n"


def test_completion_offers_subcommands_and_their_options():
    def completed(words, number):
        environment = {"COMP_WORDS": words, "COMP_CWORD": str(number)}
        return serd(_SERD_COMPLETE="complete_bash", **environment).stdout.split()

    assert completed("serd na", 1) == ["navigate"]
    assert "--scenario" in completed("serd demos --", 2)


@pytest.mark.parametrize("unbuffered", ["", "1"])
@pytest.mark.parametrize(
    ("words", "code"),
    [("scenario schema", 0), ("scenario list", 0), ("--help", 0), ("bag info none", 2)],
)
def test_a_reader_that_ends_early_changes_no_exit_code(words, code, unbuffered):
    reader, writer = os.pipe()
    os.close(reader)
    done = serd(*words.split(), stdout=writer, PYTHONUNBUFFERED=unbuffered)
    os.close(writer)
    assert done.returncode == code, done.stderr
    assert (done.stderr == "") == (code == 0)


FULL = Path("/dev/full")


@pytest.mark.skipif(not FULL.exists(), reason="a device that is always full")
@pytest.mark.parametrize(
    "words", ["--help", "--version", "scenario schema", "scenario list", "doctor --help"]
)
def test_a_full_disk_under_the_output_gets_a_sentence(words):
    with FULL.open("w") as full:
        done = serd(*words.split(), stdout=full)
    assert done.returncode == 2
    assert done.stderr == (
        "serd: cannot write the output: the disk is full; free some space or choose another"
        " folder\n"
    )


@pytest.mark.parametrize(
    ("name", "sentence"),
    [
        ("loop", "serd: cannot read loop: Too many levels of symbolic links; check the path and"),
        ("x" * 300, "x: the name is too long; choose a shorter one"),
    ],
)
def test_a_path_that_no_file_can_have_gets_a_sentence(tmp_path, monkeypatch, name, sentence):
    (tmp_path / "loop").symlink_to("loop")
    monkeypatch.chdir(tmp_path)
    for words in (["learn"], ["navigate"], ["bag", "info"]):
        done = serd(*words, name)
        assert done.returncode == 2
        assert sentence in done.stderr or (words[0] == "bag" and "check the path" in done.stderr)


def test_a_closed_output_gets_a_sentence():
    done = serd("scenario", "list", preexec_fn=lambda: os.close(1), stdout=None)
    assert done.returncode == 2
    sentence = "the output must be open, got a closed one; redirect it to /dev/null"
    assert done.stderr == f"serd: {sentence}\n"
