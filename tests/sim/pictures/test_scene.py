"""The scene: wheels roll the way that the robot has come, people look where they walk."""

import math
from contextlib import closing

import pytest

from serd_files.errors import USER_ERRORS
from serd_sim.pictures.scene import Camera, Scene
from serd_sim.robot.bullet import pybullet
from serd_sim.scenario.scenario import load_scenario
from support.wheeled_robots import physical, urdf_with

HALLWAY = load_scenario("hallway").with_pedestrian_count(2)


@pytest.fixture
def scene():
    with closing(Scene(HALLWAY)) as made:
        yield made


def wheel_angles(scene):
    joints = tuple(scene._wheels)
    return [state[0] for state in scene.client.getJointStates(scene._robot, joints)]


def headings(scene):
    turns = [scene.client.getBasePositionAndOrientation(body)[1] for body in scene._people]
    return [2.0 * math.atan2(z, w) for _, _, z, w in turns]


def test_wheels_roll_the_way_of_the_robot(scene):
    """Straight on by way / radius; a turn by -+ angle * separation / 2 / radius."""
    scene.place_robot((3.0, 8.0, 0.5))
    scene.place_robot((3.0 + 0.2 * math.cos(0.5), 8.0 + 0.2 * math.sin(0.5), 0.5))
    assert wheel_angles(scene) == pytest.approx([2.5, 2.5])
    scene.place_robot((3.0 + 0.2 * math.cos(0.5), 8.0 + 0.2 * math.sin(0.5), 1.0))
    assert wheel_angles(scene) == pytest.approx([2.5 - 1.0, 2.5 + 1.0])


def test_people_look_where_they_walk_and_keep_the_direction_where_they_stand(scene):
    scene.place_people([[1.0, 5.0], [4.0, 5.0]], [[0.0, 1.0], [-1.0, 0.0]])
    assert headings(scene) == pytest.approx([math.pi / 2, math.pi], abs=1e-6)
    scene.place_people([[1.1, 5.0], [4.0, 5.0]])
    assert headings(scene) == pytest.approx([0.0, math.pi], abs=1e-6)


def test_a_person_and_the_robot_cover_their_places_in_the_picture(scene):
    scene.place_robot((3.0, 8.0, 0.0))
    scene.place_people([[1.5, 8.0], [9.0, 17.0]])
    frame = scene.render(Camera((2.25, 8.0, 0.0), 4.0, pitch_deg=-89.0)).astype(int)
    left, right = frame[:, :320], frame[:, 320:]
    assert (left[..., 0] > left[..., 2] + 60).sum() > 200
    assert (right[..., 2] > right[..., 0] + 60).sum() > 200
    assert (right[..., 0] > right[..., 2] + 60).sum() == 0


def test_the_physical_robot_is_that_of_its_urdf_and_pybullet_stays_off_the_terminal(
    tmp_path, capfd
):
    red = urdf_with(tmp_path, ("0.15 0.35 0.75 1", "0.9 0.1 0.1 1"))
    reddish = []
    for place in (physical(), physical(urdf=str(red))):
        with closing(Scene(place)) as scene:
            scene.place_robot((3.0, 8.0, 0.0))
            frame = scene.render(Camera((3.0, 8.0, 0.2), 1.5)).astype(int)
        reddish.append((frame[..., 0] > frame[..., 2] + 60).sum())
    assert reddish[0] == 0
    assert reddish[1] > 1000
    assert capfd.readouterr() == ("", "")


def test_a_urdf_that_pybullet_rejects_is_an_error(tmp_path):
    path = urdf_with(tmp_path, ('<cylinder radius="0.25" length="0.04"/>',
                                '<mesh filename="none.obj"/>'))  # fmt: skip
    clients = range(50)
    before = [pybullet.getConnectionInfo(each) for each in clients]
    with pytest.raises(USER_ERRORS, match="must load in PyBullet"):
        Scene(physical(urdf=str(path)))
    assert [pybullet.getConnectionInfo(each) for each in clients] == before
