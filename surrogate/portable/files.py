"""A surrogate for other programs: ONNX, a C header, a Python file, JavaScript."""

from __future__ import annotations

import importlib.util
from collections.abc import Sequence
from dataclasses import fields
from pathlib import Path
from typing import Final

import numpy as np

from robots import InputError, require_one_of
from robots.files.written import write_whole
from surrogate.model import COMPLIANCE, Surrogate
from surrogate.portable.content import Link, Portable
from surrogate.portable.javascript import javascript
from surrogate.portable.onnx_file import write_onnx
from surrogate.portable.source import c_header, python_snippet
from surrogate.scope import Scope

FORMATS: Final = {
    "onnx": "surrogate.onnx",
    "c": "surrogate.h",
    "python": "surrogate_snippet.py",
    "javascript": "surrogate.js",
}
ENDINGS: Final = {Path(name).suffix: form for form, name in FORMATS.items()}
_TEXTS: Final = {"c": c_header, "python": python_snippet, "javascript": javascript}


def require_formats(names: Sequence[str]) -> None:
    """Refuse an unknown format, and one whose package is missing, before a fit that takes a while.

    Raises
    ------
    InputError
        One of these.
    """
    for name in names:
        require_one_of("--format", name, FORMATS, code="A001", remedy="separate them by commas")
    if "onnx" in names and importlib.util.find_spec("onnx") is None:
        raise InputError(
            "--format onnx: the package onnx is missing", code="F013", remedy="pip install 'stiffarm[onnx]'"
        )


def portable(surrogate: Surrogate, *, matrix: bool = False) -> Portable:
    """What a surrogate computes, for others: its quantity along the load (a compliance, not yet a stiffness).

    ``matrix``: the 6 x 6 compliance at the tool point, base axes, SI, instead.

    Raises
    ------
    InputError
        The matrix of a surrogate that knows one direction only.
    """
    factor = surrogate.factor
    if matrix and factor is None:
        raise InputError(
            "--matrix of a surrogate with the basis",
            code="S002",
            value=surrogate.basis,
            allowed="factored",
            remedy="--basis factored",
        )
    links: dict[str, Link] = {"direct": "identity", "logarithm": "exp", "factored": "squares"}
    e = surrogate.errors
    return Portable(
        **{f.name: getattr(surrogate, f.name) for f in fields(Scope)},
        factor=factor,
        expansion=surrogate.expansion
        if factor is None or matrix
        else surrogate.along(np.array(surrogate.load_direction)),
        link="factor" if matrix else links[surrogate.target],
        name=f"{surrogate.robot}_{surrogate.quantity.name}" + ("_matrix" if matrix else ""),
        quantity="compliance_matrix" if matrix else surrogate.quantity.name,
        unit="SI" if matrix else surrogate.quantity.unit,
        notes=(
            *_meaning(surrogate, matrix),
            f"about 95 % of uniform poses are within {2.0 * e.rms_interior:.1e} of the model, relative; "
            "query surrogate.json for an error bar at each pose",
            *surrogate.notes,
        ),
        errors={"rms_relative": e.rms_relative, "p95_relative": e.p95_relative, "max_relative": e.max_relative},
    )


def _meaning(surrogate: Surrogate, matrix: bool) -> tuple[str, ...]:
    if matrix:
        return ("rows and columns: forces x, y, z (N), moments x, y, z (N m); translations (m), rotations (rad)",)
    if surrogate.quantity.name == COMPLIANCE:
        return (f"along the load direction {surrogate.load_direction}, base axes; the stiffness is its reciprocal",)
    return ()


def write_one(content: Portable, path: Path) -> None:
    """Write the format that a file's ending stands for, one of ``ENDINGS``, whole or not at all."""
    form = ENDINGS[path.suffix.lower()]
    if form == "onnx":
        write_onnx(content, path)
    else:
        write_whole(path, _TEXTS[form](content))
