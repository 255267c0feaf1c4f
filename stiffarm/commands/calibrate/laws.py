"""Estimated laws for the report and the results: springs over their own angles, where the readings stood."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from doe.certainty.law_band import LawBand, law_band
from doe.estimation.calibration import StageResult
from fem.free.parameters import FourierBasis, FreeLaw, PolynomialBasis, TableBasis
from robots.arrays import Array
from stiffarm.session.json_text import number

_POINTS = 181


@dataclass(frozen=True)
class LawCurve:
    """A law for drawing: the spring over one angle, and at the poses read.

    ``inputs``: coordinates it hangs on; ``angle_deg`` (n,) with ``band``: over the first of them if there is no
    other, else empty; ``read_deg`` (r,) with ``read``: at the angles read.
    """

    joint: str
    kind: str
    inputs: tuple[str, ...]
    angle_deg: Array
    band: LawBand
    read_deg: Array
    read: LawBand


def curves(s: StageResult) -> list[LawCurve]:
    """Every law of a stage."""
    return [_curve(s, law) for law in s.laws]


def _curve(s: StageResult, law: FreeLaw) -> LawCurve:
    e, robot = s.estimate, s.estimate.problem.free.model.robot
    columns, kind = _inputs(law)
    read = np.unique(np.round(e.problem.free.at.q[:, list(columns)], 9), axis=0)
    poses = np.zeros((len(read), robot.dof))
    poses[:, list(columns)] = read
    first = columns[0]
    q = np.zeros((_POINTS if len(columns) == 1 else 0, robot.dof))
    low, high = robot.limits[first]
    q[:, first] = np.linspace(low, high, len(q))
    return LawCurve(
        law.joint, kind, tuple(robot.coordinates[c] for c in columns),
        np.degrees(q[:, first]), law_band(e, s.certainty, law, q),
        np.degrees(read[:, 0]), law_band(e, s.certainty, law, poses),
    )  # fmt: skip


def _inputs(law: FreeLaw) -> tuple[tuple[int, ...], str]:
    basis = law.basis
    if isinstance(basis, PolynomialBasis):
        return basis.columns, f"polynomial of degree {int(basis.exponents.sum(axis=1).max(initial=0))}"
    if isinstance(basis, FourierBasis):
        return (basis.column,), f"Fourier series of order {basis.order}"
    assert isinstance(basis, TableBasis)  # noqa: S101 - the only other one
    return (basis.column,), f"table of {basis.size} nodes"


def payload(curve: LawCurve) -> dict[str, Any]:
    """A law as JSON: the spring at the angles read, null where it is not determined."""
    rows = zip(curve.read_deg, curve.read.stiffness, curve.read.low, curve.read.high, strict=True)
    return {
        "joint": curve.joint,
        "law": curve.kind,
        "inputs": list(curve.inputs),
        "at_the_angles_read": [
            {f"{curve.inputs[0].removesuffix('_deg')}_deg": number(float(a)), "k_Nm_per_rad": number(float(k)),
             "interval95": [number(float(low)), number(float(high))]}
            for a, k, low, high in rows
        ],
    }  # fmt: skip
