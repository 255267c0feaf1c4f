"""Prepared meshes of links on disk: NumPy's .npz with a schema version and the nodes of each interface, no pickles."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from meshes.array_cache import from_npz, to_npz
from robots import InputError
from robots.arrays import Array, Integers
from robots.files.written import write_whole

# NumPy's kind of each array's numbers that all of them have; single values, not arrays.
_KINDS = {"schema": "U", "name": "U", "nodes": "f", "youngs_modulus": "f", "poissons_ratio": "f", "interfaces": "U"}
_SINGLE = {"schema", "name", "youngs_modulus", "poissons_ratio"}
REMEDY = "import the link's surface again, or put the file back that the model was written with"
AGAIN = "import the link's surface again for this model"
# A ring's middle lies no further from its interface point than this many radii of the ring, or this share of the
# longest way between interfaces: joints stand off their casings, as wrist centres do beyond forearms (0.7 of the
# way in a Panda).
FARTHEST, STAND_OFF = 3.0, 0.75


def write_mesh(schema: str, arrays: Mapping[str, Any], interfaces: Mapping[str, Integers], path: Path | str) -> str:
    """Write a mesh's arrays, whole or not at all; returns the SHA-256 of the file's bytes.

    Equal meshes give equal bytes. Errors of the system (no space, no access) are raised as they are.
    """
    path = Path(path)
    content: dict[str, NDArray[Any]] = {"schema": np.array(schema)}
    for key, value in arrays.items():
        whole = np.issubdtype(np.asarray(value).dtype, np.integer)
        content[key] = (
            np.array(value) if isinstance(value, str) else np.asarray(value, np.int64 if whole else np.float64)
        )
    content["interfaces"] = np.array(list(interfaces), dtype=np.str_)
    content |= {f"ring_{i}": np.asarray(ring, dtype=np.int64) for i, ring in enumerate(interfaces.values())}
    packed = to_npz(content)
    write_whole(path, packed)
    return hashlib.sha256(packed).hexdigest()


def read_mesh(
    content: bytes, where: str, schema: str, kinds: Mapping[str, str], sha256: str | None
) -> tuple[dict[str, Any], dict[str, Integers]]:
    """Arrays of a mesh file, and the nodes of its interfaces.

    Parameters
    ----------
    content, where : the file's bytes, and what messages call it, as in "shell file arm.npz"
    kinds : NumPy's kind of the numbers of each array beside those that all meshes have
    sha256 : digest that the bytes must have, if given

    Raises
    ------
    InputError
        The file is not the one with that digest, is damaged, or of another schema version.
    """
    found = hashlib.sha256(content).hexdigest()
    if sha256 is not None and found != sha256.lower():
        raise InputError(
            f"{where} has changed since the model was written, or is damaged: SHA-256",
            code="F007",
            value=found,
            allowed=sha256,
            remedy=REMEDY,
        )
    try:
        arrays = from_npz(content)
    except ValueError as error:
        raise InputError(f"{where} is damaged ({error})", code="F007", remedy=REMEDY) from error
    _check_arrays(where, schema, {**_KINDS, **kinds}, arrays)
    names = [str(interface) for interface in arrays["interfaces"]]
    rings = {interface: arrays[f"ring_{i}"].astype(np.int64) for i, interface in enumerate(names)}
    fields: dict[str, Any] = {"name": str(arrays["name"])}
    fields |= {key: float(arrays[key]) for key in ("youngs_modulus", "poissons_ratio")}
    for key in ("nodes", *kinds):
        fields[key] = arrays[key].astype(np.float64 if arrays[key].dtype.kind == "f" else np.int64)
    return fields, rings


def _check_arrays(where: str, schema: str, kinds: Mapping[str, str], arrays: dict[str, NDArray[np.generic]]) -> None:
    """Refuse files of another kind or version."""
    given = arrays.get("schema")
    if given is None or given.ndim or given.dtype.kind != "U" or str(given) != schema:
        raise InputError(
            f"{where}: schema",
            code="F006",
            value="none" if given is None else str(given),
            allowed=schema,
            remedy="import the link's surface again with this version of stiffarm",
        )
    count = arrays["interfaces"].size if "interfaces" in arrays else 0
    kinds = {**kinds} | {f"ring_{i}": "iu" for i in range(count)}
    wrong = [
        key
        for key, kind in kinds.items()
        if key not in arrays or arrays[key].dtype.kind not in kind or (arrays[key].ndim == 0) != (key in _SINGLE)
    ]
    if wrong or arrays["interfaces"].ndim != 1 or len(set(arrays["interfaces"].tolist())) != count:
        raise InputError(
            f"{where} is damaged: arrays missing, or of the wrong kind",
            code="F007",
            value=", ".join(wrong or ["interfaces"]),
            remedy=REMEDY,
        )


def check_fits(
    where: str,
    nodes: Array,
    rings: Mapping[str, Integers],
    interfaces: Mapping[str, Array],
    axes: Mapping[str, Array] | None = None,
) -> None:
    """Refuse a mesh whose rings are not those of a link's interfaces, points (3,) m by name, or lie away from them.

    ``axes`` (3,): of the joints there, as unit vectors; a joint's frame may be anywhere on its axis.
    """
    if set(rings) != set(interfaces):
        raise InputError(
            f"{where}: interfaces",
            code="L006",
            value=", ".join(rings) or "none",
            allowed=f"exactly {', '.join(interfaces)}",
            remedy=AGAIN,
        )
    points = np.stack(list(interfaces.values()))
    way = float(np.linalg.norm(points[:, None] - points[None], axis=2).max())
    for name, point in interfaces.items():
        ring = nodes[rings[name]]
        middle = ring.mean(axis=0)
        apart = middle - point
        if axes is not None and name in axes:
            apart = apart - axes[name] * (axes[name] @ apart)
        radius, distance = np.linalg.norm(ring - middle, axis=1).max(), np.linalg.norm(apart)
        limit = max(FARTHEST * radius, STAND_OFF * way)
        if distance > limit:
            raise InputError(
                f"{where}: the middle of ring {name} is {1e3 * distance:.4g} mm from the link's interface at "
                f"{np.round(point, 4).tolist()} m",
                code="L006",
                allowed=f"at most {1e3 * limit:.4g} mm: {FARTHEST:g} radii of the ring or {STAND_OFF:g} of the link",
                remedy=f"{AGAIN}: its geometry has changed since, or the file belongs to another link",
            )
