"""The command itself: help without imports, version, completion, closed pipes, options."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
import typer
from typer.testing import CliRunner

from serd_app.learning.settings import LearningSettings
from serd_cli.app import COMMANDS, command_named
from serd_cli.errors import UsageError
from serd_cli.options import validated, with_settings
from serd_cli.output import terminal
from serd_core import __version__
from serd_ros.graph.graph import load_graph
from serd_ros.process.executable import starting
from support.waiting import PATIENCE_S

#: Libraries that the overview needs not, and those that no help needs.
HEAVY = ("numpy", "scipy", "pandas", "matplotlib", "pybullet", "rclpy", "PIL", "mcap", "joblib")
HEAVIEST = ("pandas", "matplotlib", "pybullet", "rclpy", "joblib")


def all_commands():
    """Each command by its words, as `bag info`."""
    found = {}
    for name in COMMANDS:
        command = command_named(name)
        parts = getattr(command, "commands", {"": command})
        found |= {f"{name} {part}".strip(): each for part, each in parts.items()}
    return found


IMPORTING = """
import sys
from serd_cli.main import main
libraries = sys.argv[1:]
for line in sys.stdin.read().split("\\n"):
    sys.argv[1:] = line.split()
    try: main()
    except SystemExit: pass
    print(line, [name for name in libraries if name in sys.modules], file=sys.stderr)
