"""The identified stiffnesses in a model description: six springs a joint, rigid links, how sure, from where.

The table ``[calibration.uncertainty]``: directions are independent, each was found from readings of its own. Within one
the coefficients of a law have the covariance that its fit gave them; a direction that the model file holds as its mean
compliance over the angles measured has the variance of that mean, to first order in the law's coefficients.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import block_diag

from doe.certainty.uncertainty import Status
from doe.joint_twists.identify import Identified
from doe.joint_twists.laws import Direction, Law
from doe.model_file.applied import law_table
from doe.model_file.uncertainty_table import FoundNumber, uncertainty_table
from fem.statics.ports import ROWS
from robots import ModelDescription
from robots.arrays import Array
from robots.schema.description import Calibration, Joint, PlaceStiffness
from robots.schema.quantities import RotationalStiffness, TranslationalStiffness
from robots.schema.uncertainty import CalibrationUncertainty

SOURCE_KEY = "identified"
NOT_JUDGED = "nothing tells how sure this value is"
NOTE = "joint twists: weighted least squares of each direction by itself, scatter of set-ups included"


def with_six_springs(description: ModelDescription, found: Identified) -> ModelDescription:
    """The description with the identified springs; what has no number is rigid, but a gear keeps the spring it had.

    Laws are written as identified. A table of stiffnesses fits a model file about the axis only: of the other five
    directions the mean compliance over the angles measured is written, which :func:`held_constant` names.
    """
    joints = [_joint(joint, found) for joint in description.joint]
    data = found.data
    kind = "synthetic readings" if data.synthetic else "readings"
    source = f"joint twists of {kind} {data.source}, SHA-256 {data.sha256}"
    changed = description.model_copy(
        update={
            "joint": tuple(joints),
            "load_path": "serial",
            "sources": {**description.sources, SOURCE_KEY: source},
            "calibration": Calibration(
                scheme="joint twists" + (" (synthetic readings)" if data.synthetic else ""),
                load_path="serial",
                links="rigid",
                data=data.source,
                data_sha256=data.sha256,
                rms_mm=rms_mm(found),
                loads_N=tuple(np.unique(np.round(data.load[data.load > 0.0], 1)).tolist()),
                uncertainty=twist_table(found),
                notes=(*found.notes, *held_constant(found)),
            ),
        }
    )
    # Through the validator once more: a written file must be one that can be read.
    return ModelDescription.model_validate(changed.model_dump(by_alias=True))


def held_law(d: Direction) -> Law | None:
    """The law that a model file holds as it is; None where it holds a constant, or nothing."""
    across_table = d.law is not None and d.law.kind == "table" and d.row != "rz"
    return None if d.law is None or d.law.kind == "constant" or across_table else d.law


def held_constant(found: Identified) -> tuple[str, ...]:
    """What the model file does not hold as identified: tables of stiffnesses across the axis."""
    varying = [
        f"{d.joint}.{d.row}"
        for d in found.directions.values()
        if d.law is not None and d.law.kind != "constant" and held_law(d) is None
    ]
    if not varying:
        return ()
    which = f"all {len(varying)} across the axes" if len(varying) > 8 else ", ".join(varying)
    return (
        "model.toml holds these directions as constants, at their mean compliance over the angles measured, where "
        f"identify.json has laws over the angle: {which}",
    )


def constant_compliances(found: Identified, q: Array) -> Array:
    """Compliances (n, dof, 6) as the model file has them: laws where it holds them, else means over the angles."""
    c = found.compliances(q)[0]
    for k, d in enumerate(found.directions.values()):
        if d.law is not None and held_law(d) is None:
            c[:, k // 6, k % 6] = d.law.value(d.angle).mean()
    return c


def rms_mm(found: Identified) -> float:
    """Root mean square of the displacements at the top loads that the stiffnesses leave over, mm."""
    c, left = found.cycles, []
    compliance = found.compliances(c.q)[0][np.arange(c.m), c.joint]
    for r in range(3):
        use = np.isfinite(c.slope[:, r]) & (compliance[:, r] > 0.0)
        left.append(((c.slope[use, r] - compliance[use, r] * c.carried[use, r]) * c.top[use]) ** 2)
    squares = np.concatenate(left)
    return float(1e3 * np.sqrt(squares.mean())) if squares.size else 0.0


def _joint(joint: Joint, found: Identified) -> Joint:
    constants: dict[str, RotationalStiffness | TranslationalStiffness] = {}
    laws = {}
    for row in ROWS:
        d = found.directions[joint.name, row]
        if (law := held_law(d)) is not None:
            laws[row] = law_table((joint.coordinate,), law.basis, law.coefficients.tolist(), SOURCE_KEY)
        elif d.law is not None:
            kind = TranslationalStiffness if d.is_shift else RotationalStiffness
            value = 1.0 / float(d.law.value(d.angle).mean())
            constants[row] = kind(value=value, unit=d.unit, source=SOURCE_KEY, note=_note(d))
    stiffness = laws.pop("rz", None) or constants.pop("rz", None) or joint.stiffness
    bearing = PlaceStiffness(**constants) if constants else None  # type: ignore[arg-type]
    changed = joint.model_copy(
        update={"tilt_stiffness": None, "translational_stiffness": None, "bearing": bearing, "stiffness": stiffness}
    )
    if not laws:
        return changed
    return Joint.model_validate(
        {**changed.model_dump(), "bearing_laws": {row: v.model_dump() for row, v in laws.items()}}
    )


def _note(d: Direction) -> str:
    """Status and interval, over all angles measured."""
    if d.status == "not judged":
        return f"{d.status}: {NOT_JUDGED}"
    _, low, high = d.stiffness(d.angle)
    upper = "no upper limit" if np.isinf(high).any() else f"{high.max():.3g}"
    return f"{d.status}; 95 % intervals at the angles measured from {low.min():.3g} to {upper} {d.unit}"


def twist_table(found: Identified) -> CalibrationUncertainty | None:
    """The table of everything that was identified, judged or not; None where no number has a variance.

    A direction that no reading loads or watches keeps what the model had: it is among the ``undetermined``, as are
    those without an interval ("not judged") and those whose best compliance is not positive.
    """
    parts = [_numbers(d) for d in found.directions.values()]
    numbers = [n for mine, _ in parts for n in mine]
    if not any(n.has_variance for n in numbers):
        return None
    covariance = block_diag(*(V for _, V in parts))
    return uncertainty_table(numbers, covariance, np.zeros((0, len(covariance))), NOTE)


def _numbers(d: Direction) -> tuple[list[FoundNumber], Array]:
    """The numbers that the model file has of one direction, and their covariance; zeros where there is none."""
    axial = d.row == "rz"
    judged = d.law is not None and bool(np.isfinite(d.law.covariance).all())
    status: Status = "one-sided" if d.status == "one-sided" else "determined" if judged else "not identified"
    note = NOT_JUDGED if d.status == "not judged" else None
    if (law := held_law(d)) is not None:
        whole = f"{d.joint}.law" if axial else f"{d.joint}.{d.row}.law"
        numbers = [
            FoundNumber(
                f"{whole}[{i}]",
                f"ln({d.unit})",
                "linear",
                c,
                (np.nan, np.nan),
                status,
                d.degrees_of_freedom,
                judged,
                note,
            )
            for i, c in enumerate(law.coefficients.tolist())
        ]
        return numbers, law.covariance if judged else np.zeros_like(law.covariance)
    low = high = np.nan
    value = variance = 0.0
    if d.law is not None:
        value = float(d.law.value(d.angle).mean())
        slope = d.law.slopes(d.angle).mean(axis=0)
        variance = float(slope @ d.law.covariance @ slope) if judged else 0.0
    elif d.status == "not determined":
        # The best compliance is not positive: the model is rigid there, and the readings give a lower limit at most.
        status, low, high = "at bound", float(d.stiffness(np.zeros(1))[1][0]), np.inf
    name = f"{d.joint}.{'stiffness' if axial else d.row}"
    one = FoundNumber(name, d.unit, "compliance", value, (low, high), status, d.degrees_of_freedom, judged, note)
    return [one], np.array([[variance]])
