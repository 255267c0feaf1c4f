"""What goes wrong between a data sheet and a model file: one slip at a time, as another reading of the same angles.

A slip has the angles that it would make of those in the table. Where it has a size (an offset, a length), the size is
found from the positions.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.spatial.transform import Rotation

from robots.arrays import Array
from robots.controller import shown_tool
from robots.kinematics import forward_kinematics
from robots.robot import Robot

Kind = Literal["angles", "offset", "length"]
Frame = Literal["base", "tool", "turned-base"]
# Quarter turns are what zeros differ by as a rule; others are found from the nearest of these.
STARTS_rad = np.radians(np.arange(-165.0, 181.0, 15.0))
# Each time the search for an offset looks eight times closer: 15 deg come down to 1e-8 rad.
ZOOMS = 9


@dataclass(frozen=True, eq=False)
class Slip:
    """One thing that may be wrong with the model.

    ``kind``: it makes other angles of those read ("angles"), adds an unknown angle to one ("offset"), or changes a
    length ("length"). ``joint``: index of the joint it concerns, -1: all. ``apply``: angles (n, dof) rad it makes;
    ``along``: which component of the joint's place (0 to 2) a length changes. ``remedy``: what to write in the file.
    """

    code: str
    kind: Kind
    words: str
    remedy: str
    joint: int = -1
    apply: Callable[[Array], Array] | None = None
    along: int = -1


def slips(robot: Robot) -> tuple[Slip, ...]:
    """All single slips that a robot's model can have."""
    return (*_of_all_angles(robot), *_of_joints(robot), *_of_lengths(robot))


def _of_all_angles(robot: Robot) -> Iterator[Slip]:
    yield Slip(
        "radians", "angles", "the table's angles are radians, not degrees", "convert them to degrees", apply=np.degrees
    )
    controller = robot.controller
    if controller is not None and (controller.coupled or controller.offset.any()):
        words = "the angles are the model's coordinates already, not the controller's"
        yield Slip(
            "controller",
            "angles",
            words,
            "remove [controller] axes and angle from the model file, or name the "
            f"table's columns {', '.join(robot.coordinates)}",
            apply=controller.controller,
        )


def _of_joints(robot: Robot) -> Iterator[Slip]:
    for k, (name, coordinate) in enumerate(zip(robot.joint_names, robot.coordinates, strict=True)):
        flipped = -1 if robot.sign[k] > 0 else 1
        yield Slip(
            f"sign:{name}",
            "angles",
            f"{name} turns the other way",
            f"in [[joint]] {name}: sign = {flipped}",
            k,
            _changed(k, k, -2.0),
        )
        yield Slip(f"offset:{name}", "offset", f"{name} counts from another zero", "", k)
        before = [j for j in (k - 1, k - 2) if j >= 0]
        for j in [*before, *([k + 1] if k + 1 < robot.dof else [])]:
            for factor in (1.0, -1.0):
                other = robot.joint_names[j]
                sum_ = "plus" if factor > 0 else "minus"
                yield Slip(
                    f"coupled:{name}:{other}",
                    "angles",
                    f"the controller's angle of {name} is coupled to {other}: {coordinate} of the model is the "
                    f"controller's {name} {sum_} {other}",
                    _coupled_remedy(robot, k, j, factor),
                    k,
                    _changed(k, j, factor),
                )


def _coupled_remedy(robot: Robot, k: int, j: int, factor: float) -> str:
    """The [controller] table that couples coordinate k to the controller's axis j."""
    names = robot.controller.names if robot.controller else tuple(f"J{i + 1}_deg" for i in range(robot.dof))
    axes = ", ".join(f'"{name}"' for name in names)
    return (
        f'[controller] axes = [{axes}] and [[controller.angle]] coordinate = "{robot.coordinates[k]}", '
        f'terms = [{{ axis = "{names[k]}", factor = 1 }}, {{ axis = "{names[j]}", factor = {factor:g} }}]; '
        "name the table's columns so"
    )


def _of_lengths(robot: Robot) -> Iterator[Slip]:
    for k, name in enumerate(robot.joint_names):
        for along, axis in enumerate("xyz"):
            words = f"{name}'s place is off along {axis} of the frame before it"
            yield Slip(f"length:{name}.{axis}", "length", words, "", k, along=along)


def _changed(k: int, j: int, factor: float) -> Callable[[Array], Array]:
    """Adds ``factor`` times angle j to angle k."""

    def apply(q: Array) -> Array:
        out = q.copy()
        out[:, k] = out[:, k] + factor * q[:, j]
        return out

    return apply


@dataclass(frozen=True, eq=False)
class Fitted:
    """Positions explained by slips: ``sizes`` by code (rad or m), the frames' shifts, what is left (n, 3) m."""

    left: Array
    sizes: dict[str, float]
    shift: dict[Frame, Array]
    q: Array

    @property
    def worst(self) -> float:
        """Largest distance that is left, m."""
        return float(np.linalg.norm(self.left, axis=1).max())


