"""The force-stiffness ellipsoid: all forces that move the tool point by one unit of length.

``F^T C_tt^T C_tt F = 1`` (Gao 2024, eqs. 8 to 11, doi:10.1109/ACCESS.2024.3435911). Its radius along a direction n
is the force along n for a unit displacement in *whatever* direction, ``1 / |C_tt n|``: along a surface normal that is
k_fs (eq. 12). Its axes are the principal stiffnesses.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from machining.inputs import as_compliances, as_units
from robots import InputError
from robots.arrays import Array

# Of the largest principal compliance; below it a direction counts as rigid, its stiffness as infinite.
RIGID = 1e-13


@dataclass(frozen=True)
class StiffnessEllipsoid:
    """Ellipsoids at n poses.

    ``semi_axes`` (n, 3) N/m, from the softest to the stiffest, infinite where nothing deflects; ``axes`` (n, 3, 3):
    column i is the unit vector of semi-axis i, in the axes of the compliance, its sign free. Where two semi-axes are
    equal, their directions are any two in that plane.
    """

    semi_axes: Array
    axes: Array

    @property
    def weakest(self) -> Array:
        """Smallest stiffness (n,) N/m over all directions of the force: the worst case."""
        return self.semi_axes[:, 0]

    @property
    def strongest(self) -> Array:
        """Largest stiffness (n,) N/m."""
        return self.semi_axes[:, 2]

    @property
    def isotropy(self) -> Array:
        """Smallest over largest stiffness (n,), 1 for a sphere, 0 where a direction is rigid."""
        return np.asarray(self.weakest / self.strongest)

    @property
    def volume(self) -> Array:
        """Volume (n,) N^3/m^3."""
        return np.asarray(4.0 / 3.0 * np.pi * np.prod(self.semi_axes, axis=1))

    @property
    def mean(self) -> Array:
        """Geometric mean (n,) N/m of the principal stiffnesses: the radius of the sphere of that volume."""
        # Through logarithms: the product of three stiffnesses may leave the range of floats.
        return np.asarray(np.exp(np.log(self.semi_axes).mean(axis=1)))

    def surface(self, pose: int, across: int = 24, along: int = 48) -> Array:
        """Points (across + 1, along + 1, 3) N/m of one ellipsoid, for drawing.

        Raises
        ------
        InputError
            The ellipsoid is infinite.
        """
        if not np.isfinite(self.semi_axes[pose]).all():
            raise InputError(
                f"stiffness ellipsoid of pose {pose}",
                code="M005",
                value=self.semi_axes[pose].tolist(),
                allowed="finite semi-axes",
                remedy="choose a pose that is not singular",
            )
        theta = np.linspace(0.0, np.pi, across + 1)[:, None]
        phi = np.linspace(0.0, 2.0 * np.pi, along + 1)
        ones = np.ones_like(phi)
        sphere = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta) * ones], axis=-1)
        return np.asarray((sphere * self.semi_axes[pose]) @ self.axes[pose].T)


def stiffness_ellipsoid(C_tt: ArrayLike) -> StiffnessEllipsoid:
    """Ellipsoids of translational compliances (n, 3, 3) m/N.

    By singular values, so the compliance need not be symmetric (an arm that carries a moment). The same function
    serves the rotational block C_rr: its semi-axes are then N m/rad.

    Raises
    ------
    InputError
        Shape, values that are not finite, or an arm in which nothing deflects.
    """
    C = as_compliances(C_tt)
    _, values, turned = np.linalg.svd(C)
    none = values[:, 0] <= 0.0
    if none.any():
        raise InputError(
            f"compliance at pose {int(np.argmax(none))}: nothing deflects",
            code="M005",
            remedy="give the model flexible links or joint springs",
        )
    rigid = values <= RIGID * values[:, :1]
    semi_axes = np.where(rigid, np.inf, 1.0 / np.where(rigid, 1.0, values))
    return StiffnessEllipsoid(semi_axes, np.swapaxes(turned, 1, 2))


def ellipsoid_radius(C_tt: ArrayLike, direction: ArrayLike) -> Array:
    """Radius (n,) N/m along a direction (3,) or (n, 3): |F| over the length of the displacement under F.

    Infinite where that force moves nothing. Errors as :func:`stiffness_ellipsoid`, and a direction of length zero.
    """
    C = as_compliances(C_tt)
    n = as_units("direction", direction, len(C))
    return reciprocal(np.linalg.norm(np.einsum("nij,nj->ni", C, n), axis=1))


def reciprocal(compliance: Array) -> Array:
    """Stiffness of a compliance that is not negative; zero compliance is infinite stiffness."""
    rigid = compliance <= 0.0
    return np.asarray(np.where(rigid, np.inf, 1.0 / np.where(rigid, 1.0, compliance)))
