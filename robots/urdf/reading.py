"""Robots from URDF: kinematics, limits and masses as a model, and the meshes of each body."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError

from robots.arrays import Array
from robots.errors import InputError, raise_any
from robots.frames import rpy_of
from robots.schema.description import Flange, FrameRow, Joint, ModelDescription, Tool
from robots.schema.quantities import AngleRange, Angles, Mass, Position
from robots.schema.units import DIMENSIONS
from robots.urdf.chain import Chain, Tree, find_chain, is_fixed, kinematic_tree, links_below, rigid_group, transform
from robots.urdf.shapes import Primitive, Visual, visuals_of
from robots.urdf.xml import read_urdf_text

__all__ = ["Primitive", "UrdfRobot", "Visual", "read_urdf"]

SOURCE = "urdf"
# Continuous joints have no limits; coordinates need some, and a turn each way holds every pose.
_FULL_TURN_DEG = 360.0
# No arm is that long between two joints; one typed in mm is.
_LONGEST_M = 100.0
# Wider limits than these mean "none".
_WIDEST_rad = DIMENSIONS["angle"].most
# Names that parts of a model have already.
_TAKEN = ("base", "bar", "crank")


@dataclass(frozen=True)
class UrdfRobot:
    """What a URDF says of an arm.

    ``description``: kinematics, limits and the whole mass; no links yet, so all bodies are rigid, and no
    springs. ``visuals``, ``collisions`` and ``masses`` are by body, "base" or a joint's name; a body without
    one is missing there. The frame of a body is that of the URDF link below the joint of its name, and of the
    base that of the base link. ``notes``: what was merged, assumed and left out. ``missing``: by kind of shape, links
    and notes of the mesh files that are not there.
    """

    description: ModelDescription
    visuals: dict[str, tuple[Visual, ...]]
    collisions: dict[str, tuple[Visual, ...]]
    notes: tuple[str, ...]
    masses: dict[str, Mass] = field(default_factory=dict)
    missing: Mapping[str, tuple[tuple[str, str], ...]] = field(default_factory=dict)


def read_urdf(path: str | Path, *, tip: str | None = None, base: str | None = None) -> UrdfRobot:
    """Read the arm of a URDF, from ``base`` to ``tip``; meshes are found, not opened.

    Fixed joints are merged. Past the last revolute joint, a link called tool0 or flange (or the tip, where
    there is none) becomes the flange, and the tip past it the tool point. Joints that are not on the way, as
    those of grippers, are left out with what they carry.

    Parameters
    ----------
    tip : the arm's last link; default: where the most revolute joints lead, on to tool0 or flange
    base : the arm's first link; default: the link that hangs on no other

    Raises
    ------
    InputError
        No URDF, a xacro file, faults of links and joints (all at once), no arm or several to choose from.

    Notes
    -----
    Frames, fixed-axis roll-pitch-yaw angles and axes are as in https://wiki.ros.org/urdf/XML/joint.
    """
    file = Path(path)
    text = read_urdf_text(file)
    tree = kinematic_tree(text.robot, f"URDF {file.name}")
    chain = find_chain(tree, base, tip)
    where = f"{tree.name}: joint"
    raise_any(tree.name, [fault for joint in chain.moving for fault in _faults_of(f"{where} {joint.name}", joint)])
    names, renamed = _safe_names([joint.name for joint in chain.moving])
    bodies = dict(zip(("base", *names), (chain.base, *(j.child for j in chain.moving)), strict=True))
    tool = set() if chain.flange == bodies[names[-1]] else set(links_below(tree, chain.flange))
    groups = {
        body: {name: T for name, T in rigid_group(tree, link).items() if name not in tool}
        for body, link in bodies.items()
    }
    with _quantities_of(tree.name):
        masses = _masses(tree, groups)
    notes = [*text.notes, *renamed, *_notes_of_chain(tree, chain, names, groups, tool)]
    if len(masses) < len(bodies):
        missing = [body for body in bodies if body not in masses]
        notes.append(f"no mass given for {', '.join(missing)}: the whole mass is not known")
    with _quantities_of(tree.name):
        description = ModelDescription(
            schema="stiffarm-model/1",
            name=_safe(text.robot.name),
            title=f"{text.robot.name}, from {file.name}",
            notes=tuple(notes),
            sources={SOURCE: f"{file.name}, SHA-256 {text.sha256}"},
            mass=_mass(sum(mass.si for mass in masses.values())) if len(masses) == len(bodies) else None,
            joint=tuple(_joints(tree, chain, names)),
            flange=Flange(**_pose(_between(tree, bodies[names[-1]], chain.flange))),
            tool=None if chain.tip == chain.flange else Tool(**_pose(_between(tree, chain.flange, chain.tip))),
        )
    visuals, no_visuals = visuals_of(tree, groups, file, "visuals")
    collisions, no_collisions = visuals_of(tree, groups, file, "collisions")
    lost = {"visual": no_visuals, "collision": no_collisions}
    return UrdfRobot(description, visuals, collisions, tuple(notes), masses, lost)


@contextmanager
def _quantities_of(where: str) -> Iterator[None]:
    """Sums over links and joints may be beyond what an arm can have, though each figure is not."""
    try:
        yield
    except ValidationError as error:
        first = error.errors()[0]
        message = str(first["msg"]).removeprefix("Value error, ")
        raise InputError(
            f"{where}: {error.title.lower()} {message}",
            code="R013",
            value=first["input"] if not isinstance(first["input"], dict) else first["input"].get("value"),
            remedy="correct it in the file; URDF has metres, radians and kilograms",
        ) from error


def _faults_of(where: str, joint: Any) -> Iterator[InputError]:
    """Faults of a joint's axis, place and limits; only of joints that are used: a gripper's are its simulator's."""
    if not np.linalg.norm(joint.axis) > 1e-9:
        yield InputError(
            f"{where}: axis",
            code="R013",
            value=joint.axis.tolist(),
            allowed="a direction",
            remedy="correct it in the file",
        )
    length = float(np.linalg.norm(transform(joint)[:3, 3]))
    if not length < _LONGEST_M:
        yield InputError(
            f"{where}: origin",
            code="R013",
            value=f"{length:g} m away from its parent",
            allowed=f"less than {_LONGEST_M:g} m",
            remedy="give lengths in m, as URDF has them",
        )
    if joint.type == "continuous":
        return
    if joint.limit is None or joint.limit.lower is None or joint.limit.upper is None:
        yield InputError(
            f"{where} has no limits",
            code="R013",
            allowed="<limit lower=... upper=... /> in rad",
            remedy="add them, or make the joint continuous where it turns without end",
        )
        return
    lower, upper = joint.limit.lower, joint.limit.upper
    allowed, remedy = "lower < upper", "correct them, or make the joint fixed where it stands still"
    if lower < upper:
        allowed = f"at most {_WIDEST_rad:g} rad in size"
        remedy = "make the joint continuous if it turns without end"
    if not lower < upper or not max(-lower, upper) <= _WIDEST_rad:
        yield InputError(
            f"{where}: limits", code="R013", value=f"{lower:g} to {upper:g} rad", allowed=allowed, remedy=remedy
        )


