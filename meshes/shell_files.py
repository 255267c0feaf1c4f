"""Prepared shell meshes on disk: NumPy's .npz with a schema version, no pickles."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from meshes.npz import from_npz, to_npz
from meshes.shell_mesh import ShellMesh
from robots import InputError
from robots.files.reading import read_bytes
from robots.files.written import write_whole

SCHEMA = "stiffarm-shell/1"
# NumPy's kind of each array's numbers.
_KINDS = {
    "schema": "U",
    "name": "U",
    "nodes": "f",
    "triangles": "iu",
    "quads": "iu",
    "thickness": "f",
    "youngs_modulus": "f",
    "poissons_ratio": "f",
    "interfaces": "U",
}
_REMEDY = "import the link's surface again, or put the file back that the model was written with"


def save_shell(mesh: ShellMesh, path: Path | str) -> str:
    """Write a shell mesh, whole or not at all; returns the SHA-256 of the file's bytes.

    Equal meshes give equal bytes. Errors of the system (no space, no access) are raised as they are.
    """
    path = Path(path)
    arrays: dict[str, NDArray[Any]] = {
        "schema": np.array(SCHEMA),
        "name": np.array(mesh.name),
        "nodes": np.asarray(mesh.nodes, dtype=np.float64),
        "triangles": np.asarray(mesh.triangles, dtype=np.int64),
        "quads": np.asarray(mesh.quads, dtype=np.int64),
        "thickness": np.asarray(mesh.thickness, dtype=np.float64),
        "youngs_modulus": np.array(mesh.youngs_modulus, dtype=np.float64),
        "poissons_ratio": np.array(mesh.poissons_ratio, dtype=np.float64),
        "interfaces": np.array(list(mesh.interfaces), dtype=np.str_),
    }
    arrays |= {f"ring_{i}": np.asarray(ring, dtype=np.int64) for i, ring in enumerate(mesh.interfaces.values())}
    content = to_npz(arrays)
    write_whole(path, content)
    return hashlib.sha256(content).hexdigest()


def load_shell(path: Path | str, sha256: str | None = None, name: str | None = None) -> ShellMesh:
    """Read a shell mesh that :func:`save_shell` wrote.

    Parameters
    ----------
    sha256 : digest that the file's bytes must have, if given
    name : takes the place of the mesh's name in the file

    Raises
    ------
    InputError
        The file is missing, cannot be read, is not the one with that digest, is damaged, of another schema
        version, or holds no valid mesh.
    """
    where = f"shell file {path}"
    content = read_bytes(path, "shell file", remedy=_REMEDY)
    found = hashlib.sha256(content).hexdigest()
    if sha256 is not None and found != sha256.lower():
        raise InputError(
            f"{where} has changed since the model was written, or is damaged: SHA-256",
            value=found,
            allowed=sha256,
            remedy=_REMEDY,
        )
    try:
        arrays = from_npz(content)
    except ValueError as error:
        raise InputError(f"{where} is damaged ({error})", remedy=_REMEDY) from error
    _check_arrays(where, arrays)
    names = [str(interface) for interface in arrays["interfaces"]]
    try:
        return ShellMesh(
            name=str(arrays["name"]) if name is None else name,
            nodes=arrays["nodes"].astype(np.float64),
            triangles=arrays["triangles"].astype(np.int64),
            quads=arrays["quads"].astype(np.int64),
            thickness=arrays["thickness"].astype(np.float64),
            youngs_modulus=float(arrays["youngs_modulus"]),
            poissons_ratio=float(arrays["poissons_ratio"]),
            interfaces={interface: arrays[f"ring_{i}"].astype(np.int64) for i, interface in enumerate(names)},
        )
    except InputError as error:
        raise InputError(f"{where} holds no valid mesh ({error})", remedy=_REMEDY) from error


def _check_arrays(where: str, arrays: dict[str, NDArray[np.generic]]) -> None:
    """Refuse files of another kind or version."""
    schema = arrays.get("schema")
    if schema is None or schema.ndim or schema.dtype.kind != "U" or str(schema) != SCHEMA:
        raise InputError(
            f"{where}: schema",
            value="none" if schema is None else str(schema),
            allowed=SCHEMA,
            remedy="import the link's surface again with this version of stiffarm",
        )
    count = arrays["interfaces"].size if "interfaces" in arrays else 0
    kinds = _KINDS | {f"ring_{i}": "iu" for i in range(count)}
    single = {"schema", "name", "youngs_modulus", "poissons_ratio"}
    wrong = [
        key
        for key, kind in kinds.items()
        if key not in arrays or arrays[key].dtype.kind not in kind or (arrays[key].ndim == 0) != (key in single)
    ]
    if wrong or arrays["interfaces"].ndim != 1 or len(set(arrays["interfaces"].tolist())) != count:
        raise InputError(
            f"{where} is damaged: arrays missing, or of the wrong kind", value=", ".join(wrong or ["interfaces"]),
            remedy=_REMEDY,
        )  # fmt: skip
