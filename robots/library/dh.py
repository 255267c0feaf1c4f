"""A robot's description from a table of Denavit-Hartenberg parameters, modified (Craig's) or standard."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from robots.arrays import Array
from robots.errors import InputError
from robots.frames import framed, rotation_rpy, rpy_of
from robots.schema.description import DHRow, Flange, Joint, ModelDescription
from robots.schema.quantities import Angle, AngleRange, Angles, Length, Mass, Position

Form = Literal["modified", "standard"]
SOURCE = "table"


@dataclass(frozen=True)
class DHLine:
    """A line of the table, lengths in mm and angles in deg; ``limits`` None: the line of the flange."""

    name: str
    alpha: float
    a: float
    d: float
    theta: float
    limits: tuple[float, float] | None
    sign: Literal[1, -1] = 1


def description_from_dh(
    lines: Sequence[DHLine],
    flange: DHLine | None,
    form: Form,
    *,
    name: str,
    title: str,
    where: str,
    sha256: str,
    payload_kg: float | None = None,
    mass_kg: float | None = None,
) -> ModelDescription:
    """The description of an arm.

    Parameters
    ----------
    lines : one for each joint. Modified: alpha and a come before the joint turns, as of the body before it; standard:
        they come after it, so the last line leads to the flange
    flange : what lies beyond the last joint (modified: alpha, a, theta, d; standard: theta, d, a, alpha)
    where, sha256 : name and hash of the table's file, for [sources] and messages

    Raises
    ------
    InputError
        A modified table without a flange: its last line ends in the last joint.
    """
    if form == "modified" and flange is None:
        raise InputError(
            f"{where}: no row named flange",
            code="R005",
            allowed="a last row flange: alpha_deg, a_mm, d_mm from the last joint to the mounting plate",
            remedy="add it (d_mm = 0 and a_mm = 0 where the last joint's d_mm reaches the plate)",
        )
    before = [(line.alpha, line.a) for line in lines]
    end = np.eye(4)
    if form == "standard":
        before = [(0.0, 0.0), *before[:-1]]
        end = _before(lines[-1])
    if flange is not None:
        end = end @ (_before(flange) @ _turned(flange) if form == "modified" else _turned(flange) @ _before(flange))
    joints = [
        Joint(
            name=line.name,
            coordinate=f"q{i}_deg",
            dh=DHRow(alpha=_angle(alpha), a=_length(a), d=_length(line.d)),
            sign=line.sign,
            offset=_angle(line.theta) if line.theta else None,
            limits=AngleRange(value=line.limits or (), unit="deg", source=SOURCE),
        )
        for i, (line, (alpha, a)) in enumerate(zip(lines, before, strict=True), start=1)
    ]
    kind = "modified Denavit-Hartenberg parameters (Craig)" if form == "modified" else "Denavit-Hartenberg parameters"
    sources = {SOURCE: f"{kind} of {where}, SHA-256 {sha256}"}
    if payload_kg is not None or mass_kg is not None:
        sources["given"] = "given when this file was made"
    return ModelDescription(
        schema="stiffarm-model/1",
        name=name,
        title=title,
        sources=sources,
        joint=tuple(joints),
        flange=_flange(end),
        mass=None if mass_kg is None else Mass(value=mass_kg, unit="kg", source="given"),
        payload=None if payload_kg is None else Mass(value=payload_kg, unit="kg", source="given"),
    )


def _angle(degrees: float) -> Angle:
    return Angle(value=degrees, unit="deg", source=SOURCE)


def _length(mm: float) -> Length:
    return Length(value=mm, unit="mm", source=SOURCE)


def _rotation(roll_deg: float, yaw_deg: float) -> Array:
    return rotation_rpy(np.radians([roll_deg, 0.0, yaw_deg]))


def _before(line: DHLine) -> Array:
    """Rot_x(alpha) Trans_x(a), in either order the same."""
    return framed(_rotation(line.alpha, 0.0), np.array([line.a, 0.0, 0.0]))


def _turned(line: DHLine) -> Array:
    """Rot_z(theta) Trans_z(d)."""
    return framed(_rotation(0.0, line.theta), np.array([0.0, 0.0, line.d]))


def _flange(T_mm: Array) -> Flange:
    x, y, z = (T_mm[:3, 3].round(9) + 0.0).tolist()
    rpy = np.degrees(rpy_of(T_mm[:3, :3])).round(9) + 0.0
    turn: dict[str, Any] = {}
    if rpy.any():
        turn["rpy"] = Angles(value=tuple(rpy.tolist()), unit="deg", source=SOURCE)
    return Flange(xyz=Position(value=(x, y, z), unit="mm", source=SOURCE), **turn)