def _joints(tree: Tree, chain: Chain, names: list[str]) -> list[Joint]:
    """Joints with their frames in the frame of the body before; fixed joints between are in there."""
    above = (chain.base, *(joint.child for joint in chain.moving))
    return [
        Joint(
            name=name,
            coordinate=f"{name}_deg",
            frame=FrameRow(**_pose(_between(tree, link, joint.child)), axis=_floats(joint.axis)),
            limits=_limits(joint),
        )
        for link, joint, name in zip(above, chain.moving, names, strict=False)
    ]


def _limits(joint: Any) -> AngleRange:
    if joint.type == "continuous":
        note = "turns without end; a turn each way is taken"
        return AngleRange(value=(-_FULL_TURN_DEG, _FULL_TURN_DEG), unit="deg", source="assumed", note=note)
    # Whole degrees come out whole: 1e-12 deg is the round-off of half a turn.
    lower, upper = (round(float(v), 12) for v in np.degrees([joint.limit.lower, joint.limit.upper]))
    return AngleRange(value=(lower, upper), unit="deg", source=SOURCE)


def _between(tree: Tree, link: str, below: str) -> Array:
    """T_link_below at zero angles (4, 4)."""
    T = np.eye(4)
    while below != link:
        joint = tree.above[below]
        T, below = transform(joint) @ T, joint.parent
    return T


