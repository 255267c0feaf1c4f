"""Which links and joints of a URDF's tree are the arm: from a base link through revolute joints to a tip."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from robots.arrays import Array
from robots.errors import InputError, listed, raise_any

# Names that ROS-Industrial and others give the mounting plate; tool0 has its z axis out of the plate.
_PLATES = (re.compile(r"(^|[^a-z0-9])tool0$", re.I), re.compile(r"(^|[^a-z0-9])flange$", re.I))
_TIP_REMEDY = "name the arm's last link with tip (`stiffarm import` has --tip)"


@dataclass(frozen=True)
class Tree:
    """The links by name, the joint above each link, and the joints below it (yourdfpy's)."""

    name: str
    root: str
    links: dict[str, Any]
    above: dict[str, Any]
    below: dict[str, tuple[Any, ...]]


@dataclass(frozen=True)
class Chain:
    """The arm. ``moving``: its revolute joints from base to tip; ``flange``, ``tip``: links past the last one.

    ``merged``: names of the fixed joints on the way; ``links``: all links on it.
    """

    base: str
    moving: tuple[Any, ...]
    flange: str
    tip: str
    merged: tuple[str, ...]
    links: frozenset[str]


def transform(joint: Any) -> Array:
    """T_parent_child of a joint at angle zero (4, 4)."""
    return np.eye(4) if joint.origin is None else np.asarray(joint.origin, dtype=np.float64)


def is_fixed(joint: Any) -> bool:
    """Whether nothing moves here."""
    return bool(joint.type == "fixed")


def _turns(joint: Any) -> bool:
    return joint.type in ("revolute", "continuous") and joint.mimic is None


def kinematic_tree(robot: Any, where: str) -> Tree:
    """Hang the links together.

    Raises
    ------
    InputError
        No links or joints, a link below two joints, a cycle, several roots.
    """
    if not robot.joints:
        raise InputError(
            f"{where} has no joints" + (": a mesh alone is no robot" if robot.links else ""),
            code="R014",
            remedy="give the URDF of the whole robot",
        )
    above: dict[str, Any] = {}
    faults = []
    for joint in robot.joints:
        if joint.child in above:
            faults.append(
                InputError(
                    f"{where}: link {joint.child} hangs on two joints, {above[joint.child].name} and {joint.name}",
                    code="R014",
                    allowed="one joint above each link (URDF knows no closed loops)",
                    remedy="cut the loop at one of them",
                )
            )
        above.setdefault(joint.child, joint)
    raise_any(where, faults)
    links = {link.name: link for link in robot.links}
    roots = [name for name in links if name not in above]
    if len(roots) > 1:
        raise InputError(
            f"{where} has several roots",
            code="R014",
            value=listed(roots),
            allowed="one link without a joint above it",
            remedy="join them with fixed joints, or remove the ones that are not the robot",
        )
    below = {name: tuple(j for j in robot.joints if j.parent == name) for name in links}
    reached = set() if not roots else {roots[0], *(j.child for j in _joints_below(below, roots[0]))}
    if len(reached) < len(links):
        loop = sorted(set(links) - reached)
        raise InputError(
            f"{where}: links in a cycle",
            code="R014",
            value=listed(loop),
            allowed="a tree of links",
            remedy="cut the cycle",
        )
    return Tree(where, roots[0], links, above, below)


def _joints_below(below: dict[str, tuple[Any, ...]], link: str) -> Iterator[Any]:
    """All joints below a link, parents before children."""
    waiting = [link]
    while waiting:
        for joint in below[waiting.pop()]:
            yield joint
            waiting.append(joint.child)


def links_below(tree: Tree, link: str) -> list[str]:
    """All links below a link."""
    return [joint.child for joint in _joints_below(tree.below, link)]


def rigid_group(tree: Tree, link: str) -> dict[str, Array]:
    """Links that move with a link, itself included: name -> T_link_other (4, 4)."""
    fixed = {name: tuple(filter(is_fixed, joints)) for name, joints in tree.below.items()}
    group = {link: np.eye(4)}
    for joint in _joints_below(fixed, link):
        group[joint.child] = group[joint.parent] @ transform(joint)
    return group


def find_chain(tree: Tree, base: str | None, tip: str | None) -> Chain:
    """The arm from ``base`` (default: the root) to ``tip`` (default: where the most revolute joints lead).

    Raises
    ------
    InputError
        Unknown links, a tip that is not below the base, several arms or frames to choose from, and all joints
        on the way that are not revolute.
    """
    for option, name in (("base", base), ("tip", tip)):
        if name is not None and name not in tree.links:
            raise InputError(
                f"{tree.name}: {option}",
                code="R014",
                value=name,
                allowed=f"a link: {listed(tree.links)}",
                remedy="check its name",
            )
    start = tree.root if base is None else base
    end = _default_tip(tree, start) if tip is None else tip
    joints = _way(tree, start, end)
    raise_any(tree.name, [_no_revolute(tree, joint) for joint in joints if not (is_fixed(joint) or _turns(joint))])
    moving = [joint for joint in joints if not is_fixed(joint)]
    if not moving:
        raise InputError(
            f"{tree.name}: no revolute joint between {start} and {end}",
            code="R014",
            remedy="give the URDF of an arm, or name its links with base and tip (options of `stiffarm import`)",
        )
    last = joints.index(moving[-1])
    frames = [joint.child for joint in joints[last:]]
    plate = _plate(frames)
    merged = tuple(joint.name for joint in joints[:last] if is_fixed(joint))
    links = frozenset((start, *(joint.child for joint in joints)))
    return Chain(start, tuple(moving), end if plate is None else plate, end, merged, links)


def _way(tree: Tree, base: str, tip: str) -> list[Any]:
    joints: list[Any] = []
    link = tip
    while link != base:
        if link not in tree.above:
            raise InputError(
                f"{tree.name}: tip",
                code="R014",
                value=tip,
                allowed=f"a link below {base}: {listed(links_below(tree, base)) or 'there is none'}",
                remedy="name another tip, or another base",
            )
        joints.append(tree.above[link])
        link = joints[-1].parent
    return joints[::-1]


def _no_revolute(tree: Tree, joint: Any) -> InputError:
    kind = joint.type if joint.mimic is None else f"{joint.type}, coupled to {joint.mimic.joint} by <mimic>"
    return InputError(
        f"{tree.name}: joint {joint.name} on the way to the tip",
        code="R014",
        value=kind,
        allowed="revolute, continuous or fixed",
        remedy=f"end the arm before it with tip={joint.parent}, begin behind it with "
        f"base={joint.child} (options of `stiffarm import`), or make it fixed in the file where it stands still",
    )


def _plate(links: list[str]) -> str | None:
    """The first link called tool0, else the first called flange."""
    return next((name for pattern in _PLATES for name in links if pattern.search(name)), None)


def _default_tip(tree: Tree, base: str) -> str:
    depth: dict[str, int] = dict.fromkeys(tree.links, 0)
    for joint in reversed(list(_joints_below(tree.below, base))):
        depth[joint.parent] = max(depth[joint.parent], depth[joint.child] + _turns(joint))
    link, passed = base, 0
    while True:
        group = list(rigid_group(tree, link))
        moving = [joint for name in group for joint in tree.below[name] if not is_fixed(joint)]
        ahead = max((depth[joint.child] + _turns(joint) for joint in moving), default=0)
        # On a mounting plate, what has fewer joints than the arm so far is a tool.
        tool = _plate(group) is not None and ahead < passed
        joint = None if tool else _next_joint(tree, moving, depth)
        if joint is None:
            return _tip_of_last_body(tree, group, moving)
        link, passed = joint.child, passed + 1


def _next_joint(tree: Tree, moving: list[Any], depth: dict[str, int]) -> Any | None:
    """The joint that the arm goes on with; None where it ends, or only fingers follow."""
    if not moving:
        return None
    ahead = [depth[joint.child] + _turns(joint) for joint in moving]
    most = max(ahead)
    drivers = [joint for joint in moving if joint.mimic is None]
    coupled = len(drivers) == 1 and all(j.mimic.joint == drivers[0].name for j in moving if j.mimic is not None)
    if len(moving) > 1 and (most == 0 or (most == 1 and coupled)):
        return None
    best = [joint for joint, n in zip(moving, ahead, strict=True) if n == most]
    if len(best) > 1:
        leaves = [name for j in best for name in (j.child, *links_below(tree, j.child)) if not tree.below[name]]
        raise InputError(
            f"{tree.name}: the arm goes on from {best[0].parent} through {', '.join(j.name for j in best)}",
            code="R014",
            allowed="one arm",
            remedy=f"{_TIP_REMEDY}: {listed((best[0].parent, *leaves))}",
        )
    if not _turns(best[0]):
        raise _no_revolute(tree, best[0])
    return best[0]


def _tip_of_last_body(tree: Tree, group: list[str], moving: list[Any]) -> str:
    """The mounting plate, or the frame past it that is the only one; else the only end of the last body."""
    plate = _plate(group)
    if plate is not None:
        past = [name for name in links_below(tree, plate) if name in group]
        ends = [name for name in past if not tree.below[name]]
        fingers = {joint.parent for joint in moving} & {plate, *past}
        return ends[0] if len(ends) == 1 and not fingers else plate
    ends = [name for name in group if not tree.below[name]]
    # Where the last frames all carry fingers, the ones that carry no other frame.
    ends = ends or [name for name in group if not any(is_fixed(joint) for joint in tree.below[name])]
    if len(ends) > 1:
        raise InputError(
            f"{tree.name}: the last body has several ends, and none is called tool0 or flange",
            code="R014",
            value=listed(ends),
            allowed="one",
            remedy=_TIP_REMEDY,
        )
    return ends[0]
