"""Parameters on the command line: ROS values, or one sentence."""

import pytest

from serd_bag.errors import FileError
from serd_cli.errors import UsageError
from serd_cli.processes.node_commands import parse_assignment


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("seed:=3", 3),
        ("rate:=1e-3", 1e-3),
        ("gui:=false", False),
        ("topics:=[odom, '/imu:sensor_msgs/msg/Imu']", ["odom", "/imu:sensor_msgs/msg/Imu"]),
        ("goal:=''", ""),
        ("time:=1:30", "1:30"),
    ],
)
def test_an_assignment_gives_the_name_and_the_value(text, value):
    assert parse_assignment(text) == (text.partition(":=")[0], value)


@pytest.mark.parametrize(
    "text", ["seed:=!!float ''", "seed:=[1", "seed:=!!timestamp x", "seed:=*a", "seed:='"]
)
def test_what_is_no_yaml_is_refused_with_the_name(text):
    with pytest.raises(FileError, match=r"parameter 'seed'.* not valid YAML"):
        parse_assignment(text)


@pytest.mark.parametrize(
    "text",
    ["seed:={a: 1}", "seed:=[[1]]", "seed:=null", "seed:=", 'seed:="a\\0"', f"seed:={2**63}"],
)
def test_what_no_parameter_can_hold_is_refused(text):
    with pytest.raises(UsageError, match="'seed' must be true or false, a 64-bit number"):
        parse_assignment(text)


@pytest.mark.parametrize("text", ["seed", ":=3", "seed=3"])
def test_what_is_no_assignment_is_refused(text):
    with pytest.raises(UsageError, match="must be written name:=value"):
        parse_assignment(text)
