"""What `serd watch` starts and prints, and what it refuses before anything starts."""

import json

import pytest

from serd_cli.commands import watch as watch_module
from serd_ros.process.progress import Progress


@pytest.mark.parametrize("as_json", [True, False])
def test_options_become_parameters_of_the_page_whose_address_is_printed(
    serd, monkeypatch, tmp_path, as_json
):
    started = []

    def run_alone(node, command, _, take):
        started.append(" ".join([node, *command]))
        take(Progress(text="of no page"))
        take(Progress(text="", address="http://127.0.0.1:9/"))

    monkeypatch.setattr(watch_module, "run_alone", run_alone)
    token = tmp_path / "here" / "token"
    token.write_text("a-long-random-token\n")
    given = ["--namespace", "robot1", "--port", "9", "--token-file", "token", "--json"]
    ended = serd("watch", *given[: None if as_json else -1])
    assert ended.code == 0, ended.err
    (words,) = started
    for part in ("watch_page ", "__ns:=/robot1", "port:=9", f"token_file:='{token}'"):
        assert part in words
    if as_json:
        assert json.loads(ended.out) == {"url": "http://127.0.0.1:9/"}
    else:
        assert "watch at http://127.0.0.1:9/" in ended.err


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["nowhere"], "nowhere"),
        (["bag"], "beside 'serd watch'"),
        (["--scenario", "hallwy"], "did you mean 'hallway'?"),
        (["--address", "0.0.0.0"], "unless a token is given"),
        (["--token-file", "missing"], "missing"),
        (["--namespace", "1"], "namespace must be letters"),
    ],
)
def test_what_cannot_be_watched_is_refused(serd, arguments, sentence, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "bag").mkdir()
    assert sentence in serd("watch", *arguments).refusal
