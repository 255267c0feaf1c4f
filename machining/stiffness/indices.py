"""Stiffness indices of a machining pose, from the translational compliance C_tt at the tool point.

Notation: n unit normal of the surface, F force on the tool, d = C_tt F its displacement. All are N/m except isotropy.
`INDICES` holds each index with its formula, its source and what leaves it unchanged. None depends on how the base or
tool *axes* are turned, as long as n and F are turned with them. All depend on the tool *point*, and on the load if
C_tt is that of the loaded arm (:mod:`machining.stiffness.loaded`).

Relations: ``weakest <= k_fs(n) <= 1/(n.C n)``, and along n = F/|F| the NSPI is ``1/(n.C n)`` and the Rayleigh quotient
is k_fs. None of these looks at the tool's rotation.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

import fem
from machining.inputs import as_compliances, as_units, as_vectors
from machining.stiffness.cartesian import inverse
from machining.stiffness.ellipsoid import ellipsoid_radius, reciprocal, stiffness_ellipsoid
from robots import InputError, require_one_of
from robots.arrays import Array

Change = Literal[
    "normal",
    "normal sign",
    "force direction",
    "force sign",
    "force size",
    "tool point along the normal",
]
CHANGES: tuple[Change, ...] = (
    "normal",
    "normal sign",
    "force direction",
    "force sign",
    "force size",
    "tool point along the normal",
)
_NO_FORCE: frozenset[Change] = frozenset({"force direction", "force sign", "force size"})
_NO_NORMAL: frozenset[Change] = frozenset({"normal", "normal sign"})

GAO = "Gao 2024, doi:10.1109/ACCESS.2024.3435911"


def normal_stiffness_index(C_tt: ArrayLike, normal: ArrayLike) -> Array:
    """k_fs = 1 / |C_tt n| (n,) N/m: force along the normal for a unit displacement in any direction (Gao 2024, eq. 12).

    ``C_tt`` (n, 3, 3) m/N; ``normal`` (3,) or (n, 3), any length, same axes.

    Raises
    ------
    InputError
        Shapes, values that are not finite, or a normal of length zero.
    """
    C = as_compliances(C_tt)
    return ellipsoid_radius(C, as_units("surface normal", normal, len(C)))


def stiffness_index(model: fem.ArmModel, q: Array, normal: ArrayLike, point: Array | None = None) -> Array:
    """k_fs (n,) N/m of a model at poses q (n, dof) rad without forming C_tt: the fast way for maps.

    ``normal`` (3,) or (n, 3) base axes; ``point`` as in :func:`fem.deflection`. Errors as there, and a normal of
    length zero.
    """
    unit = as_units("surface normal", normal, len(q))
    d = fem.deflection(model, q, np.hstack([unit, np.zeros_like(unit)]), point)[:, :3]
    return reciprocal(np.linalg.norm(d, axis=1))


def nspi(C_tt: ArrayLike, normal: ArrayLike, force: ArrayLike) -> Array:
    """Normal stiffness performance index |F| / |n . C_tt F| (n,) N/m (Gao 2024, eq. 13, after Chen et al. 2019).

    ``force`` (3,) or (n, 3) N. Infinite where the force moves the tool along the surface only: a large value does not
    mean a stiff arm.

    Raises
    ------
    InputError
        As :func:`normal_stiffness_index`, and a force of length zero.
    """
    C = as_compliances(C_tt)
    n = as_units("surface normal", normal, len(C))
    u = as_units("force", force, len(C))
    return reciprocal(np.abs(np.einsum("ni,nij,nj->n", n, C, u)))


def rayleigh_quotient(C_tt: ArrayLike, displacement: ArrayLike) -> Array:
    """R_K = |K_tt d| / |d| (n,) N/m with K_tt = C_tt^-1 (Gao 2024, eq. 14, after Tian et al. 2017).

    ``displacement`` (3,) or (n, 3) m, any length. For the displacement that a force causes it is |F| / |d|, the inverse
    of what it is meant to predict: see :func:`rayleigh_of_force`.

    Raises
    ------
    InputError
        Shapes, values that are not finite, a displacement of length zero, or a C_tt without an inverse.
    """
    C = as_compliances(C_tt)
    d = as_units("displacement", displacement, len(C))
    return np.asarray(np.linalg.norm(np.einsum("nij,nj->ni", inverse(C, "Rayleigh quotient"), d), axis=1))


def rayleigh_of_force(C_tt: ArrayLike, force: ArrayLike) -> Array:
    """R_K (n,) N/m of the displacement d = C_tt F: |F| / |C_tt F|; needs no inverse.

    The radius of the stiffness ellipsoid along F. Errors as :func:`nspi`.
    """
    C = as_compliances(C_tt)
    return ellipsoid_radius(C, as_units("force", force, len(C)))


def directional_stiffness(C_tt: ArrayLike, direction: ArrayLike) -> Array:
    """1 / (n . C_tt n) (n,) N/m: force along n over the displacement along n, the tool free to move sideways.

    The same as :func:`fem.directional_stiffness`, from C_tt and with a direction a pose. Errors as
    :func:`normal_stiffness_index`.
    """
    C = as_compliances(C_tt)
    n = as_units("direction", direction, len(C))
    return reciprocal(np.einsum("ni,nij,nj->n", n, C, n))


def average_stiffness(C_tt: ArrayLike) -> Array:
    """3 / trace C_tt (n,) N/m: inverse of the directional compliance's mean over all directions.

    Raises
    ------
    InputError
        Shape, or values that are not finite.
    """
    return reciprocal(np.trace(as_compliances(C_tt), axis1=1, axis2=2) / 3.0)


@dataclass(frozen=True)
class Index:
    """An index: what it is, where it comes from, what leaves it unchanged.

    ``compute(C_tt, normal, force)`` -> (n,); ``uses``: which of normal and force it reads; ``unchanged_by``: of
    :data:`CHANGES`, proved by a test that the others do change it; ``degree``: power of the arm's stiffness, so also of
    the unit: 1 for N/m (times 1e-3 in N/mm), 0 for a pure number.
    """

    name: str
    formula: str
    meaning: str
    source: str
    uses: tuple[Literal["normal", "force"], ...]
    unchanged_by: frozenset[Change]
    compute: Callable[[Array, Array, Array], Array]
    degree: int = 1


INDICES: Mapping[str, Index] = {
    index.name: index
    for index in (
        Index(
            "k_fs",
            "1 / |C_tt n|",
            "force along the normal for a unit displacement in any direction",
            f"{GAO}, eq. 12",
            ("normal",),
            _NO_FORCE | {"normal sign"},
            lambda C, n, F: normal_stiffness_index(C, n),
        ),
        Index(
            "nspi",
            "|F| / |n . C_tt F|",
            "given force over the displacement along the normal",
            f"{GAO}, eq. 13, after Chen et al., Robot. Comput.-Integr. Manuf. 55 (2019) 29-40",
            ("normal", "force"),
            frozenset({"normal sign", "force sign", "force size"}),
            nspi,
        ),
        Index(
            "rayleigh",
            "|F| / |C_tt F|",
            "given force over the displacement in any direction",
            f"{GAO}, eq. 14, after Tian et al., J. Adv. Mech. Des. Syst. Manuf. 11 (2017) JAMDSM0022",
            ("force",),
            _NO_NORMAL | {"force sign", "force size"},
            lambda C, n, F: rayleigh_of_force(C, F),
        ),
        Index(
            "directional",
            "1 / (n . C_tt n)",
            "force along the normal over the displacement along the normal",
            "definition of stiffness along a line",
            ("normal",),
            _NO_FORCE | {"normal sign", "tool point along the normal"},
            lambda C, n, F: directional_stiffness(C, n),
        ),
        Index(
            "weakest",
            "1 / largest principal compliance",
            "stiffness in the worst direction; the short semi-axis of the ellipsoid",
            f"{GAO}, eqs. 8 to 11",
            (),
            _NO_FORCE | _NO_NORMAL,
            lambda C, n, F: stiffness_ellipsoid(C).weakest,
        ),
        Index(
            "strongest",
            "1 / smallest principal compliance",
            "stiffness in the best direction; the long semi-axis of the ellipsoid",
            f"{GAO}, eqs. 8 to 11",
            (),
            _NO_FORCE | _NO_NORMAL,
            lambda C, n, F: stiffness_ellipsoid(C).strongest,
        ),
        Index(
            "mean",
            "det(C_tt)^(-1/3)",
            "radius of the sphere with the ellipsoid's volume",
            "geometric mean of the principal stiffnesses; the idea of a determinant is that of Guo, Dong and Ke, "
            "Robot. Comput.-Integr. Manuf. 35 (2015) 69-76 (cited from memory)",
            (),
            _NO_FORCE | _NO_NORMAL,
            lambda C, n, F: stiffness_ellipsoid(C).mean,
        ),
        Index(
            "average",
            "3 / trace C_tt",
            "inverse of the directional compliance averaged over all directions",
            "mean of a quadratic form over the sphere",
            (),
            _NO_FORCE | _NO_NORMAL,
            lambda C, n, F: average_stiffness(C),
        ),
        Index(
            "isotropy",
            "weakest / strongest",
            "1: equally stiff all round; 0: a direction is rigid",
            "conventional stiffness isotropy, as in Gorgulu and Dede 2019, doi:10.3390/machines7020044",
            (),
            _NO_FORCE | _NO_NORMAL,
            lambda C, n, F: stiffness_ellipsoid(C).isotropy,
            degree=0,
        ),
    )
}


def evaluate(name: str, C_tt: ArrayLike, normal: ArrayLike | None = None, force: ArrayLike | None = None) -> Array:
    """One index of :data:`INDICES` by name, (n,).

    Raises
    ------
    InputError
        No such index, or the normal or force that it needs is missing; else as the index's own function.
    """
    require_one_of("stiffness index", name, INDICES, code="S015")
    index, C = INDICES[name], as_compliances(C_tt)
    given = {"normal": normal, "force": force}
    for need in index.uses:
        if given[need] is None:
            raise InputError(
                f"{need} for index {name}", code="S015", allowed="a vector in base axes", remedy=f"give the {need}"
            )
    unused = np.array([0.0, 0.0, 1.0])
    n = unused if normal is None else as_vectors("surface normal", normal, len(C), "a direction in base axes")
    F = unused if force is None else as_vectors("force", force, len(C), "N")
    return index.compute(C, np.broadcast_to(n, (len(C), 3)), np.broadcast_to(F, (len(C), 3)))
