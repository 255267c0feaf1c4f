"""Five links (a) to (e) as exact solids, built in gmsh's OpenCASCADE kernel; lengths in mm, x from root to tip.

What the issue leaves open is chosen here. (a) a box tube with end plates as thick as its wall, both axes along it.
(b) a casting: drums across it around both axes (y), 200 wide with walls of 20, and between them a barrel 160 deep that
tapers from 260 to 190 in height; both seats are the drums' faces at y = -100, as on an upper arm whose gears sit on one
side. (c) has a web in the barrel's middle plane and a diaphragm halfway as well, both as thick as its wall. (d) a
forearm: a solid flange of 105 radius, a tube, and a drum of 85 radius across its end, seat at y = +85. (e) is (b) with
a window in the barrel's side away from the seats. All of steel.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import gmsh

YOUNGS_MODULUS_PA, POISSONS_RATIO, DENSITY = 210e9, 0.3, 7850.0

occ: Any = gmsh.model.occ
Volumes = list[tuple[int, int]]
Triple = tuple[float, float, float]


@dataclass(frozen=True)
class Seat:
    """A round or rectangular plane face that a joint holds: the axis it stands across, and what is bolted to it.

    ``point``: where the joint's frame is, on its axis. ``face``: where the axis meets the seat. ``outward``: of the
    link. ``radius``: of the seat, and of the neighbour's flange as a rule.
    """

    point: Triple
    face: Triple
    outward: Triple
    radius: float


@dataclass(frozen=True)
class Case:
    """A link: its two seats, what a default import must know, and how its outer and inner solids are made.

    ``share``: of the casing in the mass that a maker would publish, 0.8 for a bare tube and 0.6 for a casting with
    drives. ``outer`` makes the overlapping volumes of the outer skin, ``cavity`` what is hollow in it. ``window``: cut
    through the wall: middle and size, of which the least goes through.
    """

    name: str
    words: str
    root: Seat
    tip: Seat
    share: float
    outer: Callable[[], Volumes]
    cavity: Callable[[], Volumes]
    wall: float
    window: tuple[Triple, Triple] | None = None


def solid(case: Case) -> Volumes:
    """The link itself, in gmsh's current model."""
    body = _cut(_fuse(case.outer()), case.cavity())
    if case.window is not None:
        body = _cut(body, [_box(*case.window)])
    occ.synchronize()
    return body


def skin(case: Case) -> Volumes:
    """The outer skin as a full solid; a window is a pocket as deep as the wall, whose floor is no part of the skin."""
    body = _fuse(case.outer())
    if case.window is not None:
        body = _cut(body, [_box(*case.window)])
    occ.synchronize()
    return body


def parts(case: Case) -> Volumes:
    """The outer skin as several bodies that overlap, as visual meshes often are; a window as in :func:`skin`."""
    volumes = case.outer()
    if case.window is not None:
        volumes = [body for volume in volumes for body in _cut([volume], [_box(*case.window)])]
    occ.synchronize()
    return volumes


def _box(middle: Triple, size: Triple) -> tuple[int, int]:
    corner = [m - s / 2.0 for m, s in zip(middle, size, strict=True)]
    return (3, int(occ.addBox(*corner, *size)))


def _cylinder(start: Triple, along: Triple, radius: float) -> tuple[int, int]:
    return (3, int(occ.addCylinder(*start, *along, radius)))


def _taper(length: float, half_root: float, half_tip: float, half_depth: float) -> tuple[int, int]:
    """A bar along x whose half height (z) goes from one value to the other."""
    corners = [(0.0, -half_root), (length, -half_tip), (length, half_tip), (0.0, half_root)]
    points = [occ.addPoint(x, -half_depth, z) for x, z in corners]
    lines = [occ.addLine(one, other) for one, other in zip(points, points[1:] + points[:1], strict=True)]
    face = occ.addPlaneSurface([occ.addCurveLoop(lines)])
    return next(entity for entity in occ.extrude([(2, face)], 0.0, 2.0 * half_depth, 0.0) if entity[0] == 3)


def _fuse(volumes: Volumes) -> Volumes:
    return list(occ.fuse(volumes[:1], volumes[1:])[0])


def _cut(body: Volumes, tools: Volumes) -> Volumes:
    return list(occ.cut(body, tools)[0])


# (a): 150 wide (y), 200 high (z), 800 long.
def _tube() -> Volumes:
    return [_box((250.0, 0.0, 0.0), (500.0, 150.0, 200.0)), _box((625.0, 0.0, 0.0), (350.0, 150.0, 200.0))]


def _tube_hollow() -> Volumes:
    return [_box((400.0, 0.0, 0.0), (784.0, 134.0, 184.0))]


