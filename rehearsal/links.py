"""Link flexibility by Castigliano: energy of the section forces, integrated along each link (Timoshenko)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rehearsal.arm import Arm, Bar, Link, Section
from rehearsal.kinematics import Frames
from rehearsal.statics import bar_row, elbow_and_shoulder, pull_of_bar, transfer
from robots.arrays import Array

# Eight Gauss points a segment: a linear taper's 1/I is smooth, the rest is exact to round-off.
NODES, WEIGHTS = np.polynomial.legendre.leggauss(8)
PARALLEL = 1e-6
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


def beam(
    points: Array,
    up: Array,
    ends: tuple[Section, Section],
    elastic: tuple[float, float],
    load: Array,
    axes: Array | None = None,
) -> Array:
    """Compliance by mode (4, n, 6, 6) of one polyline.

    ``points`` (n, m, 3) base axes, ``up`` (n, 3), ``load`` (n, 6, 6): the wrench at the polyline's last point
    as a linear map of the wrench at the tool point. ``elastic`` is Young's modulus and Poisson's ratio; ``axes``
    (n, 3, 3) those of the body, as columns, which take the place of an ``up`` along the beam.
    """
    E, G = elastic[0], elastic[0] / (2 * (1 + elastic[1]))
    n = len(points)
    axes = np.tile(np.eye(3), (n, 1, 1)) if axes is None else axes
    C = np.zeros((4, n, 6, 6))
    lengths = np.linalg.norm(np.diff(points, axis=1), axis=2)[0]
    total, before = lengths.sum(), 0.0
    for k, length in enumerate(lengths):
        if length < 1e-9:
            continue
        a, b = points[:, k], points[:, k + 1]
        along = (b - a) / length
        high = up - np.einsum("ni,ni->n", up, along)[:, None] * along
        across = np.linalg.norm(high, axis=1, keepdims=True)
        if np.any(across < PARALLEL):
            # Of a beam along the direction of its own height, as of a round one: any direction across.
            own = np.abs(np.einsum("nji,nj->ni", axes, along)[0])
            other = axes[:, :, own.argmin()]
            other = other - np.einsum("ni,ni->n", other, along)[:, None] * along
            high = np.where(across < PARALLEL, other, high)
            across = np.linalg.norm(high, axis=1, keepdims=True)
        high = high / across
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
    bar = arm.bar_at_work
    pulled = None if bar is None else (bar, *pull_of_bar(arm, bar, at))
    found = {link.name: _link(link, at, pulled) for link in arm.links}
    if bar is not None and pulled is not None:
        found |= _bar_and_crank(arm, bar, at, pulled[1], pulled[2])
    return found


def _link(link: Link, at: Frames, pulled: tuple[Bar, Array, Array] | None) -> Array:
    R, o = at.rotations[:, link.body], at.origins[:, link.body]
    points = o[:, None] + np.einsum("nij,mj->nmi", R, link.points)
    up = R @ link.up
    ends, elastic = (link.start, link.end), (link.youngs, link.poisson)
    load = transfer(points[:, -1], at.tool)
    if pulled is not None and link.body == pulled[0].crank_about + 1:
        # The elbow passes the bar's pull on to the upper arm and no moment about its own axis.
        load = load + transfer(points[:, -1], pulled[2]) @ pulled[1]
        y = at.axes[:, pulled[0].driven]
        load[:, 3:] -= y[:, :, None] * np.einsum("ni,nij->nj", y, load[:, 3:])[:, None, :]
    C = beam(points, up, ends, elastic, load, R)
    if pulled is not None and link.body == pulled[0].driven + 1:
        lever = np.stack([points[:, 0], pulled[2]], 1)
        C = C + beam(lever, up, (link.start, link.start), elastic, pulled[1])
    return C


def _bar_and_crank(arm: Arm, bar: Bar, at: Frames, pull: Array, pin: Array) -> dict[str, Array]:
    elbow, shoulder = elbow_and_shoulder(bar, at)
    along = elbow - shoulder
    along = along / np.linalg.norm(along, axis=1)[:, None]
    turned = at.rotations[:, bar.driven + 1]
    crank_pin = shoulder + turned @ bar.pin
    crank = beam(
        np.stack([shoulder, crank_pin], 1),
        turned @ np.array([1.0, 0, 0]),
        (bar.crank, bar.crank),
        (bar.youngs, bar.poisson),
        pull,
    )
    if bar.stiffness is not None:
        rod = np.zeros_like(crank)
        rod[MODES.index("axial")] = described_bar(arm, at)
    else:
        side = np.cross(along, at.axes[:, bar.driven])
        rod = beam(np.stack([crank_pin, pin], 1), side, (bar.bar, bar.bar), (bar.bar_youngs, bar.poisson), pull)
    return {"crank": crank, "bar": rod}


def described_bar(arm: Arm, at: Frames) -> Array:
    """Compliance (n, 6, 6) at the tool point of a bar whose stiffness the model gives; zero where it does not."""
    bar = arm.bar_at_work
    if bar is None or bar.stiffness is None:
        return np.zeros((len(at.tool), 6, 6))
    row = bar_row(arm, at)
    return np.asarray(row[:, :, None] * row[:, None, :] / bar.stiffness)
