"""Numbers of a model that can be set free, by name: what they are, their range, how the arm depends on them.

Names: ``PLACE.ROW`` is a stiffness (``j2.rz``, also ``j2.stiffness``; ``base.rx``, ``tool.ty``), with rows tx, ty,
tz (N/m) and rx, ry, rz (N m/rad) in the place's axes; ``PLACE.ROW-ROW`` an entry of the compliance off the
diagonal; ``LINK.modulus`` (Pa) and ``LINK.wall`` (m, a factor of all its walls); ``bar.stiffness`` (N/m);
``JOINT.zero`` (rad), ``load.x|y|z`` (m: where the load acts, from the read point, flange axes),
``load.tilt_x|tilt_y`` (rad: the load's direction about the base axes), ``point.x|y|z`` (m: read and loaded point,
flange axes, of all readings: the model's tool point, and points that readings bring themselves); ``JOINT.law[k]`` the
coefficients of ln(stiffness) over joint angles (:mod:`fem.springs`); ``CODE.NAME`` a number of an effect that the
model has (``backlash:j2.gap``).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from fem.effects.base import EffectParameter, PlacedEffect
from fem.model import ArmModel
from fem.statics.ports import BASE, ROWS, TOOL
from robots import InputError
from robots.arrays import Array

Scale = Literal["compliance", "log", "linear"]
Kind = Literal["stiffness", "coupling", "modulus", "wall", "zero", "load", "tilt", "point", "law", "effect"]

AXES = ("x", "y", "z")
GEOMETRIC: tuple[Kind, ...] = ("zero", "load", "tilt", "point")
# Wider than anything plausible: an estimate that ends there is reported as standing at a bound.
TURN, SHIFT = (1e3, 1e9), (1e4, 1e12)
# An effect's number is searched so many times beyond its plausible size.
BEYOND = 10.0


@dataclass(frozen=True)
class Parameter:
    """A number set free.

    ``value``: the model's own (inf where it is rigid), ``lower`` to ``upper``: the range searched, all in SI
    ``unit``. ``scale``: how an estimator moves it, so that the arm is linear or nearly so: 1/value, ln value or
    the value. ``prior``: mean and standard deviation, of ln value where the value is positive, or None.
    ``place``, ``kind`` and ``index`` say where it sits.
    """

    name: str
    kind: Kind
    place: str
    index: tuple[int, ...]
    unit: str
    value: float
    lower: float
    upper: float
    scale: Scale
    prior: tuple[float, float] | None = None

    def inner(self, value: float) -> float:
        """The estimator's variable for a value."""
        if self.scale == "compliance":
            return 1.0 / value
        return float(np.log(value)) if self.scale == "log" else value

    def outer(self, u: float) -> float:
        """The value for an estimator's variable."""
        if self.scale == "compliance":
            return 1.0 / u if u != 0.0 else np.inf
        return float(np.exp(u)) if self.scale == "log" else u

    @property
    def inner_bounds(self) -> tuple[float, float]:
        """Bounds of the estimator's variable, lower first."""
        ends = self.inner(self.lower), self.inner(self.upper)
        return min(ends), max(ends)

    @property
    def is_joint_spring(self) -> bool:
        """Whether it is a joint's stiffness about its own axis."""
        return self.kind == "stiffness" and self.index == (5,) and self.place not in ("base", "tool", "bar")

    @property
    def is_linear(self) -> bool:
        """Whether the displacement is linear in the estimator's variable."""
        return self.kind in ("stiffness", "coupling", "modulus")

    def between(self, lower: float, upper: float) -> Parameter:
        """Copy with another range; raises InputError if it is none."""
        positive = self.scale != "linear"
        if not (lower < upper and np.isfinite([lower, upper]).all() and (lower > 0.0 or not positive)):
            raise InputError(
                f"range of {self.name} ({self.unit})",
                value=f"{lower:g} to {upper:g}",
                allowed=f"{'0 < ' if positive else ''}lower < upper, finite",
            )
        return replace(self, lower=lower, upper=upper)


def parameter(model: ArmModel, name: str, effects: Sequence[PlacedEffect] = ()) -> Parameter:
    """The parameter of that name with the model's value and the widest plausible range.

    Coefficients of laws are made by :func:`fem.free.laws.law_parameters`; ``effects``: those that the model has.

    Raises
    ------
    InputError
        No such place or number in this model.
    """
    place, _, what = name.partition(".")
    maker = _maker(model, place, what) or _of_effect(effects, name)
    if maker is None:
        raise InputError("parameter", value=name, allowed="; ".join(known_parameters(model, effects)))
    return replace(maker, name=name)


def known_parameters(model: ArmModel, effects: Sequence[PlacedEffect] = ()) -> list[str]:
    """The names that :func:`parameter` takes for this model, in words."""
    joints = model.robot.joint_names
    rows = "|".join(ROWS)
    out = [
        f"{{{','.join((BASE, *joints, TOOL))}}}.{{{rows}}}, two rows joined by '-' for an entry off the diagonal",
        f"{{{','.join(joints)}}}.zero",
        "load.{x|y|z|tilt_x|tilt_y}",
        "point.{x|y|z}",
    ]
    if model.links:
        out.append(f"{{{','.join(link.name for link in model.links)}}}.{{modulus|wall}}")
    if model.bar is not None and model.bar.compliance > 0.0:
        out.append("bar.stiffness")
    for one in effects:
        names = [p.name for p in one.effect.parameters]
        if names:
            out.append(f"{one.effect.code}.{names[0] if len(names) == 1 else '{' + '|'.join(names) + '}'}")
    return out


