"""Assumed bodies of an arm of which no shape is known: capsules along its links, as thick as arms usually are.

Industrial arms look alike: thick at the base, thinner towards the wrist. Capsules about the way from joint to joint,
whose radius is a share of the arm's length that falls along the chain, hold nearly all of the collision meshes that
makers publish (benchmarks/shop/assumed_shapes.py tunes the shares on some of them and checks them on others).
"""

from __future__ import annotations

from itertools import combinations, pairwise, product

import numpy as np

from machining.cell.separation import segment_distance
from machining.cell.solids import Solid, capsule
from meshes.beams import body_tip
from robots import Robot
from robots.arrays import Array
from robots.kinematics import forward_kinematics, moving_frames, stretched_length
from robots.robot import trial_poses

# Radius over the arm's girth, and the share of the chain's length that it holds at. The girth is the cube root of
# length times four times the height of axis 2 squared: arms with a high shoulder are thick for their length.
SHARES = ((0.0, 0.16), (0.25, 0.133), (0.5, 0.133), (0.65, 0.109), (0.8, 0.087), (1.0, 0.044))
# Shoulders that stand out from axis 1 by more than this share of the length go with thicker arms.
OUT = 0.08
# What turns about axis 2 clears the floor: no radius is more than this share of the height of that axis.
MOST = 0.66
# Motors behind the elbow: how far forearms stand out backwards, of the length, and their radius, of the elbow's.
BEHIND, BEHIND_RADIUS = 0.12, 0.63
# Forearms shorter than this share of the length have none of that.
SHORT = 0.15
# Axis 2 lower than this share of the length over the base's z = 0: that is not the plane that the robot stands on.
LOW = 0.05
# Poses in which it is looked for which bodies always overlap, and the share of them from which on they do by design.
TRIED, BY_DESIGN = 200, 0.25
# Axes that make a smaller angle (sine) with each other have no common normal worth the name.
PARALLEL = 0.1
# Ways shorter than this (m) need no capsule: the next body's begins there.
SHORTEST = 1e-4
# Assumed shapes are up to three times too large: two of them meet only where these inner parts of their radii do.
INNER = 0.5
# Behind the name of a body, wherever it is said.
ASSUMED = " (assumed shape)"


def plain_name(name: str) -> str:
    """The name of a body without what says that its shape is assumed."""
    return name.removesuffix(ASSUMED)


def shoulder_height(robot: Robot) -> float:
    """Height (m) of axis 2 over z = 0 of the base; 0 for arms of one joint."""
    if robot.dof < 2:
        return 0.0
    return float(forward_kinematics(robot, np.zeros((1, robot.dof))).p[0, 2, 2])


def stands_on_base(robot: Robot) -> bool:
    """Whether z = 0 of the base can be the plane that the robot stands on: DH tables often put it at axis 2."""
    return shoulder_height(robot) > LOW * stretched_length(robot, np.zeros(3))


def joint_ways(robot: Robot) -> list[list[Array]]:
    """Ways (k, 3) m along each body, in its frame, from its own joint to the next one (or the flange); one, or two.

    Where the two axes are not parallel the way leads over the feet of their common normal, as in DH tables: along the
    own axis, across, along the next axis. Where parallel axes follow one another and the chain leaves them to the side
    of where it came to them, the first body may stand on either side: of a UR it stands on the far one. What the first
    body has along axis 1 is the base's.
    """
    ways = []
    for body in range(robot.dof + 1):
        tip = body_tip(robot, body)
        points = [np.zeros(3), *(_feet(robot, body) if 0 < body < robot.dof else []), tip]
        kept = [points[0]]
        for point in points[1:]:
            if np.linalg.norm(point - kept[-1]) > SHORTEST:
                kept.append(point)
        way = np.array(kept)
        aside = _aside(robot, body) if len(way) > 1 else 0.0
        ways.append([way] if abs(aside) < SHORTEST else [way, way + aside * _own(robot, body)])
    first = ways[1][0]
    if len(first) > 1 and np.linalg.norm(np.cross(first[1], _own(robot, 1))) < SHORTEST:
        # Along axis 1 nothing tells the first body from the base, which stands on the floor.
        top = robot.T_pre[0][:3, :3] @ robot.R_post[0] @ first[1] + robot.T_pre[0][:3, 3]
        ways[0], ways[1] = [np.vstack([ways[0][0][:1], top])], [first[1:]]
    return ways


def _own(robot: Robot, body: int) -> Array:
    """Axis (3,) of a body's own joint, in its frame."""
    return np.asarray(robot.R_post[body - 1].T[:, 2])


def _parallel(robot: Robot, body: int) -> bool:
    """Whether a body's own axis and the next one are parallel."""
    if not 0 < body < robot.dof:
        return False
    return float(np.linalg.norm(np.cross(_own(robot, body), axis_in(robot, body)))) < PARALLEL


