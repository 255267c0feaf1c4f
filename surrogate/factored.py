"""The 6 x 6 compliance learned as a sum of squares: positive semidefinite whatever the error.

The model's own rows (:func:`fem.compliance_factor`) are learned instead of the matrix. Between revolute joints they
are sums of products of ``1, cos, sin`` of each angle, so 3^k terms are exact where the matrix would take 5^k; the
compliance of a spring that depends on joint angles is learned apart, by its logarithm, as the model files state it.
What is neither (a parallelogram's bar, whose lever shortens with the angle) gets further functions of one angle at a
time until the rows are met or nothing more is gained.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import product

import numpy as np

from fem import ComplianceFactor
from robots.arrays import Array, Integers
from robots.errors import InputError
from surrogate.basis import FACTOR_ORDER, MAX_TERMS, Basis, mixed_families, polynomial_basis, sorted_terms
from surrogate.expansion import Expansion, Family
from surrogate.fit import Fit
from surrogate.least_squares import solve
from surrogate.model import Factor
from surrogate.scope import Scope

# Rows are met when no part is off by more: far below any other error of a model; round-off is some 1e-14.
MET = 1e-7
# Polynomials of one angle beside its sine and cosine.
EXTRA_DEGREE = 12
# Laws: of the sixth degree in all angles, as published; else harmonics and ever higher degrees of single angles, until
# ln(stiffness) is met to LAW_MET.
LAW_POLYNOMIAL = 6
LAW_ORDER = 4
LAW_DEGREES = (12, 40)
LAW_MET = 1e-6
_CONSTANT = 1e-12
# Terms with all coefficients below this share of the largest carry nothing; rows likewise, by singular value.
_NOTHING = 1e-13
_RUNS_A_TERM = 3
_FEWEST_RUNS = 4096


def fit_factored(
    run: Callable[[Array], ComplianceFactor],
    design: Callable[[int], Array],
    scope: Scope,
    runs: int | None = None,
    *,
    apart: bool = False,
) -> Fit:
    """Learn the rows and the weights: an expansion's basis and coefficients (t, 6 r), and how they are summed.

    Parameters
    ----------
    run : poses (n, k) rad -> the model's rows there
    design : n -> poses (n, k) rad that fill the domain
    runs : how many, if not as many as the terms need
    apart : keep a weight for each spring, constant or not, so that one may be changed afterwards

    Raises
    ------
    InputError
        Too many inputs (3^k terms beyond the limit), or runs that do not determine the terms.
    """
    families = mixed_families(scope.lower, scope.upper, FACTOR_ORDER, EXTRA_DEGREE, scope.periodic)
    terms = _geometry(families)
    if len(terms) > MAX_TERMS:
        raise InputError("factored basis: terms", code="S003", value=len(terms), allowed=f"at most {MAX_TERMS}")
    Q = design(runs or max(_FEWEST_RUNS, _RUNS_A_TERM * len(terms)))
    made = run(Q)
    wanted, part = _flat(made)
    while True:
        basis = Basis("factored", FACTOR_ORDER, families, terms)
        solution = solve(basis.design(Q), wanted)
        error = _row_error(basis, solution.coefficients, Q, wanted, part)
        if error <= MET:
            break
        kept, _ = _pruned(basis, solution.coefficients)
        wider = _widened(kept, Q, wanted - basis.design(Q) @ solution.coefficients)
        if wider is None:
            break
        terms = wider
        if runs is not None and runs < len(terms):
            break
        if runs is None and len(Q) < _RUNS_A_TERM * len(terms):
            Q = design(_RUNS_A_TERM * len(terms))
            made = run(Q)
            wanted, part = _flat(made)
    basis, coefficients = _pruned(basis, solution.coefficients)
    laws: list[float | Expansion] = [*_laws(made, Q, scope)]
    if apart:
        laws = [_constant(basis, law) if isinstance(law, float) else law for law in laws]
    coefficients, factor = _gathered(coefficients, made, laws)
    return Fit(basis, "factored", coefficients, solution.condition, len(Q), factor)


def _geometry(families: tuple[Family, ...]) -> Integers:
    """1, cos, sin of each angle in all combinations."""
    return np.array([*product(*(range(min(1 + 2 * FACTOR_ORDER, f.size)) for f in families))], dtype=np.int64)


def _flat(made: ComplianceFactor) -> tuple[Array, Integers]:
    """Rows (n, 6 r), and the number of the part of each column."""
    names = list(dict.fromkeys(made.part))
    number = np.repeat([names.index(name) for name in made.part], 6)
    return made.rows.reshape(len(made.rows), -1), number


def _row_error(basis: Basis, coefficients: Array, Q: Array, wanted: Array, part: Integers) -> float:
    """Largest RMS error of a part's rows over their RMS."""
    off = np.mean((wanted - basis.design(Q) @ coefficients) ** 2, axis=0)
    size = np.mean(wanted**2, axis=0)
    count = int(part.max()) + 1
    off, size = np.bincount(part, off, count), np.bincount(part, size, count)
    return float(np.sqrt(np.max(off[size > 0.0] / size[size > 0.0])))


