"""Clearance of an arm in its cell: the least distance over all pairs of bodies, pose by pose.

Spheres and boxes bound all pairs at all poses at once; exact distances are asked only where a bound is below the
distance that matters, nearest bound first, until no bound is below what has been found.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from machining.cell.arm_solids import ArmBodies
from machining.cell.cell import Cell
from machining.cell.scene import Pair, Scene, scene_of
from machining.cell.separation import OVERLAP, box_gaps, exact_distance, segment_distance, sphere_gaps
from robots import InputError
from robots.arrays import Array, Bools, Integers
from robots.kinematics import as_poses

# Poses whose bounds are held at once: some 30 MB.
CHUNK = 2048
# Default of the distance that matters, m: the zone in which machining.Drive weighs clearance.
WITHIN = 0.05


@dataclass(frozen=True, eq=False)
class Clearance:
    """Least distances of n poses.

    ``distance`` (n,) m: exact below ``within``, ``within`` where all is farther apart, -1 mm wherever bodies overlap
    (no depth is worked out). ``pair`` (n,): which of ``names`` is nearest, -1 where nothing is within; where several
    pairs overlap it is one of them.
    """

    distance: Array
    pair: Integers
    names: tuple[Pair, ...]
    within: float

    @property
    def collides(self) -> Bools:
        """Whether bodies overlap, (n,)."""
        return np.asarray(self.distance < 0.0)

    def nearest(self, pose: int) -> Pair | None:
        """Names of the nearest pair at a pose; None where nothing is within."""
        return None if self.pair[pose] < 0 else self.names[self.pair[pose]]


def clearance(
    scene: Scene,
    q: ArrayLike,
    e: ArrayLike | None = None,
    table: ArrayLike | None = None,
    *,
    within: float = WITHIN,
) -> Clearance:
    """Distance of arm and tool from the cell and from themselves.

    Distances are exact for the solids: hulls of links and prisms around cylinders hold the body, so they are never
    farther than the real ones. Limits of joints and axes are not checked.

    Parameters
    ----------
    q : (n, dof) rad
    e : (n, k) or (1, k) m, travels of the linear axes; None: all 0
    table : (n,) or (1,) rad, angle of the turntable; None: 0
    within : distance that matters, m; inf for the distance itself, which takes longer

    Raises
    ------
    InputError
        Shapes, values that are not finite, ``within`` not above 0.
    """
    if not within > 0.0:
        raise InputError("distance that matters (m)", code="K001", value=within, allowed="greater than 0")
    poses = as_poses(scene.arm.robot, np.asarray(q, dtype=np.float64))
    n = len(poses)
    travel = None if e is None else np.asarray(e, dtype=np.float64)
    angle = None if table is None else np.atleast_1d(np.asarray(table, dtype=np.float64))
    distance, pair = np.full(n, float(within)), np.full(n, -1, dtype=np.int64)
    for start in range(0, n, CHUNK):
        rows = slice(start, start + CHUNK)
        R, p = scene.frames(poses[rows], _rows(travel, rows), _rows(angle, rows))
        _floor(scene, R, p, distance[rows], pair[rows])
        _bodies(scene, R, p, distance[rows], pair[rows])
    return Clearance(distance, pair, scene.names, float(within))


def clearance_of(
    cell: Cell, arm: ArmBodies, *, e: ArrayLike | None = None, table: float = 0.0, within: float = WITHIN
) -> Callable[[Array], Array]:
    """Callback for ``machining.Drive.clearance_of``: (k, dof) rad -> (k,) m, external axes at rest.

    ``e`` (axes,) m and ``table`` rad say where. Poses that overlap get -1 mm, so a ``Drive`` with any
    ``clearance_least`` of 0 or more refuses them. ``within`` must not be below the ``clearance_zone`` and
    ``clearance_least`` of the drive: farther distances come back as ``within``. The cell's ``safety`` is not taken
    off: give it as ``clearance_least``. Errors as :func:`scene_of` and :func:`clearance`.
    """
    scene = scene_of(cell, arm)
    travel = None if e is None else np.asarray(e, dtype=np.float64)[None]

    def distance(q: Array) -> Array:
        return clearance(scene, q, travel, np.array([table]), within=within).distance

    return distance


def _rows(values: Array | None, rows: slice) -> Array | None:
    return values if values is None or len(values) == 1 else values[rows]


def _floor(scene: Scene, R: Array, p: Array, best: Array, pair: Integers) -> None:
    """Heights of all bodies over the floor, exact: the lowest corner less the rounding."""
    plane = scene.floor_plane(R, p)
    if plane is None:
        return
    up, level = plane
    for k, number in enumerate(scene.floor_members):
        frame = scene.members[number].frame
        for index in np.flatnonzero(scene.owner == number):
            solid = scene.solids[index].solid
            direction = np.einsum("nij,ni->nj", R[:, frame], up)
            height = np.einsum("ni,ni->n", p[:, frame], up) - level
            near = np.flatnonzero(height + direction @ scene.bounds.middle[index] - scene.bounds.radius[index] < best)
            if not near.size:
                continue
            gap = height[near] + (direction[near] @ solid.nodes.T).min(axis=1) - solid.radius
            gap = np.where(gap < 0.0, OVERLAP, gap)
            less = gap < best[near]
            best[near[less]], pair[near[less]] = gap[less], len(scene.pairs) + k


def _bodies(scene: Scene, R: Array, p: Array, best: Array, pair: Integers) -> None:
    """Least distances over the pairs of bodies, put into ``best`` and ``pair`` where they are below."""
    if not len(scene.solid_pairs):
        return
    pose, which, bound, relative = _near(scene, R, p, best)
    R_ab, t_ab = relative
    thin = scene.is_thin[scene.solid_pairs[which, 1]] & scene.is_thin[scene.solid_pairs[which, 2]]
    _thin(scene, pose[thin], which[thin], R_ab[thin], t_ab[thin], best, pair)
    order = np.lexsort((bound, pose))
    for k in order[~thin[order]].tolist():
        i = pose[k]
        if bound[k] >= best[i] or best[i] < 0.0:
            continue
        number, a, b = scene.solid_pairs[which[k]]
        distance = exact_distance(scene.solids[a], scene.solids[b], R_ab[k], t_ab[k], float(best[i]))
        if distance < best[i]:
            best[i], pair[i] = distance, number


def _thin(scene: Scene, pose: Integers, which: Integers, R: Array, t: Array, best: Array, pair: Integers) -> None:
    """Distances of capsules at once: those of their centre lines less both radii."""
    if not len(pose):
        return
    number, first, second = scene.solid_pairs[which].T
    a, b = scene.ends[first], np.einsum("mij,mkj->mki", R, scene.ends[second]) + t[:, None]
    rounding = scene.pair_rounding[number] * (scene.rounding[first] + scene.rounding[second])
    gap = segment_distance(a[:, 0], a[:, 1], b[:, 0], b[:, 1]) - rounding
    gap = np.where(gap < 0.0, OVERLAP, gap)
    # From far to near, so that the nearest of each pose is written last.
    order = np.argsort(-gap, kind="stable")
    nearer = order[gap[order] < best[pose[order]]]
    best[pose[nearer]], pair[pose[nearer]] = gap[nearer], number[nearer]


def _near(scene: Scene, R: Array, p: Array, best: Array) -> tuple[Integers, Integers, Array, tuple[Array, Array]]:
    """Poses and solid pairs whose bound is below ``best``: pose, pair, bound, and where b is in a's frame."""
    first, second = scene.solid_pairs[:, 1], scene.solid_pairs[:, 2]
    frame = scene.solid_frames
    box = scene.bounds
    centre = p[:, frame] + np.einsum("nsij,sj->nsi", R[:, frame], box.middle)
    gap = sphere_gaps(centre[:, first], box.radius[first], centre[:, second], box.radius[second])
    pose, which = np.nonzero(gap < best[:, None])
    a, b = first[which], second[which]
    R_a, R_b = R[pose, frame[a]], R[pose, frame[b]]
    to_a = np.swapaxes(R_a, 1, 2)
    R_ab = to_a @ R_b
    t_ab = np.einsum("mij,mj->mi", to_a, p[pose, frame[b]] - p[pose, frame[a]])
    axes_a = np.swapaxes(box.R[a], 1, 2)
    middle = np.einsum("mij,mj->mi", R_ab, box.middle[b]) + t_ab - box.middle[a]
    boxed = box_gaps(axes_a @ R_ab @ box.R[b], np.einsum("mij,mj->mi", axes_a, middle), box.half[a], box.half[b])
    bound = np.maximum(gap[pose, which], boxed)
    kept = bound < best[pose]
    return pose[kept], which[kept], bound[kept], (R_ab[kept], t_ab[kept])
