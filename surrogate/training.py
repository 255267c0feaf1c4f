"""From a mechanical model to a surrogate: scope, runs, fit on some, judgement on others."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from fem import ArmModel, directional_stiffness
from robots import InputError, Robot
from surrogate.basis import BasisName
from surrogate.fit import fit, space_filling_design
from surrogate.model import Couplings, Scope, Surrogate, Target, predict_compliance

Array = NDArray[np.float64]
BasisChoice = Literal["best", "polynomial", "trigonometric"]
Progress = Callable[[int, int], None]

TRAINING_RUNS = 4096
HELD_OUT_UNIFORM = 1536
HELD_OUT_BOUNDARY = 512
RUNS_A_BLOCK = 1024


@dataclass(frozen=True)
class Runs:
    """Model runs: poses over the inputs Q (n, k) rad and compliance (n,) m/N."""

    Q: Array
    compliance: Array


@dataclass(frozen=True)
class Trained:
    """The surrogates of one model, best first, with the runs that judged them.

    ``predicted`` maps a basis to its compliance on ``held_out`` (n,) m/N.
    """

    surrogates: tuple[Surrogate, ...]
    training: Runs
    held_out: Runs
    predicted: Mapping[str, Array]

    @property
    def best(self) -> Surrogate:
        """The one with the smallest held-out RMS error."""
        return self.surrogates[0]

    def interior_error(self, basis: str) -> tuple[float, float]:
        """RMS and worst relative error of compliance on the uniform held-out runs, without the boundary ones."""
        part = slice(0, HELD_OUT_UNIFORM)
        error = np.abs(self.predicted[basis][part] / self.held_out.compliance[part] - 1.0)
        return float(np.sqrt(np.mean(error**2))), float(error.max())


def scope_of(
    robot: Robot,
    model_hash: str,
    inputs: Sequence[str],
    *,
    direction: Sequence[float] = (0.0, 0.0, -1.0),
    fixed_deg: Mapping[str, float] | None = None,
    limits_deg: Mapping[str, tuple[float, float]] | None = None,
) -> Scope:
    """The scope of a surrogate over some of the robot's joint coordinates.

    Coordinates that are no inputs stand at ``fixed_deg`` (default 0); couplings are folded accordingly.
    ``limits_deg`` narrows the joint limits.

    Raises
    ------
    InputError
        Unknown coordinate, fixed value outside its limits, direction of length zero.
    """
    columns = [robot.coordinate_index(name) for name in inputs]
    fixed = {name: 0.0 for name in robot.coordinates if name not in inputs} | dict(fixed_deg or {})
    base = np.zeros(robot.dof)
    for name, value in fixed.items():
        index = robot.coordinate_index(name)
        base[index] = np.radians(value)
        low, high = robot.limits[index]
        if name not in inputs and not low <= base[index] <= high:
            raise InputError(
                f"fixed coordinate {name}",
                value=value,
                allowed=f"{np.degrees(low):g} to {np.degrees(high):g} deg of {robot.name}",
            )
    lower, upper = robot.limits[columns].T.copy()
    for name, (low, high) in (limits_deg or {}).items():
        i = list(inputs).index(name)
        lower[i], upper[i] = max(lower[i], np.radians(low)), min(upper[i], np.radians(high))
    length = float(np.linalg.norm(direction))
    if not length > 0.0:
        raise InputError("load direction", value=list(direction), allowed="not all zero")
    x, y, z = (float(v) / length for v in direction)
    return Scope(
        robot=robot.name,
        model_hash=model_hash,
        load_direction=(x, y, z),
        inputs=tuple(inputs),
        fixed_deg={name: value for name, value in fixed.items() if name not in inputs},
        lower=lower,
        upper=upper,
        couplings=_folded(robot, columns, base),
    )


def _folded(robot: Robot, columns: list[int], base: Array) -> Couplings:
    """The robot's coupled limits over the inputs alone, the fixed coordinates moved into the bounds."""
    kept = [c for c in robot.couplings if np.any(c.factors[columns] != 0.0)]
    if not kept:
        return Couplings.none(len(columns))
    constant = np.zeros(robot.dof)
    constant[:] = base
    constant[columns] = 0.0
    shift = np.array([c.offset + float(c.factors @ constant) for c in kept])
    return Couplings(
        tuple(c.name for c in kept),
        np.array([c.factors[columns] for c in kept]),
        np.array([c.lower for c in kept]) - shift,
        np.array([c.upper for c in kept]) - shift,
    )


