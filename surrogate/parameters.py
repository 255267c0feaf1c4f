"""The calibration's uncertainty over the inputs: learned once, so that each query carries it."""

from __future__ import annotations

import numpy as np

from robots.arrays import Array
from robots.errors import InputError
from surrogate.basis import GEOMETRY_ORDER, MAX_TERMS, Basis, polynomial_basis, term_count, trigonometric_basis
from surrogate.error_bars import ParameterBars
from surrogate.least_squares import solve
from surrogate.tasks import Task

# Few terms serve where they are good enough: an interval that is off by this share of the largest one. Else all terms
# are taken that compliances of arms have, of up to five joints.
_GOOD, _FEW_TERMS, _MOST_TERMS = 0.01, 1_000, 3_200


def learn_parameters(task: Task, Q: Array, Q_test: Array) -> ParameterBars:
    """Learn the changes of the quantity by the parameters, at poses Q; ``Q_test`` judge it (n, k) rad.

    Those of a compliance are as smooth as it is (exact for a serial arm's springs), where their ratio to it is not:
    learned by the ratio, a KR 60's standard deviation was off by 20 % RMS and up to ninefold.

    Raises
    ------
    InputError
        The model's gradients are not finite.
    """
    assert task.gradients is not None  # noqa: S101 - asked for only where there are some
    (z, left_open), (z_test, _) = task.gradients(task.full(Q)), task.gradients(task.full(Q_test))
    if not all(np.isfinite(values).all() for values in (z, z_test, left_open)):
        raise InputError(
            "calibration uncertainty: changes of the quantity by the parameters", code="S004", allowed="finite numbers"
        )
    y, y_test = task.run(Q), task.run(Q_test)
    size = np.linalg.norm(z_test, axis=1)
    best: ParameterBars | None = None
    for basis in _bases(task):
        if best is not None and best.misfit <= _GOOD and basis.n_terms > _FEW_TERMS:
            break
        A = basis.design(Q)
        share = basis.expansion(solve(A, left_open).coefficients) if left_open.shape[1] else None
        # Rows over y: what is minimised is the error of the relative change.
        learned = basis.expansion(solve(A * (y.mean() / y)[:, None], y.mean() * z).coefficients)
        found = np.linalg.norm(learned(Q_test), axis=1) / np.abs(y_test)
        misfit = float(np.abs(found - size).max() / max(float(size.max()), 1e-300))
        if best is None or misfit < best.misfit:
            best = ParameterBars(learned, task.parameters, misfit, task.undetermined, share)
    assert best is not None  # noqa: S101 - the polynomial always fits
    return best


def _bases(task: Task) -> list[Basis]:
    scope = task.scope
    k = len(scope.inputs)
    box = (scope.lower, scope.upper)
    degree = max(d for d in range(1, 7) if term_count("polynomial", d, k) <= min(_FEW_TERMS, MAX_TERMS))
    out = [polynomial_basis(*box, degree, scope.periodic)]
    if term_count("trigonometric", GEOMETRY_ORDER, k) <= _MOST_TERMS:
        out.append(trigonometric_basis(*box, GEOMETRY_ORDER, scope.periodic))
    return out
