"""Condensed shell links, kept between runs under a hash of all that decides them."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from fem.condensation import Superelement
from fem.couplings import Coupling
from fem.shell import shell_superelement
from meshes.array_cache import ArrayCache, user_cache
from meshes.formulation import add_to, formulation_hash
from meshes.shell_mesh import ShellMesh

Array = NDArray[np.float64]

FORMAT = "stiffarm-superelement/1"
# The module whose result is kept; those it imports from this package decide it too.
_ROOT = "fem.shell"


def cached_superelement(
    mesh: ShellMesh, points: Array, couplings: Mapping[str, Coupling], store: ArrayCache | None = None
) -> Superelement:
    """:func:`fem.shell.shell_superelement`, from the user's cache if it is there: the same numbers bit for bit.

    ``couplings``: one for each interface. ``store``: another cache than :func:`meshes.array_cache.user_cache`.
    Links that one solver of :mod:`fem.condensation` condensed serve where another is installed: they agree to
    round-off.
    """
    store = user_cache() if store is None else store
    points = np.asarray(points, dtype=np.float64)
    key = superelement_key(mesh, points, couplings)
    kept = None if key is None else store.get(key, lambda arrays: _fault(arrays, points))
    if kept is not None:
        return Superelement(mesh.name, tuple(mesh.interfaces), points, kept["stiffness"], kept["flexibility"])
    element = shell_superelement(mesh, points, couplings)
    if key is not None:
        arrays = {"points": element.points, "stiffness": element.stiffness, "flexibility": element.flexibility}
        store.put(key, arrays)
    return element


def superelement_key(mesh: ShellMesh, points: Array, couplings: Mapping[str, Coupling]) -> str | None:
    """SHA-256 of mesh, points, couplings and formulation; None where the formulation's source cannot be read.

    Names of link and robot have no part; those of the interfaces and their order do.
    """
    formulation = formulation_hash(_ROOT)
    if formulation is None:
        return None
    digest = hashlib.sha256()
    add_to(digest, f"{FORMAT} {formulation}")
    add_to(digest, repr((float(mesh.youngs_modulus), float(mesh.poissons_ratio))))
    for array in (mesh.nodes, mesh.triangles, mesh.quads, mesh.thickness, points):
        add_to(digest, np.asarray(array))
    for name, ring in mesh.interfaces.items():
        add_to(digest, f"{name} {couplings.get(name)}")
        add_to(digest, ring)
    return str(digest.hexdigest())


def _fault(arrays: dict[str, Array], points: Array) -> str | None:
    """What is wrong with a superelement read back, None if nothing is."""
    size = 6 * len(points)
    shapes = {"points": points.shape, "stiffness": (size, size), "flexibility": (size - 6, size - 6)}
    found = {name: array.shape for name, array in arrays.items()}
    if found != shapes:
        return f"shapes {found}, not {shapes}"
    if not all(array.dtype == np.float64 and np.isfinite(array).all() for array in arrays.values()):
        return "numbers that are not finite"
    if not all(np.array_equal(arrays[name], arrays[name].T) for name in ("stiffness", "flexibility")):
        return "matrices that are not symmetric"
    return None if np.array_equal(arrays["points"], points) else "interface points of another link"
