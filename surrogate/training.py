"""From a mechanical model to a surrogate: runs, fits on some, error bars and judgement on others."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Literal, get_args

import numpy as np

from fem import compliance, compliance_factor
from robots import InputError, require_one_of
from robots.arrays import Array
from robots.progress import Progress, report_progress
from surrogate.basis import BasisName, term_count
from surrogate.error_bars import ParameterBars, learn_bars
from surrogate.factored import fit_factored
from surrogate.fit import RUNS_A_TERM, Fit, checked_runs, fit
from surrogate.model import COMPLIANCE, ErrorFigures, Surrogate, Target, compliance_matrix, predict
from surrogate.parameters import learn_parameters
from surrogate.scope import Scope
from surrogate.tasks import Task

BasisChoice = Literal["best", "polynomial", "trigonometric", "factored", "adaptive"]

TRAINING_RUNS = 4096
# Uniform poses that the error bars are learned from, and fresh ones that judge fit and bars.
CALIBRATION_RUNS = 8192
HELD_OUT_UNIFORM = 10_000
HELD_OUT_BOUNDARY = 512
_MATRICES = 2_000
# Held-out RMS errors below this are all alike: no model of an arm is known to a millionth.
NOTHING = 1e-6


@dataclass(frozen=True, eq=False)
class Runs:
    """Model runs: poses over the inputs Q (n, k) rad and the quantity (n,), SI."""

    Q: Array
    value: Array


@dataclass(frozen=True, eq=False)
class Trained:
    """The surrogates of one model, best first, with the runs that judged them.

    ``held_out``: the uniform poses, then those on the boundary; ``predicted`` maps a basis to its values there (n,).
    ``refused``: basis -> why it could not be fitted. ``seconds``: what each fit took with its own runs and judgement.
    ``uniform``: how many of ``held_out`` are uniform poses.
    """

    surrogates: tuple[Surrogate, ...]
    training: Runs
    held_out: Runs
    predicted: Mapping[str, Array]
    refused: Mapping[str, str]
    seconds: Mapping[str, float] = field(default_factory=dict)
    uniform: int = 0

    @property
    def best(self) -> Surrogate:
        """The one with the smallest held-out RMS error."""
        return self.surrogates[0]


@dataclass(frozen=True, eq=False)
class _Ways:
    """How to fit and judge: everything that the candidates share."""

    task: Task
    rng: np.random.Generator
    degree: int
    order: int
    target: Target | None
    calibration: Runs
    audit: Runs
    uniform: int
    matrices: Array | None
    parameters: ParameterBars | None


def train(
    task: Task,
    rng: np.random.Generator,
    *,
    basis: BasisChoice = "best",
    degree: int = 6,
    order: int = 2,
    target: Target | None = None,
    runs: int | None = None,
    progress: Progress | None = None,
) -> Trained:
    """Run the model on space-filling designs, fit, learn error bars, and judge both on runs kept out.

    ``basis="best"`` fits the polynomial (in the logarithm), the tensor trigonometric basis (in the quantity,
    of which it is the exact form for constant springs) and, for the compliance, the factored one; for another
    quantity terms are chosen ('adaptive'). The best on held-out runs comes first, the factored one if all are exact.
    Held-out: 10 000 uniform poses and some on the boundary, seen neither by the fits nor by the error bars.

    Parameters
    ----------
    runs : model runs to fit on; None: 4096, or three for each term where that is more

    Raises
    ------
    InputError
        A basis asked for by name that cannot be fitted, an empty reachable set, or a rigid model.
    """
    require_one_of("--basis", basis, get_args(BasisChoice), code="A001")
    ways = _prepared(task, rng, degree, order, target, progress)
    training = _run(task, task.design(runs or TRAINING_RUNS, "arcsine", rng))
    fitted: list[Surrogate] = []
    refused: dict[str, str] = {}
    seconds: dict[str, float] = {}
    for name in _wanted(task, basis):
        start = time.perf_counter()
        try:
            one, training = _learned(ways, name, training, runs)
        except InputError as error:
            if basis != "best":
                raise
            refused[name] = error.prose
            continue
        fitted.append(one)
        seconds[name] = time.perf_counter() - start
    if not fitted:
        raise InputError(
            "fit: no basis could be fitted: " + "; ".join(f"{n}: {why}" for n, why in refused.items()), code="S004"
        )
    fitted.sort(key=_merit)
    predicted: dict[str, Array] = {s.basis: predict(s, ways.audit.Q) for s in fitted}
    return Trained(tuple(fitted), training, ways.audit, predicted, refused, seconds, ways.uniform)


def _merit(one: Surrogate) -> tuple[float, bool]:
    """Held-out RMS error; where that is nothing, the one that knows all directions comes first."""
    return max(one.errors.rms_relative, NOTHING), not one.has_matrix


def _wanted(task: Task, basis: BasisChoice) -> list[BasisName]:
    arm = task.quantity.name == COMPLIANCE
    if basis == "best":
        return ["polynomial", "trigonometric", "factored" if arm else "adaptive"]
    if basis == "factored" and not arm:
        raise InputError(
            "--basis",
            code="A001",
            value=basis,
            allowed="polynomial, trigonometric, adaptive",
            remedy="factored is for compliance",
        )
    return [basis]


def _prepared(
    task: Task,
    rng: np.random.Generator,
    degree: int,
    order: int,
    target: Target | None,
    progress: Progress | None,
) -> _Ways:
    """Run what judges: poses for the error bars, and fresh ones for the figures."""
    # Boundary poses fall on the same corners again and again; each counts once.
    boundary = np.unique(task.design(HELD_OUT_BOUNDARY, "boundary", rng), axis=0)
    uniform = task.over_domain(HELD_OUT_UNIFORM, rng)
    calibration = _run(task, task.over_domain(CALIBRATION_RUNS, rng))
    total = CALIBRATION_RUNS + len(uniform) + len(boundary)
    report_progress(progress, CALIBRATION_RUNS, total)
    audit = _run(task, np.vstack([uniform, boundary]))
    report_progress(progress, total, total)
    matrices = None
    if task.quantity.name == COMPLIANCE:
        matrices = compliance(task.model, task.full(uniform[:_MATRICES]))
    parameters = learn_parameters(task, calibration.Q, uniform[:_MATRICES]) if task.gradients is not None else None
    return _Ways(task, rng, degree, order, target, calibration, audit, len(uniform), matrices, parameters)


def _run(task: Task, Q: Array) -> Runs:
    y = task.run(Q)
    return Runs(*checked_runs(task.scope, Q, y, "model runs"))


def _learned(ways: _Ways, name: BasisName, training: Runs, runs: int | None) -> tuple[Surrogate, Runs]:
    """Fit one basis, on more runs where it has many terms and their number is not given."""
    if name == "factored":
        return _factored(ways, runs), training
    inputs = len(ways.task.scope.inputs)
    needed = 0 if name == "adaptive" else RUNS_A_TERM * term_count(name, _degree(ways, name), inputs)
    if runs is None and needed > len(training.Q):
        more = _run(ways.task, ways.task.design(needed - len(training.Q), "arcsine", ways.rng))
        training = Runs(np.vstack([training.Q, more.Q]), np.concatenate([training.value, more.value]))
    return _scalar(ways, name, training), training


def _degree(ways: _Ways, name: BasisName) -> int:
    return ways.degree if name == "polynomial" else ways.order


def _scalar(ways: _Ways, name: BasisName, training: Runs) -> Surrogate:
    targets: tuple[Target, ...] = (ways.target or ("direct" if name == "trigonometric" else "logarithm"),)
    if ways.target is None and name == "adaptive":
        targets = ("logarithm", "direct")
    degree = _degree(ways, name)
    fits = [fit(training.Q, training.value, ways.task.scope, name, degree, target) for target in targets]
    # The runs for the error bars choose, never those that judge.
    tried = [(_rms(_relative(_unjudged(ways, found), ways.calibration)), i) for i, found in enumerate(fits)]
    found = fits[min(tried)[1]]
    return _judged(ways, found, training.Q)


def _relative(one: Surrogate, runs: Runs) -> Array:
    """Relative errors (n,), infinite where a fit gives no positive value."""
    y = predict(one, runs.Q)
    return np.asarray(np.where(y > 0.0, y / runs.value - 1.0, np.inf))


def _factored(ways: _Ways, runs: int | None) -> Surrogate:
    task = ways.task
    drawn: list[Array] = []

    def design(n: int) -> Array:
        drawn.append(task.design(n, "arcsine", ways.rng))
        return drawn[-1]

    found = fit_factored(lambda Q: compliance_factor(task.model, task.full(Q)), design, task.scope, runs)
    return _judged(ways, found, drawn[-1])


def _unjudged(ways: _Ways, found: Fit) -> Surrogate:
    task, name = ways.task, found.basis.name
    nothing = ErrorFigures(name, found.basis.degree, found.target, found.basis.n_terms, found.runs, 0, *(0.0,) * 6, 1.0)
    return Surrogate(
        **{f.name: getattr(task.scope, f.name) for f in fields(Scope)},
        quantity=task.quantity,
        basis=name,
        degree=found.basis.degree,
        target=found.target,
        expansion=found.basis.expansion(found.coefficients),
        errors=nothing,
        kinematics=task.model.robot,
        parameters=ways.parameters,
        fixed_influence=dict(task.fixed_influence),
        notes=task.notes,
        at_load=task.at_load,
        factor=found.factor,
    )


def _judged(ways: _Ways, found: Fit, Q_fitted: Array) -> Surrogate:
    """With error bars, and with its errors on runs that neither fit nor bars have seen."""
    one, known = _unjudged(ways, found), ways.calibration
    relative = predict(one, known.Q) / known.value - 1.0
    bars = learn_bars(found.basis, one, Q_fitted, known.Q, relative)
    error = np.abs(predict(one, ways.audit.Q) / ways.audit.value - 1.0)
    inner = error[: ways.uniform]
    covered = float(np.mean(inner <= bars.half_width(ways.audit.Q[: ways.uniform])))
    off: tuple[float | None, float | None] = (None, None)
    if one.has_matrix and ways.matrices is not None:
        C = compliance_matrix(one, ways.audit.Q[: len(ways.matrices)])
        each = np.linalg.norm(C - ways.matrices, axis=(1, 2)) / np.linalg.norm(ways.matrices, axis=(1, 2))
        off = _rms(each), float(each.max())
    figures = ErrorFigures(
        basis=one.basis,
        degree=one.degree,
        target=one.target,
        n_terms=one.expansion.n_terms,
        n_train=found.runs,
        n_test=len(error),
        rms_relative=_rms(error),
        p95_relative=float(np.quantile(error, 0.95)),
        max_relative=float(error.max()),
        rms_interior=_rms(inner),
        max_interior=float(inner.max()),
        coverage95=covered,
        condition_number=found.condition,
        matrix_rms=off[0],
        matrix_max=off[1],
    )
    return replace(one, bars=bars, errors=figures)


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))