def _aside(robot: Robot, body: int) -> float:
    """How far (m) along its axis the chain leaves the parallel axes that begin with this body's; 0 for other bodies."""
    if not _parallel(robot, body) or _parallel(robot, body - 1):
        return 0.0
    total, axis = 0.0, _own(robot, body)
    while _parallel(robot, body):
        total += float(body_tip(robot, body) @ axis)
        body += 1
        axis = np.sign(axis_in(robot, body - 1) @ axis) * _own(robot, body)
    feet = _feet(robot, body) if body < robot.dof else []
    return total + (float(feet[0] @ axis) if feet else 0.0)


def axis_in(robot: Robot, body: int) -> Array:
    """Axis (3,) of the next joint in a body's frame."""
    return np.asarray(robot.T_pre[body][:3, 2])


def _feet(robot: Robot, body: int) -> list[Array]:
    """Feet of the common normal of a body's own axis and the next one; none where it leads astray."""
    own, following, tip = _own(robot, body), axis_in(robot, body), body_tip(robot, body)
    across = np.cross(own, following)
    sine = float(np.linalg.norm(across))
    if sine < PARALLEL:
        return []
    n = across / sine
    first = own * (np.cross(tip, following) @ n / sine)
    second = tip + following * (np.cross(tip, own) @ n / sine)
    # A foot far beyond both joints is no part of the body.
    most = float(np.linalg.norm(tip)) + SHORTEST
    return [foot for foot in (first, second) if np.linalg.norm(foot) <= most and np.linalg.norm(foot - tip) <= most]


def _behind(robot: Robot, body: int, reach: float) -> tuple[Array, Array] | None:
    """Ends of what a forearm has behind the elbow, in the elbow body's frame; None for other bodies."""
    if not _parallel(robot, body - 1) or _parallel(robot, body) or not 1 < body < robot.dof - 1:
        return None
    axis, foot = axis_in(robot, body), [body_tip(robot, body), *_feet(robot, body)][-1]
    along = float((body_tip(robot, body) - foot) @ axis + body_tip(robot, body + 1) @ _own(robot, body + 1))
    if abs(along) < SHORT * reach:
        return None
    return foot, foot - np.sign(along) * BEHIND * reach * axis


def assumed_solids(robot: Robot, radius: float | None = None) -> dict[int, tuple[Solid, ...]]:
    """Capsules of the bodies, by number (0: base), in their frames; ``radius`` m: the same for all."""
    ways = joint_ways(robot)
    lengths = [float(np.linalg.norm(np.diff(way[0], axis=0), axis=1).sum()) for way in ways]
    total, reach = sum(lengths), stretched_length(robot, np.zeros(3))
    height = shoulder_height(robot) if stands_on_base(robot) else 0.25 * reach
    out_by = float(np.linalg.norm(body_tip(robot, 1)[:2])) / reach
    girth = float(np.cbrt(reach * (4.0 * height) ** 2)) * (1.0 + out_by - OUT)
    at, shares = np.array(SHARES).T
    out: dict[int, tuple[Solid, ...]] = {}
    before = 0.0
    for body, (several, length) in enumerate(zip(ways, lengths, strict=True)):
        share = (before + 0.5 * length) / total
        thick = radius or min(girth * float(np.interp(share, at, shares)), MOST * height)
        made = [capsule(a, b, thick) for way in several for a, b in pairwise(way)]
        behind = _behind(robot, body, reach)
        if behind is not None:
            made.append(capsule(*behind, BEHIND_RADIUS * thick))
        if made:
            out[body] = tuple(made)
        before += length
    return out


def overlapping(robot: Robot, solids: dict[int, tuple[Solid, ...]]) -> set[tuple[int, int]]:
    """Pairs of bodies whose capsules overlap in so many poses that they must do so by design.

    As MoveIt's set-up assistant does it (I. Sucan, S. Chitta, moveit.ai): such a pair says nothing of a collision.
    """
    q = trial_poses(robot, TRIED, TRIED)
    R, p = moving_frames(robot, q)
    ends = {
        body: [(np.einsum("nij,kj->nki", R[:, body], s.nodes) + p[:, body, None], s.radius) for s in made]
        for body, made in solids.items()
    }
    found = set()
    for a, b in combinations(sorted(solids), 2):
        hit = np.zeros(len(q), dtype=np.bool_)
        for (x, r), (y, s) in product(ends[a], ends[b]):
            hit |= segment_distance(x[:, 0], x[:, -1], y[:, 0], y[:, -1]) < INNER * (r + s)
        if hit.mean() > BY_DESIGN:
            found.add((a, b))
    return found