# (b), (c), (e): wall of the barrel, of the drums, half width of the drums, half depth of the barrel.
BARREL, DRUM, HALF_DRUM, HALF_BARREL = 8.0, 20.0, 100.0, 80.0
HALF_ROOT, HALF_TIP, LENGTH, R_ROOT, R_TIP = 130.0, 95.0, 1000.0, 180.0, 130.0


def _drums(wall: float) -> Volumes:
    half = HALF_DRUM - wall
    ends = ((0.0, R_ROOT), (LENGTH, R_TIP))
    return [_cylinder((x, -half, 0.0), (0.0, 2.0 * half, 0.0), radius - wall) for x, radius in ends]


def _barrel(wall: float) -> tuple[int, int]:
    # Walls of 8 are measured at right angles to the tapering sides.
    slant = (1.0 + ((HALF_ROOT - HALF_TIP) / LENGTH) ** 2) ** 0.5
    return _taper(LENGTH, HALF_ROOT - wall * slant, HALF_TIP - wall * slant, HALF_BARREL - wall)


def _casting() -> Volumes:
    return [*_drums(0.0), _barrel(0.0)]


def _casting_hollow() -> Volumes:
    return _fuse([*_drums(DRUM), _barrel(BARREL)])


def _casting_ribbed_hollow() -> Volumes:
    # Web and diaphragm end in the drums' walls, 160 and 110 around the axes inside.
    web = _box(((165.0 + 885.0) / 2.0, 0.0, 0.0), (885.0 - 165.0, BARREL, 4.0 * HALF_ROOT))
    diaphragm = _box((500.0, 0.0, 0.0), (BARREL, 4.0 * HALF_BARREL, 4.0 * HALF_ROOT))
    return _cut(_casting_hollow(), _fuse([web, diaphragm]))


# (d): wall of the tube, of the drum; lengths along the tube.
TUBE, CROSS, FLANGE, REACH, HALF_CROSS = 6.0, 15.0, 40.0, 600.0, 85.0
R_TUBE, R_CROSS, R_FLANGE = 70.0, 85.0, 105.0


def _forearm() -> Volumes:
    flange = _cylinder((0.0, 0.0, 0.0), (FLANGE, 0.0, 0.0), R_FLANGE)
    tube = _cylinder((0.0, 0.0, 0.0), (REACH, 0.0, 0.0), R_TUBE)
    return [flange, tube, _cylinder((REACH, -HALF_CROSS, 0.0), (0.0, 2.0 * HALF_CROSS, 0.0), R_CROSS)]


def _forearm_hollow() -> Volumes:
    half = HALF_CROSS - CROSS
    tube = _cylinder((FLANGE, 0.0, 0.0), (REACH - FLANGE, 0.0, 0.0), R_TUBE - TUBE)
    return _fuse([tube, _cylinder((REACH, -half, 0.0), (0.0, 2.0 * half, 0.0), R_CROSS - CROSS)])


_BACK, _FRONT, _SIDE = (-1.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, -1.0, 0.0)
_DRUM_ROOT = Seat((0.0, 0.0, 0.0), (0.0, -HALF_DRUM, 0.0), _SIDE, R_ROOT)
_DRUM_TIP = Seat((LENGTH, 0.0, 0.0), (LENGTH, -HALF_DRUM, 0.0), _SIDE, R_TIP)


def _casting_case(name: str, words: str, cavity: Callable[[], Volumes], window: tuple[Triple, Triple] | None) -> Case:
    return Case(name, words, _DRUM_ROOT, _DRUM_TIP, 0.6, _casting, cavity, BARREL, window)


CASES: dict[str, Case] = {
    case.name: case
    for case in (
        Case(
            "a",
            "box tube 150 x 200 x 800, wall 8, end plates",
            Seat((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), _BACK, 75.0),
            Seat((800.0, 0.0, 0.0), (800.0, 0.0, 0.0), _FRONT, 75.0),
            0.8,
            _tube,
            _tube_hollow,
            8.0,
        ),
        _casting_case("b", "casting 1000 long, cross bosses R180 and R130 20 thick, wall 8", _casting_hollow, None),
        _casting_case("c", "the same with web and diaphragm", _casting_ribbed_hollow, None),
        Case(
            "d",
            "forearm tube R70, wall 6, solid root flange of 40, cross boss R85 15 thick",
            Seat((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), _BACK, R_FLANGE),
            Seat((REACH, 0.0, 0.0), (REACH, HALF_CROSS, 0.0), (0.0, 1.0, 0.0), R_CROSS),
            0.8,
            _forearm,
            _forearm_hollow,
            TUBE,
        ),
        _casting_case(
            "e",
            "as (b) with an open back of 550 x 150",
            _casting_hollow,
            ((500.0, HALF_BARREL - BARREL / 2.0, 0.0), (550.0, BARREL, 150.0)),
        ),
    )
}