def _widened(basis: Basis, Q: Array, rest: Array) -> Integers | None:
    """Terms with further functions of the one angle that explain most of the rest; None where nothing is gained.

    They come in products with what the other angles do already.
    """
    geometry = 1 + 2 * FACTOR_ORDER
    best: tuple[float, Integers | None] = (0.02 * float(np.sum(rest**2)), None)
    for i, family in enumerate(basis.families):
        others = basis.terms.copy()
        others[:, i] = 0
        others = np.unique(others, axis=0)
        more = np.repeat(others, max(family.size - geometry, 0), axis=0)
        more[:, i] = np.tile(np.arange(geometry, max(family.size, geometry)), len(others))
        wider = sorted_terms(np.vstack([basis.terms, more]))
        if len(wider) == len(basis.terms) or len(wider) > MAX_TERMS:
            continue
        # What each new function explains by itself is enough to see which angle matters.
        A = Basis("factored", FACTOR_ORDER, basis.families, sorted_terms(more)).design(Q)
        gain = float(np.sum((A.T @ rest) ** 2 / np.sum(A**2, axis=0)[:, None]))
        if gain > best[0]:
            best = (gain, wider)
    return best[1]


def _pruned(basis: Basis, coefficients: Array) -> tuple[Basis, Array]:
    """Without the terms that carry nothing."""
    size = np.abs(coefficients).max(axis=1)
    kept = np.flatnonzero(size > _NOTHING * size.max())
    return basis.take(kept), coefficients[kept]


def _laws(made: ComplianceFactor, Q: Array, scope: Scope) -> list[float | Expansion]:
    """ln(weight) of each spring, a number where it is constant, else learned."""
    log = np.log(np.maximum(made.weights, 1e-300))
    out: list[float | Expansion] = []
    bases = _law_bases(scope)
    for values in log.T:
        if np.ptp(values) <= _CONSTANT:
            out.append(float(values[0]))
            continue
        best: tuple[float, Expansion | None] = (np.inf, None)
        for basis in bases:
            error, law = _law_fit(basis, Q, values)
            if error < best[0]:
                best = (error, law)
            if best[0] <= LAW_MET:
                break
        assert best[1] is not None  # noqa: S101 - some fit is the best
        out.append(best[1])
    return out


def _constant(basis: Basis, value: float) -> Expansion:
    """A number as a sum of functions of all angles: the first of each family is 1."""
    families = basis.families
    return Basis("factored", 0, families, np.zeros((1, len(families)), dtype=np.int64)).expansion(np.array([value]))


def _law_bases(scope: Scope) -> list[Basis]:
    """What a law may be a sum of, the simplest first: the sixth degree in all angles, then ever more of single ones."""
    box = (scope.lower, scope.upper)
    out = [polynomial_basis(*box, LAW_POLYNOMIAL, scope.periodic)]
    for degree in LAW_DEGREES:
        families = mixed_families(*box, LAW_ORDER, degree, scope.periodic)
        out.append(Basis("factored", degree, families, _single(families)))
    return out


def _law_fit(basis: Basis, Q: Array, wanted: Array) -> tuple[float, Expansion]:
    """Largest error on a half of the runs that is kept out, and the fit to all of them without idle terms."""
    A = basis.design(Q)
    if 2 * basis.n_terms > len(Q):
        return np.inf, basis.expansion(np.zeros(basis.n_terms))
    # Least norm: harmonics and polynomials over a short range are nearly dependent, which does no harm here.
    # Halves one after the other: every second point of a Sobol sequence fills only half of the box.
    middle = len(Q) // 2
    half = np.linalg.lstsq(A[:middle], wanted[:middle], rcond=1e-12)[0]
    error = float(np.abs(A[middle:] @ half - wanted[middle:]).max())
    found = np.asarray(np.linalg.lstsq(A, wanted, rcond=1e-12)[0], dtype=np.float64)
    kept = np.flatnonzero(np.abs(found) > _CONSTANT * np.abs(found).max())
    return error, basis.take(kept).expansion(found[kept])


def _single(families: tuple[Family, ...]) -> Integers:
    """Every function of each angle alone."""
    rows = [np.eye(len(families), dtype=np.int64)[i] * j for i, f in enumerate(families) for j in range(1, f.size)]
    return sorted_terms(np.vstack([np.zeros(len(families), dtype=np.int64), *rows]))


def _gathered(coefficients: Array, made: ComplianceFactor, laws: list[float | Expansion]) -> tuple[Array, Factor]:
    """Put constant springs into the rows, and turn rows of one weight so that as few as possible are left."""
    rows = coefficients.reshape(len(coefficients), -1, 6)
    weights = tuple(law for law in laws if isinstance(law, Expansion))
    # The last entries stand for rows without a spring (group -1).
    constant = np.array([law if isinstance(law, float) else 0.0 for law in laws] + [0.0])[made.group]
    varies = np.array([isinstance(law, Expansion) for law in laws] + [False])
    group = np.where(varies, np.cumsum(varies) - 1, -1)[made.group]
    rows = rows * np.exp(0.5 * constant)[:, None]
    kept: list[Array] = []
    labels: list[int] = []
    for g in np.unique(group):
        mine = np.moveaxis(rows[:, group == g], 1, 0)
        _, size, turned = np.linalg.svd(mine.reshape(len(mine), -1), full_matrices=False)
        many = int(np.count_nonzero(size > _NOTHING * size[0]))
        kept.append((size[:many, None] * turned[:many]).reshape(many, len(coefficients), 6))
        labels += [int(g)] * many
    out = np.moveaxis(np.concatenate(kept), 0, 1).reshape(len(coefficients), -1)
    return out, Factor(np.array(labels, dtype=np.int64), weights)
