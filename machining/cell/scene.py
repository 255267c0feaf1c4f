"""Arm, tool and cell put together: which bodies move with which frame, and which pairs are checked."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations

import numpy as np
from numpy.typing import ArrayLike

from machining.cell.arm_solids import ArmBodies
from machining.cell.assumed_shapes import ASSUMED, INNER, plain_name, stands_on_base
from machining.cell.cell import FLOOR, Cell
from machining.cell.separation import Bounds, ExactSolid, bounds_of, exact_distance, segment_distance, stacked
from machining.cell.solids import Body, all_nodes
from robots import InputError, Robot
from robots.arrays import Array, Bools, Integers, finite
from robots.frames import inverse
from robots.robot import middle_pose

Pair = tuple[str, str]
# What a body is, for the rules of which pairs are checked.
ARM, HOLDER, CUTTER, CARRIAGE, FIXED, PART = range(6)
# One less the cosine up to which axis 1 is upright on the plane that the robot stands on.
LEVEL = 1e-6


@dataclass(frozen=True, eq=False)
class Member:
    """A body of the scene: what it is, and the number of the frame that it moves with."""

    body: Body
    kind: int
    frame: int


@dataclass(frozen=True, eq=False)
class Scene:
    """What :func:`machining.cell.clearance` works on; made by :func:`scene_of`.

    ``members``: all bodies. ``pairs`` (p, 2): checked pairs of members; ``floor_members``: members checked against
    the floor. ``solids`` and ``owner`` (s,): all solids and the members they belong to; ``solid_pairs`` (k, 3):
    pair, solid, solid. ``switched_off``: pairs that overlap in the ``home`` pose (dof,) rad and are not checked for
    that reason. ``notes``: what a user should know. ``on_base``: the plane that the robot stands on is the floor.
    FCL's objects are moved while distances are asked, so a scene is for one thread, and cannot be pickled: each process
    makes its own.
    """

    arm: ArmBodies
    cell: Cell
    members: tuple[Member, ...]
    pairs: tuple[tuple[int, int], ...]
    floor_members: tuple[int, ...]
    solids: tuple[ExactSolid, ...]
    bounds: Bounds
    owner: Integers
    solid_pairs: Integers
    home: Array
    switched_off: tuple[Pair, ...]
    notes: tuple[str, ...]
    on_base: bool = False

    @cached_property
    def solid_frames(self) -> Integers:
        """Frame (s,) that each solid moves with."""
        return np.array([self.members[i].frame for i in self.owner], dtype=np.int64)

    @cached_property
    def is_thin(self) -> Bools:
        """Which solids (s,) are capsules or spheres."""
        return np.array([len(s.solid.nodes) < 3 for s in self.solids], dtype=np.bool_)

    @cached_property
    def ends(self) -> Array:
        """Ends (s, 2, 3) m of the solids' centre lines; of those that are not thin their first and last corner."""
        return np.array([s.solid.nodes[[0, -1]] for s in self.solids]).reshape(-1, 2, 3)

    @cached_property
    def rounding(self) -> Array:
        """Radii (s,) m of the solids' roundings."""
        return np.array([s.solid.radius for s in self.solids])

    @cached_property
    def pair_rounding(self) -> Array:
        """What the roundings of two solids count for in the distance of each pair of bodies, (p,): 1, or less."""
        assumed = [m.kind == ARM and m.body.name.endswith(ASSUMED) for m in self.members]
        return np.array([INNER if assumed[i] and assumed[j] else 1.0 for i, j in self.pairs])

    @property
    def names(self) -> tuple[Pair, ...]:
        """Names of all checked pairs: those of ``pairs``, then those with the floor."""
        named = [(self.members[i].body.name, self.members[j].body.name) for i, j in self.pairs]
        return (*named, *((self.members[i].body.name, FLOOR) for i in self.floor_members))

    @cached_property
    def body_names(self) -> frozenset[str]:
        """Names of all bodies, and the floor's."""
        return frozenset([FLOOR, *(member.body.name for member in self.members)])

    def frames(self, q: Array, e: ArrayLike | None = None, table: ArrayLike | None = None) -> tuple[Array, Array]:
        """Rotations (n, f, 3, 3) and origins (n, f, 3) m in the robot's base.

        Frames of the arm come first (:meth:`ArmBodies.frames`), then the world, the turntable and the carriages.
        Bodies of the cell are given where they stand in the world with all external axes at 0. ``q`` (n, dof) rad;
        ``e`` (n, k) or (1, k) m, ``table`` (n,) or (1,) rad.
        """
        R, p = self.arm.frames(q)
        to_base = inverse(self.cell.T_world_base(e))
        turned = self.cell.T_world_table(table)
        carried = np.zeros((len(to_base), len(self.cell.linear_axes), 4, 4)) + np.eye(4)
        carried[:, :, :3, 3] = self.cell.carried(e)[:, 1:]
        for what, rows in (("travels of the linear axes", to_base), ("angles of the turntable", turned)):
            if len(rows) not in (1, len(q)):
                raise InputError(what, code="K001", value=f"{len(rows)} rows", allowed=f"1 or {len(q)}, one a pose")
        out = [to_base[:, None], (to_base @ turned)[:, None], to_base[:, None] @ carried]
        T = np.concatenate([np.broadcast_to(x, (len(q), *x.shape[1:])) for x in out], axis=1)
        return np.concatenate([R, T[:, :, :3, :3]], axis=1), np.concatenate([p, T[:, :, :3, 3]], axis=1)

    def floor_plane(self, R: Array, p: Array) -> tuple[Array, Array] | None:
        """Upward directions (n, 3) in the base, and the floor's heights (n,) m along them; None: there is no floor.

        ``R`` and ``p`` as of :meth:`frames`. Without a floor of the cell it is the plane that the robot stands on.
        """
        if self.cell.floor is not None:
            # The world's frame in the base has the upward direction as its third column.
            up = R[:, self.arm.count, :, 2]
            return up, np.einsum("ni,ni->n", p[:, self.arm.count], up) + self.cell.floor
        if self.on_base:
            return np.broadcast_to(np.array([0.0, 0.0, 1.0]), (len(R), 3)), np.zeros(len(R))
        return None