"""


def importing(lines, libraries):
    """Those of the command lines, run in one process, by which a library was imported."""
    words = [sys.executable, "-c", IMPORTING, *libraries]
    done = subprocess.run(words, input="\n".join(lines), capture_output=True, text=True)
    return [line for line in lines if f"{line} []" not in done.stderr.splitlines()]


def test_the_overview_and_a_missing_table_import_no_library():
    assert importing(["", "-h", "--version", "bagg", "learn nowhere.csv"], HEAVY) == []


def test_helps_errors_of_usage_and_missing_inputs_import_no_large_library():
    commands = all_commands()
    assert len(commands) > 20
    lines = [f"{words} --help" for words in commands]
    lines += [f"{words} --misspelt" for words in commands if words != "run"]
    lines += [
        f"demos {__file__} --mapping nowhere.yaml",
        f"report {__file__} --demonstrations nowhere.csv",
        f"report {__file__} --episodes nowhere.csv",
        f"navigate {__file__} --scenario hallwy",
        "scenario show nowhere.yaml",
        "scenario film hallwy --output picture.png",
        "batch --scenario hallwy --output runs.csv",
        "demo --scenario hallwy",
    ]
    assert importing(lines, HEAVIEST) == []


def test_the_overview_fits_a_screen_with_whole_sentences(serd, monkeypatch):
    assert serd("--version").out == f"serd {__version__}\n"
    monkeypatch.setenv("COLUMNS", "80")
    for words in ([], ["bag"], ["scenario"]):
        shown = serd(*words, "--help").out
        assert 10 < len(shown.splitlines()) <= 40
        assert "…" not in shown
        assert all(f"{about} " in shown for about in (COMMANDS.values() if not words else ()))


def test_without_a_name_the_stacks_and_the_nodes_are_listed(serd):
    graph = load_graph()
    for command, names in (("launch", graph.stacks), ("run", graph.nodes)):
        assert all(name in serd(command).out for name in names)


def test_each_module_of_commands_defines_the_command_of_its_name(root):
    files = (root / "serd_cli" / "commands").glob("[!_]*.py")
    assert {path.stem for path in files} == set(COMMANDS) - {"run", "watch"}


def test_each_command_prints_its_result_as_json_on_request():
    for words, command in all_commands().items():
        if words in ("run", "bag play", "bag cat"):
            continue  # a node takes the place of the process; cat prints lines of JSON
        assert "--json" in [opt for each in command.params for opt in each.opts], words


def serd_process(words, stdout=subprocess.PIPE, **options):
    program = "import sys; from serd_cli.main import main; sys.argv[0] = 'serd'; sys.exit(main())"
    words = [sys.executable, "-c", program, *words.split()]
    return subprocess.run(words, stdout=stdout, stderr=subprocess.PIPE, text=True, **options)


@pytest.mark.parametrize(
    ("line", "number", "word"), [("serd na", 1, "navigate"), ("serd demos --", 2, "--scenario")]
)
def test_a_line_is_completed_by_commands_and_by_their_options(line, number, word):
    words = {"_SERD_COMPLETE": "complete_bash", "COMP_WORDS": line, "COMP_CWORD": str(number)}
    assert word in serd_process("", env={**os.environ, **words}).stdout.split()


@pytest.mark.parametrize(
    ("words", "unbuffered", "code"),
    [("scenario list --json", "", 0), ("--help", "1", 0), ("bag info none", "1", 2)],
)
def test_a_reader_that_ends_early_changes_no_exit_code(words, unbuffered, code):
    reader, writer = os.pipe()
    os.close(reader)
    environment = {**os.environ, "PYTHONUNBUFFERED": unbuffered}
    done = serd_process(words, stdout=writer, env=environment)
    os.close(writer)
    assert done.returncode == code, done.stderr
    assert (done.stderr == "") == (code == 0)


@pytest.mark.parametrize("words", ["--version", "scenario list"])
def test_a_full_disk_under_the_output_gets_a_sentence(words):
    with Path("/dev/full").open("w") as full:
        done = serd_process(words, stdout=full)
    assert done.returncode == 2
    sentence = "the disk is full; free some space or choose another folder"
    assert done.stderr == f"serd: cannot write the output: {sentence}\n"


def app_with(given):
    app = typer.Typer()

    @app.command()
    @with_settings(LearningSettings, prior_weights="--prior-weight")
    def command(output: str = "here", seed: int = 7, **options):
        given.update(options, output=output, seed=seed)

    return app


def test_every_setting_is_an_option_with_its_default_and_those_of_lists_are_repeated():
    given = {}
    assert CliRunner().invoke(app_with(given), []).exit_code == 0
    assert (given.pop("output"), given.pop("seed")) == ("here", 7)
    assert given.keys() == LearningSettings.model_fields.keys() - {"seed"}
    assert validated(LearningSettings, **given) == LearningSettings()
    with pytest.raises(UsageError, match="discount must be less than 1, got 1"):
        validated(LearningSettings, discount=1.0)
    line = ["--prior-weight", "2", "--prior-weight", "3", "--reward-deviation", "5"]
    assert CliRunner().invoke(app_with(given), line).exit_code == 0
    assert (given["prior_weights"], given["reward_deviation"]) == ([2.0, 3.0], 5.0)


def test_progress_without_a_terminal_is_a_line_every_half_minute_and_else_a_bar(
    monkeypatch, capsys
):
    now_s = [100.0]
    monkeypatch.setattr(terminal.time, "monotonic", lambda: now_s[0])
    bar = terminal.WorkProgress("{task.description} {task.completed} of {task.total}")
    with bar:
        task = bar.add_task("episodes", total=9)
        for done in range(1, 7):
            now_s[0] += 11.0
            bar.update(task, completed=done)
        lines = map(str.strip, capsys.readouterr().err.splitlines())
    assert list(filter(None, lines)) == ["episodes 3 of 9", "episodes 6 of 9"]
    capsys.readouterr()
    monkeypatch.setattr(terminal.progress_console, "_force_terminal", True)
    now_s[0] += 60.0
    bar.update(task, completed=7)
    assert capsys.readouterr().err == ""


#: Takes the place of a library, so that its import is under way for long. A signal just before one
#: long sleep would be handled after it.
_SLOW = "import time\nprint('importing', flush=True)\nwhile True:\n    time.sleep(0.01)\n"


@pytest.mark.parametrize(
    ("library", "words"),
    [
        ("typer", ["serd_cli.main", "--help"]),
        ("rclpy", ["serd_ros.process.executable", "hallway_sim"]),
    ],
)
def test_ctrl_c_during_an_import_ends_quietly_and_is_then_what_it_was_before(
    root, tmp_path, library, words
):
    (tmp_path / f"{library}.py").write_text(_SLOW)
    path = f"{tmp_path}{os.pathsep}{os.getenv('PYTHONPATH', root)}"
    words, pipe = [sys.executable, "-m", *words], subprocess.PIPE
    environment = {**os.environ, "PYTHONPATH": path}
    with subprocess.Popen(words, env=environment, stdout=pipe, stderr=pipe, text=True) as process:
        assert process.stdout.readline() == "importing\n"
        process.send_signal(signal.SIGINT)
        _, errors = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 130
    assert errors == ""
    before = signal.getsignal(signal.SIGINT)
    with starting():
        assert signal.getsignal(signal.SIGINT) is not before
    assert signal.getsignal(signal.SIGINT) is before
