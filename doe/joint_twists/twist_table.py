"""The table ``[calibration.uncertainty]`` of an identified model: six stiffnesses a joint with their covariance.

Directions are independent: each was found from readings of its own. Within one the coefficients of a law have the
covariance that its fit gave them; a direction that the model file holds as its mean compliance over the angles measured
has the variance of that mean, to first order in the law's coefficients.
"""

from __future__ import annotations

import numpy as np

from doe.certainty.uncertainty import Status
from doe.joint_twists.direction import Direction
from doe.joint_twists.identify import Identified
from doe.joint_twists.laws import Law
from doe.model_file.uncertainty_table import FoundNumber, uncertainty_table
from fem import ArmModel
from robots.arrays import Array
from robots.schema.uncertainty import CalibrationUncertainty

NOT_JUDGED = "nothing tells how sure this value is"
NOTE = "joint twists: weighted least squares of each direction by itself, scatter of set-ups included"


def twist_table(found: Identified, model: ArmModel) -> CalibrationUncertainty | None:
    """The table of everything that was identified, judged or not; None where no number has a variance.

    A direction that no reading loads or watches keeps what the model had: it is among the ``undetermined``, as are
    those without an interval ("not judged") and those whose best compliance is not positive.
    """
    numbers: list[FoundNumber] = []
    blocks: list[Array] = []
    for k, d in enumerate(found.directions.values()):
        mine, V = _numbers(d, k // 6, model.robot.dof)
        numbers += mine
        blocks.append(V)
    if not any(n.has_variance for n in numbers):
        return None
    size = sum(len(V) for V in blocks)
    covariance, at = np.zeros((size, size)), 0
    for V in blocks:
        covariance[at : at + len(V), at : at + len(V)] = V
        at += len(V)
    return uncertainty_table(numbers, covariance, np.zeros((0, size)), NOTE)


def is_held(d: Direction, law: Law) -> bool:
    """Whether a model file holds a direction's law as it is."""
    return d.row == "rz" or law.kind == "constant" or law.kind.startswith("fourier")


def mean_compliance(d: Direction, law: Law, column: int, dof: int) -> float:
    """Mean of a law's compliance over the angles measured."""
    q = np.zeros((len(d.angle), dof))
    q[:, column] = d.angle
    return float(law.compliance(q)[0].mean())


def _numbers(d: Direction, column: int, dof: int) -> tuple[list[FoundNumber], Array]:
    """The numbers that the model file has of one direction, and their covariance; zeros where there is none."""
    axial = d.row == "rz"
    name = f"{d.joint}.{'stiffness' if axial else d.row}"
    judged = d.law is not None and bool(np.isfinite(d.law.covariance).all())
    status: Status = "one-sided" if d.status == "one-sided" else "determined" if judged else "not identified"
    note = NOT_JUDGED if d.status == "not judged" else None
    if d.law is not None and d.law.kind != "constant" and is_held(d, d.law):
        whole = f"{d.joint}.law" if axial else f"{d.joint}.{d.row}.law"
        numbers = [
            FoundNumber(f"{whole}[{i}]", f"ln({d.unit})", "linear", float(c), (np.nan, np.nan), status,
                        d.degrees_of_freedom, judged, note)
            for i, c in enumerate(d.law.spring.coefficients)
        ]  # fmt: skip
        return numbers, d.law.covariance if judged else np.zeros_like(d.law.covariance)
    low = high = np.nan
    value = variance = 0.0
    if d.law is not None:
        value = mean_compliance(d, d.law, column, dof)
        variance = _variance_of_the_mean(d, d.law, column, dof) if judged else 0.0
    elif d.status == "not determined":
        # The best compliance is not positive: the model is rigid there, and the readings give a lower limit at most.
        status, low, high = "at bound", _least(d), np.inf
    one = FoundNumber(name, d.unit, "compliance", value, (low, high), status, d.degrees_of_freedom, judged, note)
    return [one], np.array([[variance]])


def _variance_of_the_mean(d: Direction, law: Law, column: int, dof: int) -> float:
    """Variance of :func:`mean_compliance`: c = exp(-B theta), so its derivative by theta is -c B."""
    q = np.zeros((len(d.angle), dof))
    q[:, column] = d.angle
    slope = -np.mean(law.compliance(q)[0][:, None] * law.spring.basis(q), axis=0)
    return float(slope @ law.covariance @ slope)


def _least(d: Direction) -> float:
    """Lower limit (95 %) of the stiffness of all set-ups together; NaN where there is none."""
    most = d.mean + d.quantile * d.spread
    return 1.0 / most if most > 0.0 else np.nan