def scene_of(cell: Cell, arm: ArmBodies) -> Scene:
    """Put an arm into a cell and choose the pairs of bodies that are checked.

    Not checked are bodies on the same frame or without motion between them, bodies that a joint connects, the tool
    and the last link, cutter and part, the cell's own parts against each other but for carriages, robot base and
    carriages against the floor, pairs that the cell allows; and pairs that overlap at home, which is said: links of
    the arm in the cell's ``home`` pose (middle of the joint ranges unless given), what is carried by linear axes in
    their zero. An overlap of arm and cell at home is said, but stays checked.

    Raises
    ------
    InputError
        A body's name used twice, allowed contacts that name no body, a home pose of another shape, speeds or
        accelerations for another number of joints.
    """
    _check_rates(cell, arm.robot)
    members = _members(cell, arm)
    _check_names(cell, members)
    pose = finite("home pose", middle_pose(arm.robot) if cell.home is None else cell.home, (arm.robot.dof,), "rad")
    solids = [ExactSolid(solid) for member in members for solid in member.body.solids]
    owner = np.repeat(np.arange(len(members)), [len(m.body.solids) for m in members])
    on_base = cell.floor is None and cell.stands and bool(arm.bodies) and stands_on_base(arm.robot)
    allowed = {frozenset(map(plain_name, pair)) for pair in cell.allowed_contacts}

    def may_touch(a: str, b: str) -> bool:
        return frozenset((plain_name(a), plain_name(b))) in allowed

    wanted = [
        (i, j)
        for i, j in combinations(range(len(members)), 2)
        if _checked(cell, arm, members, i, j) and not may_touch(members[i].body.name, members[j].body.name)
    ]
    floored = tuple(
        i
        for i, m in enumerate(members)
        if (cell.floor is not None or on_base)
        and (m.kind in (HOLDER, CUTTER) or (m.kind == ARM and m.frame > _level(cell, arm.robot)))
        and not may_touch(m.body.name, FLOOR)
    )
    scene = Scene(
        arm,
        cell,
        members,
        tuple(wanted),
        floored,
        tuple(solids),
        stacked([bounds_of(s.solid) for s in solids]),
        owner,
        _solid_pairs(wanted, owner),
        pose,
        (),
        (*arm.notes, *_floor_note(cell, arm, on_base=on_base)),
        on_base,
    )
    return _without_overlaps(scene)


def _floor_note(cell: Cell, arm: ArmBodies, *, on_base: bool) -> tuple[str, ...]:
    """What is taken as the floor where the cell does not say."""
    if on_base:
        text = (
            "floor: the plane that the robot stands on (z = 0 of its base); --floor or [floor] of a cell says otherwise"
        )
    elif cell.floor is None and cell.stands and arm.bodies:
        text = (
            f"no floor is checked: axis 2 of {arm.robot.name} is not above z = 0 of its base; --floor, or [floor] of a "
            "cell, gives one"
        )
    else:
        return ()
    return (text,)


def _level(cell: Cell, robot: Robot) -> int:
    """The last body that never comes nearer to the floor: the base, and what only turns about an axis upright on it."""
    if cell.floor is not None:
        return 0
    return int(abs(robot.T_pre[0][2, 2]) > 1.0 - LEVEL)


def _members(cell: Cell, arm: ArmBodies) -> tuple[Member, ...]:
    world, table = arm.count, arm.count + 1
    out = [Member(body, ARM, frame) for body, frame in zip(arm.bodies, arm.frame, strict=True)]
    out += [Member(body, HOLDER, arm.flange) for body in cell.tool.holder]
    out += [Member(body, CUTTER, arm.flange) for body in cell.tool.cutter]
    out += [
        Member(axis.carriage, CARRIAGE, arm.count + 2 + i)
        for i, axis in enumerate(cell.linear_axes)
        if axis.carriage is not None
    ]
    out += [Member(f.body, FIXED, table if f.on_turntable else world) for f in cell.fixtures]
    out += [] if cell.part is None else [Member(cell.part, PART, table)]
    return tuple(out)


