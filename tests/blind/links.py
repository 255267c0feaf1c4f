"""Link flexibility by Castigliano: energy of the section forces, integrated along each link (Timoshenko)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .arm import Arm, Array, Section
from .kinematics import Frames
from .statics import bar_row

# Eight Gauss points a segment: a linear taper's 1/I is smooth, the rest is exact to round-off.
NODES, WEIGHTS = np.polynomial.legendre.leggauss(8)
MODES = ("bending", "shear", "torsion", "axial")


@dataclass(frozen=True)
class Constants:
    """Section constants at the quadrature points, each (m,)."""

    area: Array
    inertia_up: Array  # bending that moves the beam along its height
    inertia_side: Array
    torsion: Array
    shear_up: Array  # shear area along the height
    shear_side: Array


def constants(start: Section, end: Section, at: Array) -> Constants:
    """Constants of the section at the fractions ``at`` of the link's length; dimensions taper linearly."""
    w = start.width + (end.width - start.width) * at
    h = start.height + (end.height - start.height) * at
    t = start.wall + (end.wall - start.wall) * at
    if start.kind == "tube":
        inner = w - 2 * t
        area = np.pi / 4 * (w**2 - inner**2)
        inertia = np.pi / 64 * (w**4 - inner**4)
        return Constants(area, inertia, inertia, 2 * inertia, area / 2, area / 2)
    b, c = w - 2 * t, h - 2 * t
    middle_w, middle_h = w - t, h - t
    return Constants(
        area=w * h - b * c,
        inertia_up=(w * h**3 - b * c**3) / 12,
        inertia_side=(h * w**3 - c * b**3) / 12,
        torsion=2 * t * (middle_w * middle_h) ** 2 / (middle_w + middle_h),
        shear_up=2 * t * middle_h,
        shear_side=2 * t * middle_w,
    )


def skew(v: Array) -> Array:
    """Matrices (..., 3, 3) with skew(v) @ x = v x x."""
    zero = np.zeros_like(v[..., 0])
    rows = [[zero, -v[..., 2], v[..., 1]], [v[..., 2], zero, -v[..., 0]], [-v[..., 1], v[..., 0], zero]]
    return np.stack([np.stack(row, -1) for row in rows], -2)


def transfer(here: Array, there: Array) -> Array:
    """(n, 6, 6): the wrench seen at ``here`` (n, 3) of a wrench given at ``there``."""
    T = np.tile(np.eye(6), (len(here), 1, 1))
    T[:, 3:, :3] = skew(there - here)
    return T


def beam(points: Array, up: Array, ends: tuple[Section, Section], elastic: tuple[float, float], load: Array) -> Array:
    """Compliance by mode (4, n, 6, 6) of one polyline.

    ``points`` (n, m, 3) base axes, ``up`` (n, 3), ``load`` (n, 6, 6): the wrench at the polyline's last point
    as a linear map of the wrench at the tool point. ``elastic`` is Young's modulus and Poisson's ratio.
    """
    E, G = elastic[0], elastic[0] / (2 * (1 + elastic[1]))
    n = len(points)
    C = np.zeros((4, n, 6, 6))
    lengths = np.linalg.norm(np.diff(points, axis=1), axis=2)[0]
    total, before = lengths.sum(), 0.0
    for k, length in enumerate(lengths):
        if length < 1e-9:
            continue
        a, b = points[:, k], points[:, k + 1]
        along = (b - a) / length
        high = up - np.einsum("ni,ni->n", up, along)[:, None] * along
        high = high / np.linalg.norm(high, axis=1, keepdims=True)
        side = np.cross(high, along)
        local = np.stack([along, side, high], 1)  # rows
        s = constants(*ends, (before + length * (NODES + 1) / 2) / total)
        for g in range(len(NODES)):
            x = a + (NODES[g] + 1) / 2 * (b - a)
            section = transfer(x, points[:, -1]) @ load
            force, moment = local @ section[:, :3], local @ section[:, 3:]
            dx = WEIGHTS[g] * length / 2
            # Moment about `side` bends along `high`.
            parts = (
                (0, moment[:, 1], E * s.inertia_up[g]),
                (0, moment[:, 2], E * s.inertia_side[g]),
                (1, force[:, 1], G * s.shear_side[g]),
                (1, force[:, 2], G * s.shear_up[g]),
                (2, moment[:, 0], G * s.torsion[g]),
                (3, force[:, 0], E * s.area[g]),
            )
            for mode, row, rigidity in parts:
                C[mode] += dx / rigidity * row[:, :, None] * row[:, None, :]
        before += length
    return C


def link_compliances(arm: Arm, at: Frames) -> dict[str, Array]:
    """Compliance (4, n, 6, 6) at the tool point by link; with the parallelogram also of ``bar`` and ``crank``."""
    n = len(at.tool)
    found = {}
    bar, bar_force, along = None, None, None
    if arm.parallelogram and arm.bar is not None:
        bar = arm.bar
        along = at.origins[:, 3] - at.origins[:, 2]
        length = np.linalg.norm(along, axis=1)
        along = along / length[:, None]
        N = bar_row(arm, at)
        bar_force = np.zeros((n, 6, 6))  # the bar's pull on the forearm, at the pin
        bar_force[:, :3] = -along[:, :, None] * N[:, None, :]
        pin = at.origins[:, 3] + at.rotations[:, 3] @ bar.pin
    for link in arm.links:
        R, o = at.rotations[:, link.body], at.origins[:, link.body]
        points = o[:, None] + np.einsum("nij,mj->nmi", R, link.points)
        up = R @ link.up
        ends, elastic = (link.start, link.end), (link.youngs, link.poisson)
        load = transfer(points[:, -1], at.tool)
        if bar is not None and link.body == 2:
            # The elbow passes the bar's pull on to the upper arm and no moment about its own axis.
            load = load + transfer(points[:, -1], pin) @ bar_force
            y = at.axes[:, 2]
            load[:, 3:] -= y[:, :, None] * np.einsum("ni,nij->nj", y, load[:, 3:])[:, None, :]
        C = beam(points, up, ends, elastic, load)
        if bar is not None and link.body == 3:
            lever = np.stack([points[:, 0], pin], 1)
            C = C + beam(lever, up, (link.start, link.start), elastic, bar_force)
        found[link.name] = C
    if bar is not None and bar_force is not None and along is not None:
        shoulder = at.origins[:, 2]
        crank_pin = shoulder + at.rotations[:, 3] @ bar.pin
        crank = np.stack([shoulder, crank_pin], 1)
        up = at.rotations[:, 3] @ np.array([1.0, 0, 0])
        elastic = (bar.youngs, bar.poisson)
        found["crank"] = beam(crank, up, (bar.crank, bar.crank), elastic, bar_force)
        rod = np.stack([crank_pin, pin], 1)
        side = np.cross(along, at.axes[:, 2])
        found["bar"] = beam(rod, side, (bar.bar, bar.bar), elastic, bar_force)
    return found
