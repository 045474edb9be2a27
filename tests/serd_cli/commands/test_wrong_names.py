"""`serd run`, `launch`, `demo` and `teleop` with names that are none, before anything starts."""

import pytest


@pytest.fixture
def in_domain(serd, ros_env, monkeypatch):
    """`serd` in a ROS domain of this test's own."""
    for name, value in ros_env.items():
        monkeypatch.setenv(name, value)
    return serd


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (("run", "serd_rso", "hallway_sim"), "did you mean 'serd_ros'?"),
        (("run", "serd_ros", "halway_sim"), "did you mean 'hallway_sim'?"),
        (("launch", "demonstrat"), "did you mean 'demonstrate'?"),
        (("launch", "live", "sede:=3"), "did you mean 'seed'?"),
        (("launch", "live", "seed=3"), "must be written name:=value"),
        (("demo", "--scenario", "hallwy"), "did you mean 'hallway'?"),
        (("demo", "--resume", "."), "is no demo run"),
    ],
)
def test_a_wrong_name_exits_with_2_and_a_suggestion(in_domain, arguments, sentence):
    refusal = in_domain(*arguments).refusal
    assert sentence in refusal
    assert "Traceback" not in refusal


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (("--scenario", "hallwy"), "did you mean 'hallway'?"),
        (("--address", "0.0.0.0"), "unless a token is given"),
        (("--no-page",), "the page of serd teleop has the keys"),
        (("--token-file", "nowhere"), "nowhere"),
        (("--velocty",), "--velocity"),
    ],
)
def test_what_teleop_cannot_do_exits_with_2_and_makes_no_folder(
    in_domain, arguments, sentence, tmp_path
):
    refusal = in_domain("teleop", *arguments).refusal
    assert sentence in refusal
    assert "Traceback" not in refusal
    assert list((tmp_path / "here").glob("teleop_output/*")) == []
