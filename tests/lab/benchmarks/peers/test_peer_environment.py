"""Peers install into separate environments, once; a failure gives its reason."""

import pytest

from lab.benchmarks.peers import peer_environment
from lab.benchmarks.peers.peer_environment import peer_python, run_peer


@pytest.fixture
def peers(tmp_path, monkeypatch):
    """An empty folder of peers, whose environments lie beside it."""
    folder = tmp_path / "peers"
    folder.mkdir()
    monkeypatch.setattr(peer_environment, "PEERS", folder)
    monkeypatch.setattr(peer_environment, "ENVIRONMENTS", tmp_path / "environments")
    return folder


def test_an_environment_is_installed_once_and_again_when_its_requirements_change(peers):
    (peers / "none.txt").write_text("# nothing\n")
    python = peer_python("none")
    made = python.lstat().st_mtime_ns
    assert peer_python("none") == python
    assert python.lstat().st_mtime_ns == made
    (peers / "none.txt").write_text("# nothing else\n")
    assert peer_python("none").lstat().st_mtime_ns > made


def test_scripts_run_there_without_the_project(peers, monkeypatch):
    monkeypatch.setenv("PYTHONPATH", str(peers.parents[1]))
    (peers / "none.txt").write_text("# nothing\n")
    (peers / "write.py").write_text(
        "import os, sys\n"
        "assert 'PYTHONPATH' not in os.environ\n"
        "open(sys.argv[1], 'w').write(sys.prefix)\n"
    )
    run_peer("none", "write.py", peers / "environment.txt")
    assert (peers / "environment.txt").read_text() == str(peer_environment.ENVIRONMENTS / "none")
