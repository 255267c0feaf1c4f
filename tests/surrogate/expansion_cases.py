"""Random sums of products, of all kinds that surrogates are made of."""

from __future__ import annotations

from itertools import product

import numpy as np

from robots.arrays import Array
from surrogate.expansion import Expansion, Family

KINDS = ("polynomial", "harmonic", "mixed", "periodic", "gaps", "constant")


def family(kind: str, rng: np.random.Generator) -> Family:
    harmonics, degrees = {
        "polynomial": (0, (1, 2, 3, 4, 5, 6)),
        "harmonic": (3, ()),
        "mixed": (2, (1, 2, 3)),
        "periodic": (4, (2,)),
        "gaps": (1, (2, 5)),
        "constant": (0, ()),
    }[kind]
    raw = 1 + 2 * harmonics + len(degrees)
    matrix = rng.normal(size=(max(1, raw - rng.integers(2)), raw))
    if kind == "polynomial":
        matrix = np.diag(np.sqrt(2.0 * np.arange(raw) + 1.0))
    elif raw > 2:
        matrix[rng.random(matrix.shape) < 0.3] = 0.0  # rows of zeros too
    return Family(rng.normal(), rng.uniform(0.5, 3.0), kind == "periodic", harmonics, degrees, matrix)


def expansion(kinds: tuple[str, ...], m: int, rng: np.random.Generator, most: int = 60) -> Expansion:
    families = tuple(family(kind, rng) for kind in kinds)
    terms = np.array(list(product(*(range(min(f.size, 4)) for f in families))))
    kept = np.sort(rng.permutation(len(terms))[: rng.integers(1, most + 1)])
    coefficients = rng.normal(size=(len(kept), m))
    coefficients[rng.random(len(kept)) < 0.2] = 0.0
    return Expansion(families, terms[kept], coefficients)


def angles(e: Expansion, n: int, rng: np.random.Generator) -> Array:
    """Poses in the ranges of the families and somewhat beyond; periodic angles are turns away."""
    q = np.array([f.centre + f.half_range * rng.uniform(-1.2, 1.2, n) for f in e.families]).T
    turns = 2.0 * np.pi * rng.integers(-3, 4, q.shape)
    return np.asarray(q + turns * [f.periodic for f in e.families])


def size(e: Expansion, Q: Array) -> Array:
    """Sum of the terms' sizes at each pose (n, m): what rounding is measured against."""
    q = [np.abs(f.matrix) @ np.abs(f.raw(angle)) for f, angle in zip(e.families, Q.T, strict=True)]
    sizes = np.prod([f[column] for f, column in zip(q, e.terms.T, strict=True)], axis=0)
    return np.asarray(sizes.T @ np.abs(e.coefficients)) + 1e-300