def full_poses(robot: Robot, scope: Scope, Q: Array) -> Array:
    """Poses of all joints (n, dof) rad from the inputs (n, k), the others at their fixed values."""
    q = np.zeros((len(Q), robot.dof))
    for name, value in scope.fixed_deg.items():
        q[:, robot.coordinate_index(name)] = np.radians(value)
    q[:, [robot.coordinate_index(name) for name in scope.inputs]] = Q
    return q


def run_model(model: ArmModel, scope: Scope, Q: Array, progress: Progress | None = None) -> Runs:
    """Compliance along the load direction at the poses Q (n, k) rad."""
    q = full_poses(model.robot, scope, Q)
    out = np.empty(len(q))
    for start in range(0, len(q), RUNS_A_BLOCK):
        part = slice(start, start + RUNS_A_BLOCK)
        out[part] = 1.0 / directional_stiffness(model, q[part], np.array(scope.load_direction))
        if progress is not None:
            progress(min(start + RUNS_A_BLOCK, len(q)), len(q))
    return Runs(Q, out)


def train(
    model: ArmModel,
    scope: Scope,
    rng: np.random.Generator,
    *,
    basis: BasisChoice = "best",
    degree: int = 6,
    order: int = 2,
    target: Target | None = None,
    runs: int = TRAINING_RUNS,
    notes: Sequence[str] = (),
    progress: Progress | None = None,
) -> Trained:
    """Run the model on a space-filling design, fit, and judge on runs kept out.

    ``basis="best"`` fits the brief's polynomial (in the logarithm of compliance) and the tensor
    trigonometric basis (in compliance, of which it is the exact form for constant springs) and puts the
    better one first. Held-out runs are about three quarters uniform, the rest on the boundary.

    Raises
    ------
    InputError
        Fewer runs than terms, an empty reachable set, or a rigid model.
    """

    def design(n: int, density: Literal["arcsine", "uniform", "boundary"]) -> Array:
        return space_filling_design(
            scope.lower, scope.upper, n, rng, density=density, couplings=scope.couplings, names=scope.inputs
        )

    # Boundary poses fall on the same corners again and again; each counts once.
    boundary = np.unique(design(HELD_OUT_BOUNDARY, "boundary"), axis=0)
    poses = np.vstack([design(runs, "arcsine"), design(HELD_OUT_UNIFORM, "uniform"), boundary])
    done = run_model(model, scope, poses, progress)
    training = Runs(done.Q[:runs], done.compliance[:runs])
    held_out = Runs(done.Q[runs:], done.compliance[runs:])
    wanted: list[tuple[BasisName, Target]] = []
    if basis in ("best", "polynomial"):
        wanted.append(("polynomial", target or "log-compliance"))
    if basis in ("best", "trigonometric"):
        wanted.append(("trigonometric", target or "compliance"))
    fitted = [
        fit(
            training.Q,
            training.compliance,
            scope=scope,
            Q_test=held_out.Q,
            y_test=held_out.compliance,
            basis=name,
            degree=degree,
            order=order,
            target=goal,
            notes=notes,
        )
        for name, goal in wanted
    ]
    fitted.sort(key=lambda s: s.errors.rms_relative)
    predicted: dict[str, Array] = {s.basis.name: predict_compliance(s, held_out.Q) for s in fitted}
    return Trained(tuple(fitted), training, held_out, predicted)