def _checked(cell: Cell, arm: ArmBodies, members: tuple[Member, ...], i: int, j: int) -> bool:
    """Whether two members, i before j, can meet and must not."""
    a, b = members[i], members[j]
    if a.frame == b.frame or (a.kind == CUTTER and b.kind == PART):
        return False
    if a.kind == ARM and b.kind == ARM:
        return (i, j) not in arm.neighbours
    if a.kind == ARM and b.kind in (HOLDER, CUTTER):
        return i != arm.last
    based = a.kind == ARM and a.frame == 0
    carriages = [m.frame for m in members if m.kind == CARRIAGE]
    if b.kind == CARRIAGE:
        if based:
            return b.frame != max(carriages)
        # Carriages next to each other run on one another.
        return a.kind != CARRIAGE or carriages.index(b.frame) - carriages.index(a.frame) > 1
    if b.kind in (FIXED, PART):
        if a.kind in (FIXED, PART):
            return False
        moved = bool(cell.linear_axes) or (cell.turntable is not None and b.frame != arm.count)
        return moved if based else True
    return True


def _without_overlaps(scene: Scene) -> Scene:
    """Switch off pairs that overlap at home and cannot be told from design; say what else overlaps there."""
    R, p = (x[0] for x in scene.frames(scene.home[None]))
    hit = set()
    for pair, a, b in scene.solid_pairs:
        f, g = (scene.members[scene.owner[s]].frame for s in (a, b))
        R_ab, t_ab = R[f].T @ R[g], R[f].T @ (p[g] - p[f])
        if scene.pair_rounding[pair] < 1.0:
            x, y = scene.ends[a], scene.ends[b] @ R_ab.T + t_ab
            distance = float(segment_distance(*x[:, None], *y[:, None])[0])
            distance -= INNER * float(scene.rounding[a] + scene.rounding[b])
        else:
            distance = exact_distance(scene.solids[a], scene.solids[b], R_ab, t_ab, np.inf)
        if distance < 0.0:
            hit.add(int(pair))
    off, notes = set(), []
    for k in sorted(hit):
        a, b = (scene.members[i] for i in scene.pairs[k])
        said = f"{a.body.name} and {b.body.name} overlap at home"
        own = b.kind in (ARM, HOLDER, CUTTER)
        carried = a.kind == CARRIAGE or (a.kind == ARM and a.frame == 0)
        if own or carried:
            off.add(k)
            notes.append(f"{said}: this pair is not checked")
        else:
            notes.append(f"{said}; the pair stays checked")
    plane = scene.floor_plane(R[None], p[None])
    for i in scene.floor_members:
        assert plane is not None  # noqa: S101 - where there is none, no member is checked against it
        member = scene.members[i]
        nodes = all_nodes(member.body.solids) @ R[member.frame].T + p[member.frame]
        if (nodes @ plane[0][0]).min() - max(s.radius for s in member.body.solids) < plane[1][0]:
            notes.append(f"{member.body.name} is below the floor at home; the pair stays checked")
    kept = [pair for k, pair in enumerate(scene.pairs) if k not in off]
    return replace(
        scene,
        pairs=tuple(kept),
        solid_pairs=_solid_pairs(kept, scene.owner),
        switched_off=tuple(scene.names[k] for k in sorted(off)),
        notes=(*scene.notes, *notes),
    )


def _solid_pairs(pairs: list[tuple[int, int]], owner: Integers) -> Integers:
    rows = [
        (k, a, b)
        for k, (i, j) in enumerate(pairs)
        for a in np.flatnonzero(owner == i)
        for b in np.flatnonzero(owner == j)
    ]
    return np.array(rows, dtype=np.int64).reshape(-1, 3)


def _check_rates(cell: Cell, robot: Robot) -> None:
    for what, rate in (("joint speeds", cell.joint_speed), ("joint accelerations", cell.joint_acceleration)):
        if rate is not None and np.shape(rate) not in ((), (robot.dof,)):
            allowed = f"one, or {robot.dof} for {robot.name}"
            raise InputError(f"{what} of the cell", code="K001", value=f"{np.size(rate)} figures", allowed=allowed)


def _check_names(cell: Cell, members: tuple[Member, ...]) -> None:
    names = [m.body.name for m in members]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise InputError(
            "body name used in robot and cell",
            code="K001",
            value=", ".join(twice),
            remedy="give it another name in the cell",
        )
    known = {*map(plain_name, names), FLOOR}
    for pair in cell.allowed_contacts:
        for name in pair:
            if plain_name(name) not in known:
                allowed = ", ".join(sorted(known))
                raise InputError("allowed contact names no body", code="K001", value=name, allowed=allowed)
