"""A URDF: its differential drive (two wheel joints on one axis, bodies with mass) and its links.

Frames are those of the root link at zero joint angles: x forward, y left, z up. Turns are unit
quaternions (x, y, z, w), in double precision: PyBullet's own functions have single.
"""

import math
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from serd_bag.nearest import hint
from serd_core.arrays import FloatArray
from serd_sim.errors import SimError

Quaternion = tuple[float, float, float, float]
Vector = tuple[float, float, float]
#: Position and orientation of a frame in another one.
Placed = tuple[Vector, Quaternion]
#: Parent link, child link, and the child's frame in the parent's.
LinkTransform = tuple[str, str, Placed]

BUILTIN_URDF = Path(__file__).with_name("hallway_robot.urdf")
_AT_ORIGIN: Placed = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)
#: How far (m) the wheels may be off one axis, and their axes off the direction of y.
_ON_AXIS_M = _ON_AXIS = 1e-3
_INERTIAS = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")


@dataclass(frozen=True)
class DifferentialDrive:
    """Left value first.

    turns_forward: +1 where a positive joint velocity drives forward, else -1.
    radius_m: of the wheels, None where their geometry is neither a cylinder nor a sphere.
    axle_height_m: of the wheels' centres in the root link's frame.
    massless: links without `<inertial>`.
    """

    path: Path
    wheel_joints: tuple[str, str]
    turns_forward: tuple[float, float]
    radius_m: float | None
    separation_m: float
    axle_height_m: float
    massless: frozenset[str]


def read_differential_drive(
    path: Path, left_joint: str = "left_wheel_joint", right_joint: str = "right_wheel_joint"
) -> DifferentialDrive:
    """The drive of a URDF; SimError where it cannot drive."""
    links, joints, by_child = _parsed(path)
    for name, link in links.items():
        _require_massive(path, name, link)
    wheels = [_wheel_joint(path, joints, name) for name in (left_joint, right_joint)]
    _tree_root(path, links, joints)
    names = [_end(wheel, "child") for wheel in wheels]
    for name in names:
        for part in ("inertial", "collision"):
            if links[name].find(part) is None:
                raise SimError(
                    f"{path}: the wheel link {name!r} must have <{part}>, got none; add it"
                )
    frames = [_frame_in_root(wheel, by_child) for wheel in wheels]
    left_axis, right_axis = (
        rotated(turn, _vector(wheel.find("axis"), "xyz", "1 0 0"))
        for (_, turn), wheel in zip(frames, wheels, strict=True)
    )
    left_m, right_m = (position for position, _ in frames)
    _require_one_axis(path, left_m, right_m, (left_axis, right_axis))
    return DifferentialDrive(
        path=path,
        wheel_joints=(left_joint, right_joint),
        turns_forward=(math.copysign(1.0, left_axis[1]), math.copysign(1.0, right_axis[1])),
        radius_m=_wheel_radius_m(path, links[names[0]]),
        separation_m=left_m[1] - right_m[1],
        axle_height_m=left_m[2],
        massless=frozenset(name for name in links if links[name].find("inertial") is None),
    )


def link_transforms(path: Path, base: str) -> list[LinkTransform]:
    """One transform per other link, outwards from the link `base`; zero joint angles.

    Joints between the root link and `base` are turned round, so that each link has one parent. The
    root link is at `base` where no link has that name. SimError where links are no tree.
    """
    links, joints, by_child = _parsed(path)
    top = _tree_root(path, links, joints)
    above = list(_chain(by_child.get(base), by_child))
    found = []
    for joint in joints.values():
        parent, child, placed = _end(joint, "parent"), _end(joint, "child"), _placed(joint)
        if not np.isfinite([*placed[0], *placed[1]]).all():
            raise SimError(
                f"{path}: the origin of joint {joint.get('name')!r} must be three finite numbers"
                " each in xyz and rpy; correct it"
            )
        if joint in above:
            back = conjugate(placed[1])
            x, y, z = rotated(back, placed[0])
            parent, child, placed = child, parent, ((-x, -y, -z), back)
        found.append((parent, child, placed))
    return found if base in links else [(base, top, _AT_ORIGIN), *found]


