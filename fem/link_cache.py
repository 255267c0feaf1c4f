"""Condensed shell links, kept between runs under a hash of all that decides them."""

from __future__ import annotations

import ast
import hashlib
import importlib.util
from collections.abc import Mapping
from functools import cache
from importlib.metadata import version
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fem.condensation import Superelement
from fem.couplings import Coupling
from fem.shell import shell_superelement
from meshes.array_cache import ArrayCache, user_cache
from meshes.shell_mesh import ShellMesh

Array = NDArray[np.float64]

FORMAT = "stiffarm-superelement/1"
# The module whose result is kept; those it imports from this package decide it too.
_ROOT = "fem.shell"
_LIBRARIES = ("numpy", "scipy", "scikit-fem")


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
    formulation = formulation_hash()
    if formulation is None:
        return None
    digest = hashlib.sha256()
    _add(digest, f"{FORMAT} {formulation}")
    _add(digest, repr((float(mesh.youngs_modulus), float(mesh.poissons_ratio))))
    for array in (mesh.nodes, mesh.triangles, mesh.quads, mesh.thickness, points):
        _add(digest, np.asarray(array))
    for name, ring in mesh.interfaces.items():
        _add(digest, f"{name} {couplings.get(name)}")
        _add(digest, ring)
    return str(digest.hexdigest())


@cache
def formulation_hash() -> str | None:
    """SHA-256 of the source of all modules of this package that decide a superelement, and of the libraries' versions.

    None where a source cannot be read, as in a frozen program.
    """
    digest = hashlib.sha256()
    try:
        for name, source in sorted(_sources(_ROOT).items()):
            _add(digest, f"{name}\n{source}")
    except (OSError, SyntaxError):
        return None
    for library in _LIBRARIES:
        _add(digest, f"{library} {version(library)}")
    return str(digest.hexdigest())


def _sources(root: str) -> dict[str, str]:
    """Source of a module and of those that it imports from its own package, at any depth."""
    package = root.partition(".")[0]
    found: dict[str, str] = {}
    waiting = [root]
    while waiting:
        name = waiting.pop()
        if name in found:
            continue
        found[name] = _source(name)
        waiting += _imported(found[name], package)
    return found


def _imported(source: str, package: str) -> list[str]:
    """Names of the package's modules that a source imports, in any of the three ways."""
    names: list[str] = []
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module == package:
            inside = [f"{package}.{alias.name}" for alias in node.names]
            names += [name for name in inside if importlib.util.find_spec(name) is not None]
        elif isinstance(node, ast.ImportFrom) and node.module is not None:
            names.append(node.module)
    return [name for name in names if name.startswith(f"{package}.")]


def _source(name: str) -> str:
    spec = importlib.util.find_spec(name)
    get_source = getattr(None if spec is None else spec.loader, "get_source", None)
    text = None if get_source is None else get_source(name)
    if not isinstance(text, str):
        raise OSError(f"{name} has no source")
    return text


def _add(digest: Any, content: str | NDArray[np.generic]) -> None:
    """Feed a text, or an array with its type and shape, so that no two contents run into one another."""
    if isinstance(content, str):
        data = content.encode()
        digest.update(f"text {len(data)}\n".encode() + data)
        return
    kind = np.float64 if np.issubdtype(content.dtype, np.floating) else np.int64
    array = np.ascontiguousarray(content, dtype=np.dtype(kind).newbyteorder("<"))
    digest.update(f"array {array.dtype.str} {array.shape}\n".encode() + array.tobytes())


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
