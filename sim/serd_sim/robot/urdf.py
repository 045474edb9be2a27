"""A URDF: its differential drive (two wheel joints on one axis, bodies with mass) and its links.

Frames are those of the root link at zero joint angles: x forward, y left, z up.
"""

import xml.etree.ElementTree as ET
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from serd_bag.nearest import hint
from serd_core.arrays import FloatArray
from serd_sim.errors import SimError
from serd_sim.robot.quaternion import (
    Quaternion,
    Vector,
    conjugate,
    of_roll_pitch_yaw,
    product,
    rotated,
)

BUILTIN_URDF = Path(__file__).with_name("hallway_robot.urdf")
#: Position and orientation of a frame in another one.
Placed = tuple[Vector, Quaternion]
#: Parent link, child link, and the child's frame in the parent's.
LinkTransform = tuple[str, str, Placed]
_AT_ORIGIN: Placed = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)
_ON_AXIS_M = 1e-3
_ON_AXIS = 1e-3


@dataclass(frozen=True)
class DifferentialDrive:
    """Left value first.

    turns_forward: +1 where a positive joint velocity drives forward, else -1.
    radius_m: of the wheels, None where their geometry is neither a cylinder nor a sphere.
    axle_height_m: of the wheels' centres in the root link's frame.
    friction: coefficient by link, where the URDF has one in `<contact>`.
    massless: links without `<inertial>`.
    """

    path: Path
    wheel_joints: tuple[str, str]
    turns_forward: tuple[float, float]
    radius_m: float | None
    separation_m: float
    axle_height_m: float
    friction: dict[str, float]
    massless: frozenset[str]


def read_differential_drive(
    path: Path, left_joint: str = "left_wheel_joint", right_joint: str = "right_wheel_joint"
) -> DifferentialDrive:
    """The drive of a URDF; SimError where it cannot drive."""
    root = _parsed(path)
    joints = _joints(root)
    links = {each.get("name", ""): each for each in root.findall("link")}
    for name, link in links.items():
        _require_massive(path, name, link)
    wheels = [_wheel_joint(path, joints, name) for name in (left_joint, right_joint)]
    _require_tree(path, links, joints)
    names = [_end(wheel, "child") for wheel in wheels]
    for name in names:
        for part in ("inertial", "collision"):
            if links[name].find(part) is None:
                raise SimError(
                    f"{path}: the wheel link {name!r} must have <{part}>, got none; add it"
                )
    frames = [_frame_in_root(wheel, joints) for wheel in wheels]
    axes = [
        rotated(turn, _vector(wheel.find("axis"), "xyz", "1 0 0"))
        for (_, turn), wheel in zip(frames, wheels, strict=True)
    ]
    left_m, right_m = (position for position, _ in frames)
    _require_one_axis(path, left_m, right_m, axes)
    return DifferentialDrive(
        path=path,
        wheel_joints=(left_joint, right_joint),
        turns_forward=(float(np.sign(axes[0][1])), float(np.sign(axes[1][1]))),
        radius_m=_wheel_radius_m(path, links[names[0]]),
        separation_m=left_m[1] - right_m[1],
        axle_height_m=left_m[2],
        friction={
            name: _friction(path, name, value)
            for name, link in links.items()
            if (value := link.find("contact/lateral_friction")) is not None
        },
        massless=frozenset(name for name in links if links[name].find("inertial") is None),
    )


def link_transforms(path: Path, base: str) -> list[LinkTransform]:
    """One transform per other link, outwards from the link `base`; zero joint angles.

    Joints between the root link and `base` are turned round, so that each link has one parent. The
    root link is at `base` where no link has that name. SimError where links are no tree.
    """
    root = _parsed(path)
    joints = _joints(root)
    by_child = {_end(each, "child"): each for each in joints.values()}
    links = {each.get("name", "") for each in root.findall("link")}
    top = _require_tree(path, links, joints)
    above = list(_chain(by_child[base], by_child)) if base in by_child else []
    found = []
    for joint in joints.values():
        parent, child, placed = _end(joint, "parent"), _end(joint, "child"), _placed(joint)
        if not np.isfinite([*placed[0], *placed[1]]).all():
            raise SimError(
                f"{path}: the origin of joint {joint.get('name')!r} must be three finite numbers"
                " each in xyz and rpy; correct it"
            )
        if joint in above:
            parent, child, placed = child, parent, _inverse(placed)
        found.append((parent, child, placed))
    return found if base in links else [(base, top, _AT_ORIGIN), *found]