_Elements = dict[str, ET.Element]


def _parsed(path: Path) -> tuple[_Elements, _Elements, _Elements]:
    """Links and joints by name, joints by child; those of transmissions have no child."""
    try:
        root = ET.parse(path).getroot()
    except OSError as error:
        raise SimError(
            f"urdf must be a file that can be read, got {str(path)!r} ({error.strerror})"
            "; name an existing file"
        ) from None
    except (ET.ParseError, LookupError, ValueError) as error:  # the others: of its encoding
        raise SimError(f"{path} must be a URDF in XML, but it is not: {error}; repair it") from None
    if root.tag != "robot":
        raise SimError(f"{path} must have the root element <robot>, got <{root.tag}>; repair it")
    links = {each.get("name", ""): each for each in root.findall("link")}
    with_child = [each for each in root.iter("joint") if each.find("child") is not None]
    joints = {each.get("name", ""): each for each in with_child}
    return links, joints, {_end(each, "child"): each for each in joints.values()}


def _tree_root(path: Path, links: _Elements, joints: _Elements) -> str:
    """The root link of the tree that joints make of the links; SimError where they make none."""
    children = {_end(each, "child") for each in joints.values()}
    ends = children | {_end(each, "parent") for each in joints.values()}
    roots = sorted(links.keys() - children)
    if len(roots) != 1 or len(children) < len(joints) or not ends <= links.keys():
        raise SimError(
            f"{path} must have links that joints make one tree, got the roots"
            f" {', '.join(roots) or 'none'} and {len(joints)} joints for {len(links)} links; repair"
            " it"
        )
    return roots[0]


def _wheel_joint(path: Path, joints: _Elements, name: str) -> ET.Element:
    if name not in joints:
        raise SimError(
            f"{path} must have the wheel joint {name!r}, but does not; {hint(name, joints)}"
        )
    kind = joints[name].get("type")
    if kind != "continuous":
        raise SimError(
            f"{path}: joint {name!r} of a wheel must be continuous, got {kind}; change it"
        )
    return joints[name]


def _require_massive(path: Path, name: str, link: ET.Element) -> None:
    """Every mass above zero and every inertia positive definite."""
    inertial = link.find("inertial")
    if inertial is None:
        return
    mass_kg = float(_numbers(inertial.find("mass"), "value", "0")[0])
    if not mass_kg > 0.0:
        raise SimError(
            f"{path}: the mass of link {name!r} must be above 0, got {mass_kg:g}; set it"
        )
    inertia = inertial.find("inertia")
    entries = [float(_numbers(inertia, key, "0")[0]) for key in _INERTIAS]
    matrix = np.array(entries)[[[0, 1, 2], [1, 3, 4], [2, 4, 5]]]
    if not np.isfinite(matrix).all() or np.linalg.eigvalsh(matrix)[0] <= 0.0:
        pairs = zip(_INERTIAS, entries, strict=True)
        text = ", ".join(f"{key} {value:g}" for key, value in pairs)
        raise SimError(
            f"{path}: the inertia of link {name!r} must be positive definite, got {text}"
            "; correct it"
        )


def _require_one_axis(path: Path, left_m: Vector, right_m: Vector, axes: Sequence[Vector]) -> None:
    """Both wheels turn about one line along y, the left one further left."""
    across = np.subtract(left_m, right_m)
    off_axis_m = math.hypot(across[0], across[2])
    askew = max(math.hypot(x, z, abs(y) - 1.0) for x, y, z in axes)
    if not (off_axis_m < _ON_AXIS_M and askew < _ON_AXIS):
        raise SimError(
            f"{path}: the wheels must turn about one axis along y, by joint axes of length 1, but "
            f"their centres are {off_axis_m:.3f} m off it and an axis differs by {askew:.3f}"
            "; correct origins and axes of the joints"
        )
    if across[1] <= 0.0:
        raise SimError(
            f"{path}: the left wheel must be at the larger y, got y {left_m[1]:g} m for the left "
            f"and {right_m[1]:g} m for the right one; swap the names"
        )


