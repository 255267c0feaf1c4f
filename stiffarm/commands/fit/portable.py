"""A surrogate for other programs: ONNX, a C header, a Python file, JavaScript."""

from __future__ import annotations

import importlib.util
from dataclasses import fields
from pathlib import Path
from typing import Final

import numpy as np

from robots import InputError, require_one_of
from robots.files.written import write_whole
from stiffarm.session.outputs import OutputFolder
from surrogate import Surrogate, Trained
from surrogate.model import COMPLIANCE
from surrogate.portable import Link, Portable, c_header, javascript, python_snippet, write_onnx
from surrogate.scope import Scope

FORMATS: Final = {
    "onnx": "surrogate.onnx",
    "c": "surrogate.h",
    "python": "surrogate_snippet.py",
    "javascript": "surrogate.js",
}
ENDINGS: Final = {Path(name).suffix: form for form, name in FORMATS.items()}
_TEXTS: Final = {"c": c_header, "python": python_snippet, "javascript": javascript}


def parse_formats(text: str | None) -> tuple[str, ...]:
    """``onnx,c`` as names of formats, each once.

    Raises
    ------
    InputError
        An unknown format.
    """
    names = () if text is None else tuple(dict.fromkeys(part.strip() for part in text.split(",")))
    for name in names:
        require_one_of("--format", name, FORMATS, code="A001", remedy="separate them by commas")
    # Before the fit, which takes a while.
    if "onnx" in names and importlib.util.find_spec("onnx") is None:
        raise InputError(
            "--format onnx: the package onnx is missing", code="F013", remedy="pip install 'stiffarm[onnx]'"
        )
    return names


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


def write(trained: Trained, formats: tuple[str, ...], folder: OutputFolder, *, matrix: bool = False) -> list[str]:
    """Write the formats asked for; returns the names of the files."""
    if not formats:
        return []
    # The matrix is known to the factored basis, even where another is the best along the load.
    known = [one for one in trained.surrogates if one.has_matrix] if matrix else [trained.best]
    content = portable(known[0] if known else trained.best, matrix=matrix)
    for name in formats:
        write_one(content, folder.path(FORMATS[name]))
    return [FORMATS[name] for name in formats]


def write_one(content: Portable, path: Path) -> None:
    """Write the format that a file's ending stands for, one of ``ENDINGS``, whole or not at all."""
    form = ENDINGS[path.suffix.lower()]
    if form == "onnx":
        write_onnx(content, path)
    else:
        write_whole(path, _TEXTS[form](content))