def _of_effect(effects: Sequence[PlacedEffect], name: str) -> Parameter | None:
    code, _, what = name.rpartition(".")
    for one in effects:
        for k, p in enumerate(one.effect.parameters):
            if (one.effect.code, p.name) == (code, what):
                lower, upper, scale = _range_of(p)
                value = p.value(float(one.values[k]))
                return Parameter("", "effect", code, (k,), p.si_unit, value, lower, upper, scale)
    return None


def _range_of(p: EffectParameter) -> tuple[float, float, Scale]:
    """Widest range of an effect's number, and how an estimator moves it."""
    if p.scale == "compliance":
        return (*(TURN if p.dimension == "rotational stiffness" else SHIFT), "compliance")
    if p.role == "shape":
        # Pure numbers bend or choose a law within their range only.
        beyond = BEYOND if p.lower > 0.0 and p.dimension != "ratio" else 1.0
        return p.lower / beyond, p.upper * beyond, "log" if p.lower > 0.0 else "linear"
    return -BEYOND * p.upper if p.signed else 0.0, BEYOND * p.upper, "linear"


def _maker(model: ArmModel, place: str, what: str) -> Parameter | None:
    joints = model.robot.joint_names
    if place in (BASE, TOOL, *joints):
        row = "rz" if what == "stiffness" and place in joints else what
        if row in ROWS:
            _refuse_law(model, place, ROWS.index(row))
            return _stiffness(model, place, ROWS.index(row))
        pair = what.split("-")
        if len(pair) == 2 and pair[0] != pair[1] and set(pair) <= set(ROWS):
            return _coupling(model, place, *sorted(ROWS.index(r) for r in pair))
    if place in joints and what == "zero":
        return _linear("zero", place, (joints.index(place),), "rad", np.radians(5.0))
    if place == "load" and what in AXES:
        return _linear("load", place, (AXES.index(what),), "m", 0.2)
    if place == "load" and what in ("tilt_x", "tilt_y"):
        return _linear("tilt", place, (AXES.index(what[-1]),), "rad", np.radians(10.0))
    if place == "point" and what in AXES:
        return _linear("point", place, (AXES.index(what),), "m", 0.5)
    for link in model.links:
        if place == link.name and what == "modulus":
            E = link.mesh.youngs_modulus
            return Parameter("", "modulus", place, (), "Pa", E, 0.1 * E, 10.0 * E, "compliance")
        if place == link.name and what == "wall":
            t = float(link.mesh.dimensions[0, 0, -1])
            return Parameter("", "wall", place, (), "m", t, t / 2.0, t * 2.0, "log")
    if place == "bar" and what == "stiffness" and model.bar is not None and model.bar.compliance > 0.0:
        return Parameter("", "stiffness", place, (0,), "N/m", 1.0 / model.bar.compliance, *SHIFT, "compliance")
    return None


def _refuse_law(model: ArmModel, place: str, row: int) -> None:
    if place in model.robot.joint_names and any(
        row == given for given, _ in model.joints[model.robot.joint_names.index(place)].laws
    ):
        raise InputError(
            f"parameter {place}.{ROWS[row]}",
            value="a law over the joint's angle (bearing_laws)",
            allowed="a constant of the model file",
            remedy="leave it as it is, or replace the law by a constant in [joint.bearing]",
        )


def _stiffness(model: ArmModel, place: str, row: int) -> Parameter:
    compliance = float(np.max(own_compliance(model, place, row, row, np.zeros((1, model.robot.dof)))))
    unit, span = ("N/m", SHIFT) if row < 3 else ("N m/rad", TURN)
    value = 1.0 / compliance if compliance > 0.0 else np.inf
    return Parameter("", "stiffness", place, (row,), unit, value, *span, "compliance")


def _coupling(model: ArmModel, place: str, a: int, b: int) -> Parameter:
    unit = ("m/N", "rad/N", "rad/(N m)")[int(a >= 3) + int(b >= 3)]
    # An entry off the diagonal is below the geometric mean of its two entries on it.
    most = float(np.sqrt(_softest(a) * _softest(b)))
    own = own_compliance(model, place, a, b, np.zeros((1, model.robot.dof)))
    return Parameter("", "coupling", place, (a, b), unit, float(own[0]), -most, most, "linear")


def _softest(row: int) -> float:
    return 1.0 / (SHIFT if row < 3 else TURN)[0]


def _linear(kind: Kind, place: str, index: tuple[int, ...], unit: str, most: float) -> Parameter:
    return Parameter("", kind, place, index, unit, 0.0, -most, most, "linear")


def own_compliance(model: ArmModel, place: str, a: int, b: int, q: Array) -> Array:
    """The model's compliance (n,) between two rows of base, tool or a joint (SI), or of the bar."""
    if place == "bar":
        return np.full(len(q), 0.0 if model.bar is None else model.bar.compliance)
    if place in model.robot.joint_names:
        joint = model.joints[model.robot.joint_names.index(place)]
        if (a, b) == (5, 5):
            return joint.axial.compliance(q)
        varying = [law.compliance(q) for row, law in joint.laws if (a, b) == (row, row)]
        return np.full(len(q), joint.bearing[a, b]) + sum(varying, np.zeros(len(q)))
    return np.full(len(q), (model.base if place == BASE else model.tool)[a, b])
