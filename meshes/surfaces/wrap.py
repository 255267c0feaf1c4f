"""Visual meshes made into casings: a closed skin wrapped around any heap of triangles, and its mid-surface.

Visual meshes have many bodies, holes and overlapping parts. A ball that rolls over them from outside tells what
is outside: it cannot pass openings smaller than itself. Two ways to the skin: contours of a distance field on
a grid, and alpha wrapping (Portaneri et al. 2022, doi:10.1145/3528223.3530152, by CGAL through pymeshlab, which
is GPL and optional). The skin lies a known offset outside the original; moving to the mid-surface takes it off.
"""

from __future__ import annotations

import importlib.util
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy import ndimage
from scipy.spatial import KDTree

from meshes.apart import ApartError, run_apart
from meshes.surfaces.checks import SECOND_BODY, SurfaceFault
from meshes.surfaces.distance_grid import Grid, bodies, contour, distance, enclosed, grid_around, sample, signed_volume
from robots import InputError, require_one_of
from robots.arrays import Array, Integers

Method = Literal["auto", "alpha", "grid"]
METHODS: tuple[Method, ...] = ("auto", "alpha", "grid")

# Grid steps in an element: the contour has some four triangles for each element that remeshing leaves.
STEPS = 2.0
# CGAL's manual advises an offset of a tenth to a thirtieth of alpha.
ALPHA_OFFSET, LEAST_ALPHA_OFFSET = 0.1, 1.0 / 30.0
TIMEOUT_S = 300.0
# Distance of a right-angled corner from the one that is eroded by 1: the square root of 3, and some more.
CORNER = 1.75
# Share of the volume in parts that are too thin: refused, and worth saying. If all of it is lost on one side, a casing
# bends as one that is lower by this share v, with the stiffness (1 - v)^2 to (1 - v)^3 (its walls' second moment): 10 %
# cost up to 27 %, as much as a wall of 6 mm that is 4.4 in truth. Public robots that wrap well lose up to 4 %.
MOST_LOST, LOST_SAID = 0.1, 0.005

# It runs in a process of its own: pymeshlab and CGAL end their process on some surfaces.
_ALPHA_WRAP = """
import sys
import numpy as np
import pymeshlab
source, target, alpha, offset = sys.argv[1:]
surface = np.load(source, allow_pickle=False)
meshes = pymeshlab.MeshSet()
meshes.add_mesh(pymeshlab.Mesh(surface["nodes"], surface["faces"]))
meshes.generate_alpha_wrap(alpha=pymeshlab.PureValue(float(alpha)), offset=pymeshlab.PureValue(float(offset)))
wrap = meshes.current_mesh()
np.savez(target, nodes=wrap.vertex_matrix(), faces=wrap.face_matrix())
"""


@dataclass(frozen=True)
class Wrap:
    """A closed skin, nodes (n, 3) m and faces (m, 3), that lies ``offset`` m outside the original surface."""

    nodes: Array
    faces: Integers
    offset: float
    notes: tuple[str, ...]


def check_method(method: str) -> None:
    """Raise InputError where there is no such way to wrap, or its package is missing."""
    require_one_of("wrap method", method, METHODS, code="L011")
    if method == "alpha" and importlib.util.find_spec("pymeshlab") is None:
        raise InputError(
            "alpha wrap needs the package pymeshlab (GPL-3.0)",
            code="F013",
            remedy='install it (`pip install "stiffarm[wrap]"`), or wrap by the grid, which needs nothing',
        )