def _frame_in_root(joint: ET.Element, by_child: _Elements) -> Placed:
    """A joint's frame in the root link's."""
    (x, y, z), turn = _AT_ORIGIN
    for each in _chain(joint, by_child):
        (origin_x, origin_y, origin_z), outer = _placed(each)
        x, y, z = rotated(outer, (x, y, z))
        x, y, z, turn = origin_x + x, origin_y + y, origin_z + z, product(outer, turn)
    return (x, y, z), turn


def _placed(joint: ET.Element) -> Placed:
    """A joint's frame in its parent link's."""
    origin = joint.find("origin")
    turn = of_roll_pitch_yaw(*_vector(origin, "rpy", "0 0 0"))
    return _vector(origin, "xyz", "0 0 0"), turn


def _chain(joint: ET.Element | None, by_child: _Elements) -> Iterator[ET.Element]:
    """The joint and those between it and the root link."""
    for _ in by_child:
        if joint is None:
            return
        yield joint
        joint = by_child.get(_end(joint, "parent"))


def _wheel_radius_m(path: Path, link: ET.Element) -> float | None:
    places = (f"{part}/geometry" for part in ("collision", "visual"))
    shapes = (link.find(f"{place}/{name}") for place in places for name in ("sphere", "cylinder"))
    round_shape = next((each for each in shapes if each is not None), None)
    if round_shape is None:
        return None
    radius_m = float(_numbers(round_shape, "radius", "nan")[0])
    if not radius_m > 0.0:
        raise SimError(
            f"{path}: the radius of the wheel {link.get('name')!r} must be a number above 0, got"
            f" {round_shape.get('radius')!r}; set it"
        )
    return radius_m


def _end(joint: ET.Element, which: str) -> str:
    end = joint.find(which)
    return "" if end is None else end.get("link", "")


def _vector(element: ET.Element | None, key: str, default: str) -> Vector:
    x, y, z = _numbers(element, key, default).tolist()
    return x, y, z


def _numbers(element: ET.Element | None, key: str, default: str) -> FloatArray:
    """The numbers of an attribute, as many as of the default; NaN where it holds something else."""
    n_numbers = len(default.split())
    try:
        found = np.array((default if element is None else element.get(key, default)).split(), float)
    except ValueError:
        found = np.array([])
    sound = len(found) == n_numbers and np.isfinite(found).all()
    return found if sound else np.full(n_numbers, np.nan)


def product(first: Quaternion, second: Quaternion) -> Quaternion:
    """The turn `second`, then `first`."""
    (ax, ay, az, aw), (bx, by, bz, bw) = first, second
    return (
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    )


def conjugate(turn: Quaternion) -> Quaternion:
    """The inverse turn."""
    x, y, z, w = turn
    return -x, -y, -z, w


def rotated(turn: Quaternion, vector: Vector) -> Vector:
    """The vector after the turn."""
    x, y, z, _ = product(product(turn, (*vector, 0.0)), conjugate(turn))
    return x, y, z


def of_roll_pitch_yaw(roll_rad: float, pitch_rad: float, yaw_rad: float) -> Quaternion:
    """The turns about the fixed axes x, y and z, in this order.

    SciPy has it as well, but `scipy.spatial` takes 0.2 s of every node's start to import.
    """
    halves = 0.5 * roll_rad, 0.5 * pitch_rad, 0.5 * yaw_rad
    (x, roll), (y, pitch), (z, yaw) = ((math.sin(half), math.cos(half)) for half in halves)
    return product((0.0, 0.0, z, yaw), product((0.0, y, 0.0, pitch), (x, 0.0, 0.0, roll)))


def yaw_of(turn: Quaternion) -> float:
    """Heading in the plane."""
    x, y, z, w = turn
    return math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
