"""Seven kinds of noise, set-ups that scatter, gauges set up anew, readings that are simply wrong."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .laws import log_uniform
from .spec import Row, Spec

Array = NDArray[np.float64]
KINDS = ("white", "component", "length", "load", "axis", "session", "heavy")
SESSION_ZERO = 20e-6  # m
ONE_IN = 50


def draw(rng: np.random.Generator, kind: str) -> dict[str, Any]:
    """Sizes of a kind, in m or as a share. A dial gauge is good for some hundredths of a millimetre."""
    floor = rng.uniform(2e-6, 5e-6)
    sizes: dict[str, dict[str, Any]] = {
        "white": {"level": log_uniform(rng, 5e-6, 25e-6)},
        "component": {"share": rng.uniform(0.008, 0.03), "floor": floor},
        "length": {"share": rng.uniform(0.006, 0.025), "floor": floor},
        "load": {"level": log_uniform(rng, 8e-6, 35e-6), "floor": floor},
        "axis": {"axes": [log_uniform(rng, 4e-6, 30e-6) for _ in range(3)]},
        "session": {"level": log_uniform(rng, 5e-6, 20e-6), "by": rng.permutation([0.5, 1.0, 2.0]).tolist()},
        "heavy": {"level": log_uniform(rng, 5e-6, 20e-6)},
    }
    return {"kind": kind, **sizes[kind]}


def sds(spec: Spec, rows: list[Row], moved: Array) -> Array:
    """Standard deviation (n, 3) in m of each reading by itself, of true readings (n, 3)."""
    n, ones = spec.noise, np.ones_like(moved)
    if n["kind"] == "component":
        return np.hypot(n["share"] * moved, n["floor"])
    if n["kind"] == "length":
        return np.hypot(n["share"] * np.linalg.norm(moved, axis=1)[:, None], n["floor"]) * ones
    if n["kind"] == "load":
        loads = np.array([r.load for r in rows]) / max(spec.loads)
        return np.hypot(n["level"] * loads, n["floor"])[:, None] * ones
    if n["kind"] == "axis":
        return np.array(n["axes"]) * ones
    if n["kind"] == "session":
        return n["level"] * np.array([n["by"][r.session % 3] for r in rows])[:, None] * ones
    return n["level"] * ones


def read_axes(spec: Spec) -> list[int]:
    """Components that are read."""
    return [2] if spec.reads == "z" else [0, 1, 2]


def has_sessions(spec: Spec) -> bool:
    """Whether the table has sessions, and so gauges that are set up anew."""
    return "session" in spec.columns


def measured(spec: Spec, rows: list[Row], moved: Array, what: int) -> Array:
    """What is written down (n, 3), m: true readings with everything that goes wrong."""
    out = moved.copy()
    for i, r in enumerate(rows):
        out[i] *= 1 + spec.scatter * spec.rng(8, r.visit).normal()
        if has_sessions(spec):
            out[i] += SESSION_ZERO * spec.rng(9, r.session).normal(size=3)
    rng, sd = spec.rng(10, what), sds(spec, rows, moved)
    # Three degrees of freedom have a variance of three.
    draws = rng.standard_t(3, out.shape) / np.sqrt(3) if spec.noise["kind"] == "heavy" else rng.normal(size=out.shape)
    out += sd * draws
    if spec.outliers:
        for i in np.flatnonzero(rng.random(len(rows)) < 1 / ONE_IN).tolist():
            k = rng.choice(read_axes(spec))
            out[i, k] += sd[i, k] * rng.uniform(5, 30) * rng.choice([-1, 1])
    return out
