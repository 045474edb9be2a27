"""What is read of a URDF, and the sentence for one that cannot drive or has links out of place."""

import pytest
from scipy.spatial.transform import Rotation

from serd_files.errors import USER_ERRORS
from serd_sim.robot.urdf import BUILTIN_URDF, link_transforms, read_differential_drive
from serd_sim.world.command import Command
from serd_sim.world.world import HallwayWorld
from support.wheeled_robots import physical, urdf_with

LEFT = '<origin xyz="0 0.16 0.08"/>\n    <axis xyz="0 1 0"/>'


def speed_and_turn(path):
    """Of a robot that is to drive straight on at 0.3 m/s for a second."""
    with HallwayWorld(physical(urdf=str(path)), seed=1) as world:
        before = world.reset(0)
        for _ in range(20):
            seen = world.step(Command(0.3, 0.0))
    return seen.speed_mps, seen.yaw_rad - before.yaw_rad


def test_a_frame_that_is_turned_and_an_axis_that_points_back_are_the_same_drive(tmp_path):
    """The left joint is rolled by -90 degrees, so that its z is y; the right axis is -y."""
    path = urdf_with(
        tmp_path,
        (LEFT, '<origin xyz="0 0.16 0.08" rpy="-1.5707963267948966 0 0"/><axis xyz="0 0 1"/>'),
        (LEFT.replace("0.16", "-0.16"), LEFT.replace("0.16", "-0.16").replace("0 1 0", "0 -1 0")),
    )
    drive = read_differential_drive(path)
    assert drive.turns_forward == (1.0, -1.0)
    assert drive.separation_m == pytest.approx(0.32)
    assert speed_and_turn(path) == pytest.approx((0.3, 0.0), abs=0.01)


def above_the_base(origin):
    """A change of the URDF: a link without mass from which the base hangs."""
    base = '<link name="base_link">'
    parents = '<parent link="foot"/><child link="base_link"/>'
    return (
        base,
        f'<link name="foot"/><joint name="foot" type="fixed">{parents}{origin}</joint>{base}',
    )


def test_links_without_mass_are_frames_and_joints_between_count(tmp_path):
    """The foot is 0.01 m behind the base and 0.1 m above it; the wheel is where it was."""
    path = urdf_with(tmp_path, above_the_base('<origin xyz="0.01 0 -0.1"/>'))
    drive = read_differential_drive(path)
    assert drive.massless == {"foot"}
    assert drive.axle_height_m == pytest.approx(-0.02)
    assert speed_and_turn(path) == pytest.approx((0.3, 0.0), abs=0.01)


WHEEL = '<link name="left_wheel">'


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('"left_wheel_joint"', '"left_weel_joint"', "must have the wheel joint 'left_wheel_joint'"),
        ('<mass value="16"/>', '<mass value="0"/>', "mass of link 'base_link' must be above 0"),
        ('ixx="0.29" ixy="0"', 'ixx="0.29" ixy="0.3"', "'base_link' must be positive definite"),
        ('xyz="0 0.16 0.08"', 'xyz="0.02 0.16 0.08"', "their centres are 0.02"),
        (LEFT, LEFT.replace("0 1 0", "0.1 1 0"), "an axis differs by 0.1"),
        (LEFT, LEFT.replace("0.16", "-0.17"), "the left wheel must be at the larger y"),
        ('name="left_wheel_joint" type="continuous"', 'name="left_wheel_joint" type="fixed"',
         "must be continuous, got fixed"),
        ('<sphere radius="0.08"/>', '<sphere radius="${r}"/>', r"number above 0, got '\$\{r\}'"),
        ('<collision><geometry><sphere radius="0.08"/></geometry></collision>', "",
         "'left_wheel' must have <collision>, got none"),
        ('version="1.0"', 'version="1.0" encoding="none"', "is not: unknown encoding: none"),
        ("<robot", "<robot <", "must be a URDF in XML"),
        ("robot", "model", "must have the root element <robot>, got <model>"),
        (WHEEL, '<link name="alone"/>' + WHEEL, "one tree, got the roots alone, base_link"),
        ('<child link="right_wheel"/>', '<child link="left_wheel"/>', "joints make one tree"),
        ('xyz="0.2 0 0.031"', 'xyz="0.2 0"', "origin of joint 'front_caster_joint' must be three"),
        ('xyz="0.2 0 0.031"', 'xyz="0 0 0" rpy="inf 0 0"', "must be three finite numbers"),
    ],
)  # fmt: skip
def test_a_urdf_that_cannot_drive_is_refused_in_one_sentence(tmp_path, old, new, message):
    def read(path):
        return physical(urdf=path), link_transforms(path, "base_link")

    with pytest.raises(ValueError, match=message):
        read(str(urdf_with(tmp_path, (old, new))))


def test_wheels_of_an_unknown_shape_need_their_radius_as_a_key(tmp_path):
    box = '<box size="0.16 0.04 0.16"/>'
    path = urdf_with(
        tmp_path, ('<sphere radius="0.08"/>', box), ('<cylinder radius="0.08" length="0.05"/>', box)
    )
    with pytest.raises(ValueError, match="wheel_radius_m must be given"):
        physical(urdf=str(path))
    assert physical(urdf=str(path), wheel_radius_m=0.08).robot.wheel_radius_m == 0.08


CYLINDER = '<cylinder radius="0.25" length="0.17"/>'


@pytest.mark.parametrize(
    ("shape", "message"),
    [
        (CYLINDER.replace("0.25", "0.31"), r"radius_m must cover the robot .* extends 0\.31"),
        ('<mesh filename="none.stl"/>', r"must load in PyBullet, .* no none\.stl; add it"),
    ],
)
def test_a_shape_that_no_world_can_hold_is_refused(tmp_path, shape, message):
    path = urdf_with(tmp_path, (CYLINDER, shape))
    with pytest.raises(USER_ERRORS, match=message):
        HallwayWorld(physical(urdf=str(path)), seed=1)


def test_links_hang_from_the_base_or_the_root_as_their_joints_have_them(tmp_path):
    links = link_transforms(BUILTIN_URDF, "base_link")
    found = {child: placed for parent, child, placed in links if parent == "base_link"}
    assert found.keys() == {"left_wheel", "right_wheel", "front_caster", "rear_caster"}
    assert found["left_wheel"][0] == pytest.approx([0.0, 0.16, 0.08])
    assert found["rear_caster"][0] == pytest.approx([-0.2, 0.0, 0.031])
    root, *links = link_transforms(urdf_with(tmp_path, ('"base_link"', '"chassis"')), "base_link")
    assert root == ("base_link", "chassis", ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)))
    assert {parent for parent, _, _ in links} == {"chassis"}


def test_a_link_above_the_base_hangs_from_the_base(tmp_path):
    """The base is 0.01 m ahead of the footprint and 0.1 m above it, turned to the left."""
    path = urdf_with(
        tmp_path, above_the_base('<origin xyz="0.01 0 0.1" rpy="0 0 1.5707963267948966"/>')
    )
    (placed,) = [each for _, child, each in link_transforms(path, "base_link") if child == "foot"]
    position, turn = placed
    for point, expected in (((0.01, 0.0, 0.1), (0, 0, 0)), ((0.01, 1.0, 0.1), (1, 0, 0))):
        assert position + Rotation.from_quat(turn).apply(point) == pytest.approx(expected)
