"""`serd watch` is refused before anything starts where it cannot work."""

import pytest


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
    ended = serd("watch", *arguments)
    assert ended.code == 2
    assert sentence in ended.err
