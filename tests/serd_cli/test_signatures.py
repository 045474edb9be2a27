"""Commands made from their signatures take and pass on what their functions do."""

import json
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Annotated, Literal

import pytest
import typer
from typer.testing import CliRunner

from serd_cli import signatures
from serd_cli.errors import UsageError


def calls_of(monkeypatch, *, grouped):
    """The app made of a signature, one with the command itself, and the values of their calls."""
    calls = []

    def record_all(
        context: typer.Context,
        bags: Annotated[list[Path], typer.Argument(metavar="BAG")],
        seed: Annotated[int, typer.Option("--seed", "-s", min=1, max=9, help="a seed")] = 3,
        goals: Annotated[list[str] | None, typer.Option("--goal")] = None,
        weights: list[float] = typer.Option((0.5, 2.0)),  # noqa: B008
        output: Annotated[Path, typer.Option()] = Path("x.csv"),
        kind: Annotated[Literal["auto", "hidden"], typer.Option()] = "auto",
        ros: Annotated[bool, typer.Option("--ros")] = False,
        clock: bool = typer.Option(True),
        period_s: float | None = None,
    ) -> None:
        """Records its values.

        Second paragraph.
        """
        calls.append({**locals(), "calls": None, "context": context.args})

    own, group = typer.Typer(), typer.Typer(help="A group.")
    own.callback()(lambda: None)
    more = {"allow_extra_args": True}
    (group if grouped else own).command(no_args_is_help=True, context_settings=more)(record_all)
    if grouped:
        own.add_typer(group, name="record-all")
    module = SimpleNamespace(**({"group": group} if grouped else {"record-all": record_all}))
    monkeypatch.setitem(sys.modules, "serd_cli.commands.stacks.record-all", module)
    monkeypatch.setattr(signatures, "MODULES", {"record-all": "stacks"})
    monkeypatch.setattr(signatures, "_SETTINGS", {"record-all": more})
    known = json.loads(signatures.text_of(signatures.signatures()))
    return signatures.app_of("record-all", known), own, calls


@pytest.mark.parametrize("grouped", [False, True])
@pytest.mark.parametrize(
    "line",
    [
        "a.bag",
        "a b --seed 9 --goal 1,2 --goal 3,4 --weights 7 --kind hidden --ros --no-clock",
        "a --period-s 2.5 --output other -s 1",
    ],
)
def test_the_function_gets_the_values_that_it_gets_from_its_own_app(
    monkeypatch, tmp_path, grouped, line
):
    monkeypatch.chdir(tmp_path)
    for name in ("a.bag", "a", "b"):
        Path(name).touch()
    app, own, calls = calls_of(monkeypatch, grouped=grouped)
    words = ["record-all"] * (2 if grouped else 1) + line.split()
    for each in (app, own):
        result = CliRunner().invoke(each, words, catch_exceptions=False)
        assert result.exit_code == 0, result.output
    assert len(calls) == 2
    assert calls[0] == calls[1]
    assert [*map(type, calls[0].values())] == [*map(type, calls[1].values())]


@pytest.mark.parametrize(
    ("words", "name"),
    [(["a", ""], "BAGS"), (["a", "--output", ""], "--output"), (["a", "--output="], "--output")],
)
def test_an_empty_path_is_refused(monkeypatch, words, name):
    app, _, calls = calls_of(monkeypatch, grouped=False)
    result = CliRunner().invoke(app, ["record-all", *words])
    assert isinstance(result.exception, UsageError)
    assert str(result.exception).startswith(f"{name} must name a file or folder, got an empty text")
    assert CliRunner().invoke(app, ["record-all", ".", "--goal", ""]).exit_code == 0
    assert len(calls) == 1


@pytest.mark.parametrize("line", ["--help", "a --seed 0", "a --kind both", "", "a --goa 1"])
def test_help_and_errors_of_usage_are_those_of_the_function(monkeypatch, line):
    app, own, calls = calls_of(monkeypatch, grouped=False)
    shown = [CliRunner().invoke(each, ["record-all", *line.split()]) for each in (app, own)]
    assert shown[0].output == shown[1].output
    assert shown[0].exit_code == shown[1].exit_code
    assert not calls


def test_a_parameter_of_an_unknown_type_is_refused(monkeypatch):
    def wrong(value: complex) -> None: ...

    module = SimpleNamespace(wrong=wrong)
    monkeypatch.setitem(sys.modules, "serd_cli.commands.stacks.wrong", module)
    monkeypatch.setattr(signatures, "MODULES", {"wrong": "stacks"})
    with pytest.raises(TypeError, match=r"must be one of str, int, .* got <class 'complex'>"):
        signatures.signatures()
