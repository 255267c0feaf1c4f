"""Condensed links, shells or solids, kept between runs under a hash of all that decides them."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping
from functools import cache

import numpy as np

from fem.elements.condensation import Superelement
from fem.elements.couplings import Coupling
from fem.elements.shell import CoupledShell, LinkMesh, couple, shell_solution, superelement
from meshes.array_cache import ArrayCache, add_to, formulation_hash, user_cache
from meshes.shell_mesh import ShellMesh
from robots.arrays import Array

FORMAT = "stiffarm-superelement/2"
# The module whose result is kept; those it imports from this package decide it too.
_ROOT = "fem.elements.shell"
# Flexibilities that have been checked against their shell in this process, by key.
_checked: dict[str, bytes] = {}


def cached_superelement(
    mesh: LinkMesh, points: Array, couplings: Mapping[str, Coupling], store: ArrayCache | None = None
) -> Superelement:
    """:func:`fem.elements.shell.shell_superelement`, from the user's cache if it is there: bit for bit.

    Kept are the flexibility and one solution, the shell's freedoms under a wrench (:func:`_wrench`). What is read back
    is put into the shell's equations, once a process: that takes a product with the stiffness, a quarter of the time
    of the factorisation that it saves (docs/decisions/fem.md).

    ``couplings``: one for each interface. ``store``: another cache than :func:`meshes.array_cache.user_cache`.
    Links that one solver of :mod:`fem.elements.condensation` condensed serve where another is installed: they agree to
    round-off.
    """
    store = user_cache() if store is None else store
    points = np.asarray(points, dtype=np.float64)
    key = superelement_key(mesh, points, couplings)
    coupled = cache(lambda: couple(mesh, points, couplings))
    kept = None if key is None else store.get(key, lambda arrays: _fault(arrays, key, points, coupled))
    if kept is not None:
        return superelement(mesh, points, kept["flexibility"])
    reduced, flexibility = shell_solution(mesh, coupled())
    if key is not None:
        store.put(key, {"flexibility": flexibility, "solution": reduced @ _wrench(key, flexibility)})
        _checked[key] = flexibility.tobytes()
    return superelement(mesh, points, flexibility)


def superelement_key(mesh: LinkMesh, points: Array, couplings: Mapping[str, Coupling]) -> str | None:
    """SHA-256 of mesh, points, couplings and formulation; None where the formulation's source cannot be read.

    Names of link and robot have no part; those of the interfaces and their order do.
    """
    formulation = formulation_hash(_ROOT)
    if formulation is None:
        return None
    digest = hashlib.sha256()
    add_to(digest, f"{FORMAT} {formulation}")
    add_to(digest, repr((float(mesh.youngs_modulus), float(mesh.poissons_ratio))))
    own = (mesh.triangles, mesh.quads, mesh.thickness) if isinstance(mesh, ShellMesh) else (mesh.tetrahedra,)
    for array in (mesh.nodes, *own, points):
        add_to(digest, np.asarray(array))
    for name, ring in mesh.interfaces.items():
        add_to(digest, f"{name} {couplings.get(name)}")
        add_to(digest, ring)
    return str(digest.hexdigest())


def _wrench(key: str, flexibility: Array) -> Array:
    """Wrench (6(i-1),) in which every component does about the same work, in random proportions that the key decides.

    Another flexibility would have to answer to it by the same motion.
    """
    rng = np.random.default_rng(int(key, 16))
    shares = rng.uniform(0.5, 1.5, len(flexibility)) * rng.choice([-1.0, 1.0], len(flexibility))
    return np.asarray(shares / np.sqrt(np.diag(flexibility)))


def _fault(arrays: dict[str, Array], key: str, points: Array, coupled: Callable[[], CoupledShell]) -> str | None:
    """What is wrong with what was read back, None if nothing is."""
    size = 6 * (len(points) - 1)
    if set(arrays) != {"flexibility", "solution"} or arrays["flexibility"].shape != (size, size):
        return f"arrays { ({name: array.shape for name, array in arrays.items()}) }, not a flexibility ({size}, {size})"
    flexibility, solution = arrays["flexibility"], arrays["solution"]
    if not all(array.dtype == np.float64 and np.isfinite(array).all() for array in arrays.values()):
        return "numbers that are not finite"
    if not np.array_equal(flexibility, flexibility.T) or not (np.diag(flexibility) > 0.0).all():
        return "a flexibility that is not symmetric or not positive"
    if _checked.get(key) == flexibility.tobytes():
        return None
    shell = coupled()
    wrench = _wrench(key, flexibility)
    if solution.shape != shell.stiffness.shape[:1] or not shell.solves(solution, wrench, flexibility @ wrench):
        return "it does not solve this link's equations"
    _checked[key] = flexibility.tobytes()
    return None