def _pose(T: Array) -> dict[str, Any]:
    """``xyz`` and ``rpy`` figures of a transform; round-off of 1e-15 is cut off, zero angles are left out."""
    xyz = Position(value=_three(T[:3, 3]), unit="m", source=SOURCE)
    rpy = _three(rpy_of(T[:3, :3]))
    return {"xyz": xyz, "rpy": Angles(value=rpy, unit="rad", source=SOURCE) if any(rpy) else None}


def _three(values: Array) -> tuple[float, float, float]:
    return _floats(np.round(values, 15))


def _floats(values: Array) -> tuple[float, float, float]:
    x, y, z = (float(value) + 0.0 for value in values)  # no -0.0
    return x, y, z


def _masses(tree: Tree, groups: dict[str, dict[str, Array]]) -> dict[str, Mass]:
    masses = {}
    for body, group in groups.items():
        inertials = [tree.links[name].inertial for name in group]
        total = sum(i.mass for i in inertials if i is not None and i.mass is not None)
        if total > 0.0:
            masses[body] = _mass(total)
    return masses


def _mass(value: float) -> Mass:
    return Mass(value=float(value), unit="kg", source=SOURCE)


def _safe(name: str) -> str:
    """The name without what separates names on the command line and in file names."""
    return re.sub(r"[^A-Za-z0-9_.-]+", "_", name).strip("_.-") or "joint"


def _safe_names(given: list[str]) -> tuple[list[str], list[str]]:
    """Names that a model can hold, each once, and a note for each one changed."""
    names: list[str] = []
    for name in given:
        safe = stem = _safe(name)
        count = 2
        while safe in (*_TAKEN, *names):
            safe, count = f"{stem}_{count}", count + 1
        names.append(safe)
    notes = [f"joint {old} is called {new} here" for old, new in zip(given, names, strict=True) if old != new]
    return names, notes


def _notes_of_chain(
    tree: Tree, chain: Chain, names: list[str], groups: dict[str, dict[str, Array]], tool: set[str]
) -> list[str]:
    notes = []
    if chain.merged:
        notes.append(f"fixed joints merged: {', '.join(chain.merged)}")
    endless = [name for name, joint in zip(names, chain.moving, strict=True) if joint.type == "continuous"]
    if endless:
        notes.append(f"no limits, +-{_FULL_TURN_DEG:g} deg taken: {', '.join(endless)}")
    notes.append(f"flange: link {chain.flange}; tool point: link {chain.tip}")
    if tool:
        notes.append(f"left out of the last body, as the tool: links {', '.join(sorted(tool))}")
    if chain.base != tree.root:
        notes.append(f"left out: all that does not hang on link {chain.base}")
    for body, group in groups.items():
        beside = [link for link in group if link not in chain.links and _has_substance(tree.links[link])]
        if beside:
            notes.append(f"fixed to {body} and counted with it: links {', '.join(beside)}")
    used = {joint.name for joint in chain.moving}
    for group in groups.values():
        for joint in (joint for link in group for joint in tree.below[link]):
            if not is_fixed(joint) and joint.name not in used:
                carried = ", ".join((joint.child, *links_below(tree, joint.child)))
                how = joint.type if joint.mimic is None else f"{joint.type}, coupled to {joint.mimic.joint}"
                notes.append(f"left out: joint {joint.name} ({how}) with links {carried}")
    return notes


def _has_substance(link: Any) -> bool:
    return bool(link.visuals or link.collisions or (link.inertial is not None and link.inertial.mass))
