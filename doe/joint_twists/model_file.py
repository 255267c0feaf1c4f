"""The identified stiffnesses in a model description: six springs a joint, rigid links, where the numbers came from."""

from __future__ import annotations

import numpy as np

from doe.joint_twists.direction import Direction
from doe.joint_twists.identify import Identified
from doe.joint_twists.laws import Law
from doe.joint_twists.twist_table import is_held, mean_compliance, twist_table
from fem import ArmModel
from fem.statics.ports import ROWS
from robots import ModelDescription
from robots.arrays import Array
from robots.schema.description import Calibration, Joint, LogFourierLaw, PlaceStiffness, Spring, TableLaw
from robots.schema.quantities import RotationalStiffness, TranslationalStiffness

SOURCE_KEY = "identified"


def with_six_springs(description: ModelDescription, model: ArmModel, found: Identified) -> ModelDescription:
    """The description with the identified springs; what has no number is rigid, but a gear keeps the spring it had.

    Laws are written as identified. A table of stiffnesses fits a model file about the axis only: of the other five
    directions the mean compliance over the angles measured is written, which :func:`held_constant` names.
    """
    joints = [_joint(joint, found, k) for k, joint in enumerate(description.joint)]
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
                uncertainty=twist_table(found, model),
                notes=(*found.notes, *held_constant(found)),
            ),
        }
    )
    # Through the validator once more: a written file must be one that can be read.
    return ModelDescription.model_validate(changed.model_dump(by_alias=True))


def held_constant(found: Identified) -> tuple[str, ...]:
    """What the model file does not hold as identified: tables of stiffnesses across the axis."""
    varying = [f"{j}.{r}" for (j, r), d in found.directions.items() if d.law is not None and not is_held(d, d.law)]
    if not varying:
        return ()
    which = f"all {len(varying)} across the axes" if len(varying) > 8 else ", ".join(varying)
    return (
        "model.toml holds these directions as constants, at their mean compliance over the angles measured, where "
        f"identification.json has laws over the angle: {which}",
    )


def constant_compliances(found: Identified, q: Array) -> Array:
    """Compliances (n, dof, 6) as the model file has them: laws where it holds them, else means over the angles."""
    c = found.compliances(q)[0]
    for k, d in enumerate(found.directions.values()):
        if d.law is not None and not is_held(d, d.law):
            c[:, k // 6, k % 6] = mean_compliance(d, d.law, k // 6, q.shape[1])
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


def _joint(joint: Joint, found: Identified, column: int) -> Joint:
    mine = {row: found.directions[joint.name, row] for row in ROWS}
    dof = found.data.q.shape[1]
    across: dict[str, RotationalStiffness | TranslationalStiffness] = {}
    laws: dict[str, LogFourierLaw] = {}
    for row in ROWS[:5]:
        d = mine[row]
        if d.law is not None and d.law.kind != "constant" and is_held(d, d.law):
            laws[row] = _fourier(joint, d.law)
        elif d.law is not None:
            kind = TranslationalStiffness if row.startswith("t") else RotationalStiffness
            value = 1.0 / mean_compliance(d, d.law, column, dof)
            across[row] = kind(value=value, unit=d.unit, source=SOURCE_KEY, note=_note(d, column, dof))
    update: dict[str, object] = {"tilt_stiffness": None, "translational_stiffness": None}
    update["bearing"] = PlaceStiffness(**across) if across else None  # type: ignore[arg-type]
    axial = mine["rz"]
    if axial.law is not None:
        update["stiffness"] = _axial(joint, axial, axial.law, column, dof)
    changed = joint.model_copy(update=update)
    if not laws:
        return changed
    return Joint.model_validate(
        {**changed.model_dump(), "bearing_laws": {row: v.model_dump() for row, v in laws.items()}}
    )


def _axial(joint: Joint, d: Direction, law: Law, column: int, dof: int) -> Spring:
    if law.kind == "constant":
        value = 1.0 / mean_compliance(d, law, column, dof)
        return RotationalStiffness(value=value, unit="N m/rad", source=SOURCE_KEY, note=_note(d, column, dof))
    if law.kind == "table":
        return TableLaw(
            kind="table", input=joint.coordinate, nodes_deg=tuple(np.degrees(d.angle).tolist()),
            stiffness_Nm_per_rad=tuple(np.exp(law.spring.coefficients).tolist()), source=SOURCE_KEY,
        )  # fmt: skip
    return _fourier(joint, law)


def _fourier(joint: Joint, law: Law) -> LogFourierLaw:
    coefficients = tuple(law.spring.coefficients.tolist())
    return LogFourierLaw(kind="log-fourier", input=joint.coordinate, coefficients=coefficients, source=SOURCE_KEY)


def _note(d: Direction, column: int, dof: int) -> str:
    """Status and interval, over all angles measured."""
    q = np.zeros((len(d.angle), dof))
    q[:, column] = d.angle
    _, low, high = d.stiffness(q)
    if d.status == "not judged":
        return f"{d.status}: nothing tells how sure this value is"
    upper = "no upper limit" if np.isinf(high).any() else f"{high.max():.3g}"
    return f"{d.status}; 95 % intervals at the angles measured from {low.min():.3g} to {upper} {d.unit}"