def _require_tree(path: Path, links: Collection[str], joints: dict[str, ET.Element]) -> str:
    """The root link of the tree that joints make of the links."""
    by_child = {_end(each, "child"): each for each in joints.values()}
    roots = sorted(set(links) - by_child.keys())
    ends = {_end(each, which) for each in joints.values() for which in ("parent", "child")}
    if len(roots) != 1 or len(by_child) < len(joints) or not ends <= set(links):
        raise SimError(
            f"{path} must have links that joints make one tree, got the roots"
            f" {', '.join(roots) or 'none'} and {len(joints)} joints for {len(links)} links; repair"
            " it"
        )
    return roots[0]


def _joints(root: ET.Element) -> dict[str, ET.Element]:
    """Joints by name; those of transmissions have no child."""
    return {
        each.get("name", ""): each for each in root.iter("joint") if each.find("child") is not None
    }


def _parsed(path: Path) -> ET.Element:
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
    return root


def _wheel_joint(path: Path, joints: dict[str, ET.Element], name: str) -> ET.Element:
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
    if not (np.isfinite(mass_kg) and mass_kg > 0.0):
        raise SimError(
            f"{path}: the mass of link {name!r} must be above 0, got {mass_kg:g}; set it"
        )
    entries = {
        key: float(_numbers(inertial.find("inertia"), key, "0")[0])
        for key in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    }
    xx, xy, xz, yy, yz, zz = entries.values()
    matrix = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    if not np.isfinite(matrix).all() or np.linalg.eigvalsh(matrix)[0] <= 0.0:
        text = ", ".join(f"{key} {value:g}" for key, value in entries.items())
        raise SimError(
            f"{path}: the inertia of link {name!r} must be positive definite, got {text}"
            "; correct it"
        )


def _require_one_axis(path: Path, left_m: Vector, right_m: Vector, axes: Sequence[Vector]) -> None:
    """Both wheels turn about one line along y, the left one further left."""
    across = np.subtract(left_m, right_m)
    off_axis_m = float(np.hypot(across[0], across[2]))
    askew = max(float(np.hypot(np.hypot(axis[0], axis[2]), abs(axis[1]) - 1.0)) for axis in axes)
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


def _frame_in_root(joint: ET.Element, joints: dict[str, ET.Element]) -> Placed:
    """A joint's frame in the root link's."""
    by_child = {_end(each, "child"): each for each in joints.values()}
    position, turn = _AT_ORIGIN
    for each in _chain(joint, by_child):
        origin, outer = _placed(each)
        x, y, z = rotated(outer, position)
        position = origin[0] + x, origin[1] + y, origin[2] + z
        turn = product(outer, turn)
    return position, turn


def _placed(joint: ET.Element) -> Placed:
    """A joint's frame in its parent link's."""
    origin = joint.find("origin")
    turn = of_roll_pitch_yaw(*_vector(origin, "rpy", "0 0 0"))
    return _vector(origin, "xyz", "0 0 0"), turn


def _inverse(placed: Placed) -> Placed:
    """The outer frame in the inner one."""
    back = conjugate(placed[1])
    x, y, z = rotated(back, placed[0])
    return (-x, -y, -z), back


def _chain(joint: ET.Element, by_child: dict[str, ET.Element]) -> Iterator[ET.Element]:
    """The joint and those between it and the root link."""
    seen: ET.Element | None = joint
    for _ in range(len(by_child)):
        if seen is None:
            return
        yield seen
        seen = by_child.get(_end(seen, "parent"))


def _wheel_radius_m(path: Path, link: ET.Element) -> float | None:
    for geometry in ("collision", "visual"):
        for shape in ("sphere", "cylinder"):
            found = link.find(f"{geometry}/geometry/{shape}")
            if found is not None:
                radius_m = float(_numbers(found, "radius", "nan")[0])
                if not radius_m > 0.0:
                    raise SimError(
                        f"{path}: the radius of the wheel {link.get('name')!r} must be a number"
                        f" above 0, got {found.get('radius')!r}; set it"
                    )
                return radius_m
    return None


def _friction(path: Path, name: str, element: ET.Element) -> float:
    friction = float(_numbers(element, "value", "nan")[0])
    if not friction >= 0.0:
        raise SimError(
            f"{path}: the lateral_friction of link {name!r} must be a number from 0 on, got"
            f" {element.get('value')!r}; set it"
        )
    return friction


def _end(joint: ET.Element, which: str) -> str:
    end = joint.find(which)
    return "" if end is None else end.get("link", "")


def _vector(element: ET.Element | None, key: str, default: str) -> Vector:
    x, y, z = _numbers(element, key, default).tolist()
    return x, y, z


def _numbers(element: ET.Element | None, key: str, default: str) -> FloatArray:
    """The numbers of an attribute, as many as of the default; NaN where it holds something else."""
    text = default if element is None else element.get(key, default)
    n_numbers = len(default.split())
    try:
        found = np.array([float(word) for word in text.split()])
    except ValueError:
        found = np.array([])
    sound = len(found) == n_numbers and np.isfinite(found).all()
    return found if sound else np.full(n_numbers, np.nan)
