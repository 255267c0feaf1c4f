"""Whether a link's shell may be trusted, by figures that need no truth: where its energy sits, how its wall bends.

A sound casing is stretched and sheared by its loads all over: half of the energy fills several per cent of its surface,
and the tip's tilt goes with the wall's thickness to the power of minus one. A link held by too small a ring, or by a
hollow boss, bends its wall beside the ring: next to nothing of the surface then holds half of the energy, and the power
goes towards minus three.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import trimesh

from fem.elements.assembly import element_stiffness, freedoms
from fem.elements.couplings import Coupling
from fem.elements.link_cache import cached_superelement
from fem.elements.shell import couple
from meshes import ShellMesh
from robots.arrays import Array

# Has no type hints.
_triangles: Any = trimesh.triangles

# By so much the walls change for the exponent.
THICKER = 1.1


@dataclass(frozen=True)
class Trust:
    """Figures of a shell held at its root and loaded at its tip.

    ``half_energy_share``: share of the surface that holds half of the strain energy under unit loads in all
    directions at the tip, the softest counting most. ``wall_exponent``: of the tip's tilt in the wall, with its sign
    turned: 1 where walls are stretched, 3 where they are bent. ``hot`` (3,) m: the middle of that part of the surface.
    """

    half_energy_share: float
    wall_exponent: float
    hot: Array


def trust_in(mesh: ShellMesh, points: Array, couplings: Mapping[str, Coupling]) -> Trust:
    """Figures of a shell of triangles; ``points`` (i, 3) m of its interfaces, the root first and then the tip."""
    shell = couple(mesh, points, dict(couplings))
    shapes, flexibility = shell.modes()
    length = max(float(np.linalg.norm(points[1] - points[0])), float(np.linalg.norm(np.ptp(mesh.nodes, axis=0))) / 4.0)
    loads = np.diag([1.0, 1.0, 1.0, 1.0 / length, 1.0 / length, 1.0 / length])
    energy = np.zeros(len(mesh.triangles))
    K = element_stiffness(mesh)[0]
    at = freedoms(mesh.triangles)
    for load in loads:
        v = (shapes[:, :6] @ load)[at].reshape(len(K), -1)
        energy += np.einsum("ei,eij,ej->e", v, K, v, optimize=True)
    area = _triangles.area(mesh.triangle_corners)
    order = np.argsort(-energy / area)
    half = order[: int(np.searchsorted(np.cumsum(energy[order]), 0.5 * energy.sum())) + 1]
    middle = mesh.triangle_corners.mean(axis=1)[half]
    thicker = replace(mesh, thickness=THICKER * mesh.thickness)
    other = cached_superelement(thicker, points, couplings).flexibility
    tilt, less = (float(np.trace(F[3:6, 3:6])) for F in (flexibility, other))
    return Trust(
        float(area[half].sum() / area.sum()),
        float(-np.log(less / tilt) / np.log(THICKER)),
        np.asarray(energy[half] @ middle / energy[half].sum()),
    )