def wrap_surface(
    name: str, nodes: Array, faces: Integers, size: float, opening: float | None = None, method: Method = "auto"
) -> Wrap:
    """Closed skin around triangles of any kind; the largest body that results.

    Parameters
    ----------
    name : for messages
    nodes, faces : corners (n, 3) m and triangles (m, 3), closed or not, in any number of bodies
    size : element size aimed at later, m; the skin is twice as fine
    opening : width of the openings and gaps that are closed, m; by default, and at least, two sizes
    method : "grid", "alpha" (needs pymeshlab), or "auto", which is "grid" here: it gives the same on every machine

    Raises
    ------
    InputError
        Unknown method, alpha wrap without pymeshlab or crashed, a grid too large, several large bodies.
    """
    check_method(method)
    ball = max(0.5 * opening if opening is not None else 0.0, size)
    if method == "alpha":
        # No further outside than the grid's, if that is not too little for the ball.
        offset = min(ALPHA_OFFSET * ball, max(size / STEPS, LEAST_ALPHA_OFFSET * ball))
        skin = _alpha_wrapped(name, nodes, faces, ball, offset)
    else:
        offset = size / STEPS
        skin = _grid_wrapped(name, nodes[faces], ball, offset, size / STEPS)
    found = bodies(*skin)
    if not found:
        raise InputError(
            f"surface {name} has no triangles left to wrap", code="L003", remedy="check the file and its scale"
        )
    wider = f"or close wider gaps (--close-mm above {2e3 * ball:.3g})"
    _refuse_second_body(name, found, f"further apart than {2e3 * ball:.3g} mm", wider)
    notes = [
        f"wrapped ({'alpha wrap' if method == 'alpha' else 'distance grid'}) {1e3 * offset:.3g} mm outside; "
        f"openings up to {2e3 * ball:.3g} mm closed"
    ]
    if len(found) > 1:
        notes.append(f"{len(found) - 1} smaller bodies dropped after wrapping")
    return Wrap(*found[0], offset, tuple(notes))


def _refuse_second_body(name: str, found: list[tuple[Array, Integers]], why: str, remedy: str) -> None:
    if len(found) < 2:
        return
    first, second = (signed_volume(*body) for body in found[:2])
    if second > SECOND_BODY * first:
        raise SurfaceFault(
            f"surface {name}: {len(found)} separate bodies, {why}; volumes of the two largest 1 : {second / first:.2f}",
            code="L003",
            allowed=f"one body, others below {SECOND_BODY:g} of its volume",
            remedy=f"unite the parts, {remedy}",
        )


def _grid_wrapped(name: str, corners: Array, ball: float, offset: float, step: float) -> tuple[Array, Integers]:
    """Contour at ``offset`` around triangles (m, 3, 3), and across openings that a ball does not pass."""
    grid = grid_around(name, corners.reshape(-1, 3), step, ball + 4.0 * step)
    far = distance(grid, sample(corners, step / 3.0), 0.0, offset + 1.5 * step)
    # Where the ball's centre gets to, coming from a corner of the grid.
    label = ndimage.label(far > max(ball, offset))[0]
    reached = np.asarray(ndimage.distance_transform_edt(label != label[0, 0, 0], sampling=step))
    # The slack keeps the coarse second field out of the way where the ball touches the surface.
    return contour(grid, np.minimum(far - offset, ball - offset + step - reached))


def _alpha_wrapped(name: str, nodes: Array, faces: Integers, alpha: float, offset: float) -> tuple[Array, Integers]:
    """CGAL's alpha wrap in a process of its own, so that a crash there is a message here."""
    try:
        wrap = run_apart(_ALPHA_WRAP, (repr(alpha), repr(offset)), {"nodes": nodes, "faces": faces}, TIMEOUT_S)
        return wrap["nodes"].astype(np.float64), wrap["faces"].astype(np.int64)
    except (ApartError, KeyError) as error:
        failed = f"surface {name}: the alpha wrap failed ({error})"
        raise SurfaceFault(failed, code="L003", remedy="wrap by the grid instead") from error


def middle_surface(
    name: str, wrap: Wrap, wall: float, size: float, margin: float
) -> tuple[tuple[Array, Integers], tuple[str, ...]]:
    """Mid-surface of a wall ``wall`` m thick under the wrapped surface, finer than ``size``; and notes.

    The inside of the mid-surface is eroded by ``margin`` m, and what is far from the rest goes: parts thinner than
    wall and two margins, whose sides would come too near to each other. Corners are near enough to stay sharp.

    Raises
    ------
    InputError
        No room for the wall: nothing, several large bodies, or too little of the casing remains.
    """
    step, depth = size / STEPS, wrap.offset + 0.5 * wall
    grid = grid_around(name, wrap.nodes, step, 4.0 * step)
    field = _signed_distance(grid, wrap.nodes, wrap.faces, depth, depth + margin)
    remedy = (
        "give the wall's true thickness or a smaller target size, or close wider openings to the inside (--close-mm)"
    )
    core = bodies(*contour(grid, field + depth + margin))
    if not core:
        raise SurfaceFault(
            f"surface {name} has no room for its wall: nothing of it is {1e3 * (wall + 2.0 * margin):.3g} mm thick",
            code="L004",
            value=f"wall {1e3 * wall:.3g} mm, target size {1e3 * size:.3g} mm",
            remedy=remedy,
        )
    _refuse_second_body(name, core, "joined only by parts thinner than the wall", remedy)
    reach = CORNER * margin
    near = _signed_distance(grid, *core[0], reach, reach) - reach
    middle = bodies(*contour(grid, np.maximum(field + depth, near)))[0]
    lost = 1.0 - signed_volume(*middle) / (float(np.count_nonzero(field < -depth)) * step**3)
    if lost > MOST_LOST:
        raise SurfaceFault(
            f"surface {name}: {100 * lost:.0f} % of its volume is in parts too thin for the wall and the elements",
            code="L004",
            value=f"wall {1e3 * wall:.3g} mm, target size {1e3 * size:.3g} mm",
            allowed=f"up to {100 * MOST_LOST:.0f} %",
            remedy=remedy,
        )
    notes = () if lost < LOST_SAID else (f"parts too thin for a casing left out: {100 * lost:.1f} % of the volume",)
    return middle, notes