def fitted(robot: Robot, q: Array, position: Array, chosen: tuple[Slip, ...], frames: tuple[Frame, ...]) -> Fitted:
    """Explain positions (n, 3) m in the model's base frame, read at angles q (n, dof) rad, by some slips and frames."""
    for slip in chosen:
        if slip.apply is not None:
            q = slip.apply(q)
    sizes: dict[str, float] = {}
    lengths = tuple(slip for slip in chosen if slip.kind == "length")
    for slip in (slip for slip in chosen if slip.kind == "offset"):
        sizes[slip.code] = size = _offset(robot, q, position, slip.joint, lengths, frames)
        q = q.copy()
        q[:, slip.joint] += size
    left, found, shift = _linear(_Placed.of(robot, q, lengths), position, frames)
    return Fitted(
        left[0],
        sizes | {slip.code: float(v) for slip, v in zip(lengths, found[0], strict=True)},
        {frame: value[0] for frame, value in shift.items()},
        q,
    )


@dataclass(frozen=True, eq=False)
class _Placed:
    """Where the model has the tool (m, n, 3), the flange's turn (m, n, 3, 3), and what a length moves (m, n, 3, l)."""

    there: Array
    flange: Array
    moved: Array

    @classmethod
    def of(cls, robot: Robot, q: Array, lengths: tuple[Slip, ...]) -> _Placed:
        """At angles q (n, dof) rad; m is 1."""
        at = forward_kinematics(robot, q)
        moved = [at.R[:, slip.joint, :, slip.along] for slip in lengths]
        return cls(
            (at.p_flange + at.R_flange @ shown_tool(robot)[:3, 3])[None],
            at.R_flange[None],
            np.stack(moved, axis=2)[None] if moved else np.zeros((1, len(q), 3, 0)),
        )


def _offset(
    robot: Robot, q: Array, position: Array, k: int, lengths: tuple[Slip, ...], frames: tuple[Frame, ...]
) -> float:
    """The angle (rad) added to coordinate k that leaves least.

    Everything behind a joint turns with the cosine and the sine of its angle, so three angles give all others.
    """
    at = [_Placed.of(robot, q + angle * np.eye(robot.dof)[k], lengths) for angle in (0.0, 0.5 * np.pi, np.pi)]

    def turned(parts: list[Array], angle: Array) -> Array:
        middle, half = 0.5 * (parts[0] + parts[2]), 0.5 * (parts[0] - parts[2])
        shape = (-1,) + (1,) * (parts[0].ndim - 1)
        return np.asarray(
            middle + np.cos(angle).reshape(shape) * half + np.sin(angle).reshape(shape) * (parts[1] - middle)
        )

    tried, width = STARTS_rad, float(np.radians(15.0))
    best = 0.0
    for _ in range(ZOOMS):
        placed = _Placed(*(turned([getattr(one, part) for one in at], tried) for part in ("there", "flange", "moved")))
        left = _linear(placed, position, frames)[0]
        best = float(tried[np.argmin((left**2).sum(axis=(1, 2)))])
        tried, width = best + width * np.linspace(-1.0, 1.0, 17), width / 8.0
    return float((best + np.pi) % (2.0 * np.pi) - np.pi)


def _linear(placed: _Placed, position: Array, frames: tuple[Frame, ...]) -> tuple[Array, Array, dict[Frame, Array]]:
    """What is left (m, n, 3) m, with lengths (m, l) and shifts (m, 3 or 6) of frames found by least squares."""
    there = placed.there
    m, n = there.shape[:2]
    nothing = np.zeros((m, placed.moved.shape[3]))
    if "turned-base" in frames:
        R, b = _rigid(there, position)
        turn = Rotation.from_matrix(R).as_rotvec()
        left = position - there @ np.swapaxes(R, 1, 2) - b[:, None]
        return left, nothing, {"turned-base": np.concatenate([turn, b], axis=1)}
    miss = position - there
    design = [placed.moved] if placed.moved.shape[3] else []
    design += [np.broadcast_to(np.eye(3), (m, n, 3, 3))] if "base" in frames else []
    design += [placed.flange] if "tool" in frames else []
    if not design:
        return miss, nothing, {}
    A = np.concatenate(design, axis=3).reshape(m, 3 * n, -1)
    x = (np.linalg.pinv(A, rcond=1e-9) @ miss.reshape(m, -1, 1))[..., 0]
    left = miss - (A @ x[..., None]).reshape(m, n, 3)
    rest = x[:, nothing.shape[1] :]
    return left, x[:, : nothing.shape[1]], {f: rest[:, 3 * i : 3 * i + 3] for i, f in enumerate(frames)}


def _rigid(there: Array, position: Array) -> tuple[Array, Array]:
    """Rotations (m, 3, 3) and shifts (m, 3) that carry sets of points (m, n, 3) to others (n, 3) best (Kabsch)."""
    a, b = there.mean(axis=1), position.mean(axis=0)
    U, _, Vt = np.linalg.svd(np.swapaxes(there - a[:, None], 1, 2) @ (position - b))
    V, Ut = np.swapaxes(Vt, 1, 2), np.swapaxes(U, 1, 2)
    fix = np.ones((len(there), 3))
    fix[:, 2] = np.linalg.det(V @ Ut)
    R = (V * fix[:, None]) @ Ut
    return R, b - (R @ a[..., None])[..., 0]
