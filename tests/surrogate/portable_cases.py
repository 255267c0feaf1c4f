"""Portable surrogates at random, and poses that are good, outside, unreachable and not finite."""

from __future__ import annotations

from typing import Any

import numpy as np
from expansion_cases import angles, expansion

from robots.arrays import Array, Integers
from surrogate.expansion import Expansion
from surrogate.model import Factor
from surrogate.portable import Link, Portable, Status
from surrogate.scope import Couplings

# Link, kinds of functions, numbers at each pose: one to six inputs, each kind of family, 1 and 36 outputs.
CASES: list[tuple[Link, tuple[str, ...], int]] = [
    ("identity", ("polynomial",), 1),
    ("identity", ("harmonic", "harmonic"), 36),
    ("exp", ("mixed", "periodic", "gaps"), 1),
    ("factor", ("polynomial",) * 4, 36),
    ("factor", ("periodic", "constant", "gaps"), 12),
    ("identity", ("gaps", "constant", "polynomial", "mixed", "harmonic"), 3),
    ("squares", ("mixed", "gaps", "periodic", "harmonic"), 4),
    ("squares", ("mixed", "harmonic"), 1),
    ("exp", ("gaps", "harmonic", "polynomial", "periodic", "mixed", "polynomial"), 2),
]
HOSTILE = (
    "*/ int main(void){return 1;} /*",
    '"; import os; """ \'\'\' #',
    "line\nbreak\r\n#error x\n*/",
    "back\\slash\\",
    "??/ ??' {{ 7 * 7 }} {% raw %}",
    "naïve µm/N °C ∞ \u2028 \x00 \x0c end",
    "/*/ */*/ **//",
    "",
)


def portable(link: Link, kinds: tuple[str, ...], m: int, rng: np.random.Generator, /, **changes: Any) -> Portable:
    e = expansion(kinds, m, rng, most=40)
    if link == "exp":
        # Random polynomials reach thousands, and so would their exponents.
        e = Expansion(e.families, e.terms, 1e-3 * e.coefficients)
    k = e.n_inputs
    lower = np.array([f.centre - 1.1 * f.half_range for f in e.families])
    upper = np.array([f.centre + 1.1 * f.half_range for f in e.families])
    for i, f in enumerate(e.families):
        if f.periodic:
            lower[i], upper[i] = f.centre - 15.0, f.centre + 15.0
    couplings = Couplings.none(k)
    if k > 1:
        row = np.zeros((2, k))
        row[0, :2], row[1, 1] = (1.0, -1.0), 1.0
        middle = row @ [f.centre for f in e.families]
        width = np.array([0.9 * e.families[0].half_range, np.inf])
        couplings = Couplings(("q3 - q2", "q2 alone"), row, middle - width, middle + width)
    rows = m // (6 if link == "factor" else 1)
    weighted = link in ("squares", "factor") and rows in (2, 4)
    laws = [expansion(kinds, 1, rng, most=9) for _ in range(2)] if weighted else []
    fields: dict[str, Any] = {
        # Small exponents, see above.
        "factor": None
        if link not in ("squares", "factor")
        else Factor(
            np.array((1, -1, 0, 1)[:rows] if weighted else (-1,) * rows),
            tuple(Expansion(w.families, w.terms, 1e-3 * w.coefficients) for w in laws),
        ),
        "expansion": e,
        "link": link,
        "name": "xr701 compliance",
        "quantity": "compliance",
        "unit": "m/N",
        "inputs": tuple(f"q{i + 2}_deg" for i in range(k)),
        "lower": lower,
        "upper": upper,
        "couplings": couplings,
        "robot": "xr701",
        "model_hash": "ab12",
        "load_direction": (0.0, 0.0, -1.0),
        "fixed_deg": {"q1_deg": 12.5},
        "notes": ("95 % of errors lie within 1.96 times rms_relative.",),
        "errors": {"rms_relative": 1.25e-3},
    }
    return Portable(**(fields | changes))


def reference(p: Portable, Q: Array) -> tuple[Array, Integers]:
    """What every portable form must answer: Q (n, k) rad -> values (n, *shape), NaN without one, and status (n,)."""
    poses = np.asarray(Q, dtype=np.float64)
    lower, upper = p.bounds
    coupled_lower, coupled_upper = p.coupled_bounds
    status = np.full(len(poses), int(Status.OK))
    with np.errstate(invalid="ignore", over="ignore"):
        sums = poses @ p.couplings.matrix.T
        status[~((sums >= coupled_lower) & (sums <= coupled_upper)).all(axis=1)] = Status.COUPLINGS_BROKEN
        status[~((poses >= lower) & (poses <= upper)).all(axis=1)] = Status.OUTSIDE_DOMAIN
        status[~np.isfinite(poses).all(axis=1)] = Status.NOT_FINITE
        good = status == Status.OK
        s = p.expansion(poses[good])
        if p.link == "exp":
            s = np.exp(s)
        elif p.factor is not None:
            weights = [np.exp(w(poses[good])) for w in p.sums[1:]]
            w = np.hstack([np.ones((len(s), 1)), *weights])[:, p.row_weights, None]
            L = s.reshape(len(s), len(p.row_weights), -1)
            C = np.swapaxes(L, 1, 2) @ (w * L)
            s = 0.5 * (C + np.swapaxes(C, 1, 2))
    values = np.full((len(poses), *p.shape), np.nan)
    values[good] = s.reshape(-1, *p.shape)
    broken = good & ~np.isfinite(values).reshape(len(values), -1).all(axis=1)
    status[broken], values[broken] = Status.NOT_FINITE, np.nan
    return values, status


def poses(p: Portable, n: int, rng: np.random.Generator) -> Array:
    Q = angles(p.expansion, n, rng)
    Q[:: max(1, n // 5), 0] = [np.nan, np.inf, -np.inf, 1e300, -50.0][: len(Q[:: max(1, n // 5)])]
    return Q


def check(p: Portable, expected: tuple[Array, Array], values: Array, status: Array, rtol: float) -> None:
    """``rtol`` of the largest value at each pose, and of the terms that cancel in it."""
    np.testing.assert_array_equal(status, expected[1])
    found, wanted = (np.asarray(v).reshape(len(v), -1) for v in (values, expected[0]))
    good = expected[1] == 0
    assert np.isnan(found[~good]).all()
    if p.link == "factor":
        matrices = found[good].reshape(-1, 6, 6)
        np.testing.assert_array_equal(matrices, matrices.swapaxes(1, 2))
    scale = np.abs(wanted[good]).max(axis=1, keepdims=True)
    # Random sums cancel by up to a hundred; 1e-15 of the largest pose stands for it.
    assert (np.abs(found[good] - wanted[good]) <= rtol * scale + 0.01 * rtol * scale.max()).all()
