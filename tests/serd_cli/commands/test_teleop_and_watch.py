"""What `serd teleop` and `serd watch` make of their options, show and count."""

import json
import socket

import pytest

from serd_app.errors import TeleopError
from serd_bag.errors import FileError
from serd_cli.commands import launch as watch_module
from serd_cli.commands.teleop import TeleopSettings, driver_lines, require_page
from serd_cli.errors import UsageError
from serd_cli.options import free_folder
from serd_cli.processes.workspace import stack_processes
from serd_ros.graph.graph import find_stack
from serd_ros.process.progress import VARIABLE, Progress, report_address


def test_options_become_parameters_of_the_nodes(tmp_path, ros_env):
    stack, bag = find_stack("teleop"), tmp_path / "bag"
    chosen = TeleopSettings(velocity=True, driver="anna", people=5, port=9000)
    commands = {
        process.name: " ".join(process.command)
        for process in stack_processes(stack, chosen.parameters(bag), ros_env)
    }
    for words in ("mode:='velocity'", "driver:='anna'", "port:=9000"):
        assert words in commands["teleop_page"]
    assert "people:=5" in commands["hallway_sim"]
    assert f"output:='{bag}'" in commands["demo_recorder"]
    assert "-r cmd_vel_raw:=cmd_vel_planner" in commands["local_planner"]


def test_a_page_needs_a_free_port_and_beyond_loopback_a_token(tmp_path):
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        with pytest.raises(UsageError, match=f"port {port}: .*in use; choose another with --port"):
            require_page(TeleopSettings(port=port))
    require_page(TeleopSettings(port=port))
    with pytest.raises(TeleopError, match="unless a token is given"):
        require_page(TeleopSettings(address="0.0.0.0", port=0))
    token = tmp_path / "token"
    token.write_text("a-long-random-token\n")
    require_page(TeleopSettings(address="0.0.0.0", port=0, token_file=str(token)))


def test_every_run_gets_a_folder_of_its_own(tmp_path):
    assert free_folder(tmp_path / "out", "session").name == "session-1"
    assert free_folder(tmp_path / "out", "session").name == "session-2"
    (tmp_path / "link").symlink_to("nothing")
    with pytest.raises(FileError, match="a file of this name is in the way"):
        free_folder(tmp_path / "link", "session")


def test_the_driver_sees_its_own_lines_and_everything_goes_into_the_log(
    tmp_path, capsys, monkeypatch
):
    monkeypatch.setenv(VARIABLE, "1")
    prefix = "[INFO] [1795249906.32] [teleop_page]: "
    with driver_lines(tmp_path / "logs" / "nodes.log") as take:
        report_address("http://127.0.0.1:9/", print)
        take("teleop_page", capsys.readouterr().err.strip())
        take("teleop_page", prefix + "episode 1 arrived")
        take("hallway_sim", "[INFO] [1.0] [hallway_sim]: nothing of interest")
        take("teleop_mux", "[WARN] [1.0] [teleop_mux]: E-STOP engaged")
        take("teleop_page", "[FATAL] [1.0] [teleop_page]: Exception in 'timers' callback")
        take("teleop_page", "  File x.py, line 3")
    printed = capsys.readouterr().err
    assert "drive at http://127.0.0.1:9/" in printed
    assert printed.count("episode 1 arrived") == 1
    assert "E-STOP engaged" in printed
    for hidden in ("nothing of interest", "Exception", "x.py"):
        assert hidden not in printed
    assert len((tmp_path / "logs" / "nodes.log").read_text().splitlines()) == 6


@pytest.mark.parametrize("as_json", [True, False])
def test_options_of_watch_become_parameters_of_the_page_whose_address_is_printed(
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
