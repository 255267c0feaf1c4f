"""A model description, read as data, as the arm of this world."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from rehearsal.arm import Arm, Bar, Give, Link, Section
from rehearsal.kinematics import rotation_of
from rehearsal.springs import stiffness_at
from robots.arrays import Array
from robots.schema.description import Joint, ModelDescription
from robots.schema.links import BoxSection, TubeSection
from robots.schema.springs import LogFourierLaw, LogPolynomialLaw, SpringLawTable, TableLaw

LAWS = (LogPolynomialLaw, LogFourierLaw, TableLaw)


def arm_of(d: ModelDescription, load_path: str | None = None) -> Arm:
    """The arm that a description tells of, without its effects; ``load_path`` None: the description's."""
    joints = [_joint(joint) for joint in d.joint]
    flange = d.flange.xyz.si_array
    names = tuple(joint.coordinate for joint in d.joint)
    limits = np.array([joint.limits.si_array for joint in d.joint])
    # Where the next joint's frame starts, seen from the body before it: it does not depend on the angles.
    ends = [t + R @ (axis * shift) for R, t, axis, shift in joints] + [flange]
    laws = tuple(joint.stiffness if isinstance(joint.stiffness, LAWS) else None for joint in d.joint)
    return Arm(
        name=d.name,
        joints=tuple(joint.name for joint in d.joint),
        coordinates=names,
        rotations=np.array([j[0] for j in joints]),
        translations=np.array([j[1] for j in joints]),
        axes=np.array([j[2] for j in joints]),
        shifts=np.array([j[3] for j in joints]),
        signs=np.array([float(joint.sign) for joint in d.joint]),
        offsets=np.array([_si(j.offset) + j.sign * _si(j.zero_error) for j in d.joint]),
        limits=limits,
        couplings=tuple(_couplings(d, names)),
        flange=flange,
        flange_turn=_turn(d.flange),
        tool=np.zeros(3) if d.tool is None else d.tool.xyz.si_array,
        links=tuple(_links(d, ends)),
        bar=_bar(d),
        parallelogram=(load_path or d.load_path) == "parallelogram",
        stiffness=tuple(_spring(joint, law, names, limits.mean(1)) for joint, law in zip(d.joint, laws, strict=True)),
        laws=laws,
        give=_give(d, [j[2] for j in joints]),
    )


def _si(quantity: Any) -> float:
    return 0.0 if quantity is None else float(quantity.si)


def _three(quantity: Any) -> Array:
    return np.zeros(3) if quantity is None else np.asarray(quantity.si_array)


def _turn(part: Any) -> Array:
    return np.eye(3) if part.rpy is None else rotation_of(part.rpy.si_array)


def _joint(joint: Joint) -> tuple[Array, Array, Array, float]:
    """Fixed rotation, fixed translation, axis and shift along it."""
    if joint.dh is not None:
        alpha, a, d = joint.dh.alpha.si, joint.dh.a.si, joint.dh.d.si
        c, s = np.cos(alpha), np.sin(alpha)
        return np.array([[1, 0, 0], [0, c, -s], [0, s, c]]), np.array([a, 0.0, 0.0]), np.array([0, 0, 1.0]), d
    assert joint.frame is not None  # noqa: S101 - a joint has one of the two
    axis = np.asarray(joint.frame.axis, dtype=float)
    return _turn(joint.frame), joint.frame.xyz.si_array, axis / np.linalg.norm(axis), 0.0


def _couplings(d: ModelDescription, names: tuple[str, ...]) -> Iterator[tuple[Array, float, float, float]]:
    for coupling in d.coupling:
        factors = np.zeros(len(names))
        for term in coupling.terms:
            factors[names.index(term.coordinate)] += term.factor
        low, high = coupling.limits.si_array
        yield factors, _si(coupling.offset), float(low), float(high)


def section(given: BoxSection | TubeSection) -> Section:
    """A section's outer dimensions."""
    if isinstance(given, TubeSection):
        return Section("tube", given.diameter.si, given.diameter.si, given.wall.si)
    return Section("box", given.width.si, given.height.si, given.wall.si)


def _links(d: ModelDescription, ends: list[Array]) -> Iterator[Link]:
    numbers = {"base": 0} | {joint.name: i + 1 for i, joint in enumerate(d.joint)}
    for entry in d.link:
        material, body = d.materials[entry.material], numbers[entry.body]
        points = [np.zeros(3), *(v.si_array for v in entry.via), ends[body]]
        start = section(entry.section)
        end = start if entry.section_end is None else section(entry.section_end)
        youngs = material.youngs_modulus if entry.youngs_modulus is None else entry.youngs_modulus
        up = np.asarray(entry.beam_up, dtype=float)
        yield Link(entry.name, body, np.array(points), up, start, end, youngs.si, material.poissons_ratio.si)


def _bar(d: ModelDescription) -> Bar | None:
    p = d.parallelogram
    if p is None:
        return None
    names = [joint.name for joint in d.joint]
    crank, bar = d.materials[p.crank_material], d.materials[p.bar_material]
    return Bar(
        names.index(p.crank_about),
        names.index(p.driven),
        p.pin.si_array,
        section(p.bar),
        section(p.crank),
        crank.youngs_modulus.si,
        crank.poissons_ratio.si,
        bar.youngs_modulus.si,
        None if p.bar_stiffness is None else p.bar_stiffness.si,
    )


def _spring(joint: Joint, law: SpringLawTable | None, names: tuple[str, ...], middle: Array) -> float | None:
    if law is not None:
        return float(stiffness_at(law, names, middle[None])[0])
    return None if joint.stiffness is None else _si(joint.stiffness)


def _give(d: ModelDescription, axes: list[Array]) -> Give:
    bearings = np.zeros((len(d.joint), 6, 6))
    laws = []
    for k, joint in enumerate(d.joint):
        if joint.bearing is not None:
            bearings[k] = joint.bearing.compliance
        if joint.translational_stiffness is not None:
            bearings[k][[0, 1, 2], [0, 1, 2]] = 1.0 / joint.translational_stiffness.si
        if joint.tilt_stiffness is not None:
            bearings[k][[3, 4], [3, 4]] = 1.0 / joint.tilt_stiffness.si
        if joint.bearing_laws is not None:
            laws += [(k, row, law) for row, law in joint.bearing_laws.given]
    tool = None if d.tool is None else d.tool.stiffness
    load = d.load
    return Give(
        np.zeros((6, 6)) if d.base is None else d.base.compliance,
        np.zeros((6, 6)) if tool is None else tool.compliance,
        bearings,
        tuple(laws),
        *(_three(getattr(load, name, None)) for name in ("offset", "tilt", "point")),
    )