def _signed_distance(grid: Grid, nodes: Array, faces: Integers, least: float, most: float) -> Array:
    """Distance to a closed surface on the grid, negative inside; exact from ``least`` to ``most`` and a step beyond."""
    reach = 1.5 * grid.step
    points = even(sample(nodes[faces], 0.5 * grid.step), 0.1 * grid.step)
    far = distance(grid, points, max(least - reach, 0.0), most + reach)
    return np.where(enclosed(grid, nodes, faces), -far, far)


@dataclass(frozen=True)
class Departure:
    """How far a mid-surface and its original are from being half a wall apart, m.

    ``bridged``: kept by 95 % of the mid-surface, that is too far from any original (openings spanned). ``lost``: kept
    by 95 % of what the wrap sees of the original (details lost, edges rounded). ``worst``: of both.
    """

    bridged: float
    lost: float
    worst: float

    @property
    def middling(self) -> float:
        """What 95 % of both keep."""
        return max(self.bridged, self.lost)

    def __str__(self) -> str:
        return (
            f"off by {1e3 * self.middling:.3g} mm at the 95 % quantile ({1e3 * self.lost:.3g} mm where details are "
            f"lost, {1e3 * self.bridged:.3g} mm where openings are spanned)"
        )


@dataclass(frozen=True)
class Original:
    """Samples of a surface to compare with: a tree of all, and those (p, 3) m that a wrap sees, even over its area."""

    everywhere: KDTree
    seen: Array


def original_seen(wrap: Wrap, corners: Array, size: float) -> Original:
    """What a wrap sees of the original's triangles (m, 3, 3)."""
    points = even(sample(corners, size / 3.0), size / 6.0)
    skin = KDTree(even(sample(wrap.nodes[wrap.faces], size / 3.0), size / 6.0))
    some = even(points, size / 3.0)
    near = skin.query(some, workers=-1)[0] <= wrap.offset + 0.25 * size
    return Original(KDTree(points), some[near])


def departure(original: Original, middle: tuple[Array, Integers], wall: float, size: float) -> Departure:
    """How far a mid-surface and the original are from being half a wall apart, by samples of equal area."""
    ours = even(sample(middle[0][middle[1]], size / 3.0), size / 6.0)
    bridged, lost = (
        np.maximum(np.asarray(tree.query(points, workers=-1)[0]) - 0.5 * wall, 0.0) if len(points) else np.zeros(1)
        for points, tree in ((even(ours, size / 3.0), original.everywhere), (original.seen, KDTree(ours)))
    )
    worst = float(max(bridged.max(), lost.max()))
    return Departure(float(np.percentile(bridged, 95.0)), float(np.percentile(lost, 95.0)), worst)


def off_original(original: Original, nodes: Array, wall: float) -> Array:
    """How much further than half a wall nodes (n, 3) of a mid-surface are from the original, m: over openings."""
    return np.maximum(np.asarray(original.everywhere.query(nodes, workers=-1)[0]) - 0.5 * wall, 0.0)


def even(points: Array, spacing: float) -> Array:
    """One of the points (p, 3) in each cube of side ``spacing`` m: triangles share corners, small ones have many."""
    cube = np.floor((points - points.min(axis=0)) / spacing).astype(np.int64)
    shape = cube.max(axis=0) + 1
    first = np.unique((cube[:, 0] * shape[1] + cube[:, 1]) * shape[2] + cube[:, 2], return_index=True)[1]
    return np.asarray(points[np.sort(first)])
