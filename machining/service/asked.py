"""What commands share: the session's robot as they see it, poses and targets of a request, values of a quantity."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import Any

import numpy as np

import fem
from fem.statics.small_displacements import FLAG, beyond_small
from machining.cell import ArmBodies, Cell, scene_of
from machining.inputs import as_units
from machining.placement import on_axes
from machining.service.state import WAYS, State, has_target, target_of, vectors_of
from machining.service.wire import Fields
from machining.stiffness.cartesian import translational
from machining.stiffness.indices import INDICES, evaluate, stiffness_index
from machining.stiffness.objective import DISPLACEMENTS, displaced, shown
from machining.toolpaths.path_error import PathError
from robots import InputError, InverseSolutions, Reason, forward_kinematics, inverse_kinematics
from robots.arrays import Array, Integers
from robots.inverse.solutions import why_no_closed_form

# Digits to which merits are compared: differences beyond are rounding.
TIE = 9


class Arm:
    """The robot as commands see it.

    ``model`` stands on its linear axes, ``bare`` on a stiff base; ``searched``: its inverse kinematics has no closed
    form; ``scene``: arm and cell, None: collisions are not looked at; ``state`` as it is set, ``start`` as it was at
    first.
    """

    def __init__(self, model: fem.ArmModel, cell: Cell, bodies: ArmBodies | None) -> None:
        self.robot, self.bare = model.robot, model
        self.model = on_axes(model, cell)
        self.scene = None if bodies is None else scene_of(cell, bodies)
        self.searched = why_no_closed_form(model.robot) is not None
        limits = np.array([axis.limits for axis in cell.linear_axes]).reshape(-1, 2)
        # 0, or the nearest that the axis allows.
        self.start = State(cell, np.clip(np.zeros(len(limits)), limits[:, 0], limits[:, 1]))
        self.state = self.start


def generator(arm: Arm) -> np.random.Generator | None:
    """Random starts of arms that have to be searched: the same for the same request."""
    return np.random.default_rng(0) if arm.searched else None


def near_of(arm: Arm, fields: Fields) -> Array | None:
    """``near_deg`` as (dof,) rad."""
    given = fields.vector("near_deg", arm.robot.dof)
    return None if given is None else np.radians(given)


def solutions(arm: Arm, state: State, T: Array, near: Array | None) -> InverseSolutions:
    """All branches of a target (4, 4) in the frame that requests count in."""
    target = state.T_base_given @ T
    return inverse_kinematics(arm.robot, target[None], T_flange_tool=state.T_tool, near=near, generator=generator(arm))


def nearest_column(found: InverseSolutions, near: Array | None, do: str) -> int:
    """Column of the branch nearest to ``near`` (rad; None: the middle of the ranges).

    Raises
    ------
    InputError
        No branch can be taken; it says why.
    """
    columns = np.flatnonzero(found.valid[0])
    if not len(columns):
        raise not_reached(found, do)
    wanted = found.robot.limits.mean(axis=1) if near is None else near
    # The angles are in the turn nearest to the wanted ones already.
    return int(columns[((found.q[0, columns] - wanted) ** 2).sum(axis=1).argmin()])


def best_first(merit: Array, q: Array, near: Array) -> Integers:
    """Rows by merit (k,), large first; of equally good poses q (k, dof) rad the one nearest to ``near`` first.

    Flipping a spherical wrist with springs about its axes alone changes nothing, nor does turning a tool on axis 6.
    """
    scale = np.abs(merit).max(initial=0.0) or 1.0
    return np.lexsort((((q - near) ** 2).sum(axis=1), -(merit / scale).round(TIE)))


def middle(arm: Arm) -> Array:
    """Middle (dof,) rad of the joint ranges: what is near where nothing is said."""
    return np.asarray(arm.robot.limits.mean(axis=1))


def not_reached(found: InverseSolutions, do: str) -> InputError:
    """Why a target cannot be taken."""
    reasons = Counter(found.reason[0].tolist())
    words = [
        f"{times} of {len(found.names)} branches {Reason(code).words}"
        for code, times in reasons.most_common()
        if Reason(code) is not Reason.NO_SUCH
    ]
    return InputError(
        f"{do}: the tool cannot be brought there",
        code="V003",
        value="; ".join(words) or "no solution was found",
        allowed="one branch within reach and joint limits",
        remedy="turn the tool (gamma_deg), move the part or the base, or ask for which = all to see every branch",
    )


@dataclass(frozen=True, eq=False)
class Poses:
    """Poses ``q`` (n, dof) rad of a request; ``one``: a single one was given; ``T``: the target it came from."""

    q: Array
    one: bool
    T: Array | None = None

    def answer(self, values: list[Any]) -> Any:
        """A value for a single pose, a list for a list."""
        return values[0] if self.one else values


def poses_of(arm: Arm, fields: Fields, state: State, *, inside: bool = True) -> Poses:
    """``q_deg``, one pose or a list, or a target with ``near_deg``.

    Raises
    ------
    InputError
        Neither or both of them; with ``inside`` poses beyond joint limits.
    """
    q = fields.rows("q_deg", arm.robot.dof)
    fields.seen += [*WAYS, "tool_axis", "gamma_deg", "near_deg"]
    if q is None:
        if not has_target(fields):
            raise fields.fault("pose", None, f"q_deg, or one of {', '.join(WAYS)}", "give one of them")
        T, near = target_of(fields, state.reference), near_of(arm, fields)
        found = solutions(arm, state, T, near)
        return Poses(found.q[:, nearest_column(found, near, fields.do)], True, T)
    if has_target(fields):
        raise fields.fault("pose", "both", f"q_deg, or one of {', '.join(WAYS)}", "give one of them")
    poses = Poses(np.radians(np.atleast_2d(q)), q.ndim == 1)
    reached = arm.robot.reachable(poses.q)
    if inside and not reached.all():
        row = int(np.argmin(reached))
        raise PathError(
            row,
            f"{fields.do}: q_deg" + ("" if poses.one else f", row {row}"),
            code="V003",
            value="; ".join(arm.robot.violations(poses.q[row])),
            allowed="poses within joint limits",
            remedy="correct it",
        )
    return poses


def in_base(state: State, vectors: Array | None) -> Array | None:
    """Directions or forces (3,) or (n, 3) of a request in base axes."""
    return None if vectors is None else np.asarray(vectors @ state.T_base_given[:3, :3].T)


def fitting(fields: Fields, key: str, vectors: Array | None, n: int) -> Array | None:
    """Refuse another number of rows than n."""
    if vectors is not None and vectors.ndim == 2 and len(vectors) != n:
        raise fields.fault(key, f"{len(vectors)} rows", f"one vector, or {n}")
    return vectors


def force_of(fields: Fields, state: State, n: int) -> Array | None:
    """``force_N`` of the request, else the one that is set: (3,) or (n, 3) N, base axes."""
    return in_base(state, fitting(fields, "force_N", vectors_of(fields, "force_N", state.force), n))


def direction_of(fields: Fields, state: State, n: int) -> Array | None:
    """``direction`` likewise; None where there is none: the tool axis is meant."""
    return in_base(state, fitting(fields, "direction", vectors_of(fields, "direction", state.direction), n))


def tool_axes(arm: Arm, state: State, poses: Poses) -> Array:
    """Tool axes (n, 3) of poses, base axes."""
    if poses.T is not None:
        return np.asarray(-(state.T_base_given[:3, :3] @ poses.T[:3, 2])[None])
    return np.asarray(-(forward_kinematics(arm.robot, poses.q).R_flange @ state.T_tool[:3, 2]))


def need_force(fields: Fields, quantity: str, force: Array | None) -> None:
    """Refuse a quantity without the force that it needs."""
    if force is None and (quantity in DISPLACEMENTS or "force" in INDICES[quantity].uses):
        raise fields.fault(f"force_N for {quantity}", None, "N on the tool", "give force_N, or set it")


def values_of(arm: Arm, state: State, quantity: str, q: Array, direction: Array, force: Array | None) -> Array:
    """A quantity (n,) in SI at poses q (n, dof) rad; direction and force in base axes.

    As :meth:`machining.Objective.values`, but infinite where nothing deflects.
    """
    tip = state.T_tool[:3, 3]
    if quantity == "k_fs":
        return stiffness_index(arm.model, q, direction, tip)
    if quantity in DISPLACEMENTS:
        assert force is not None  # noqa: S101 - need_force has seen to it
        d = displacements(arm, state, q, force, None)[:, :3]
        return displaced(quantity, d, as_units("direction", direction, len(q)))
    return evaluate(quantity, translational(arm.model, q, tip), direction, force)


def displacements(arm: Arm, state: State, q: Array, force: Array, moment: Array | None) -> Array:
    """Displacement (n, 6) m and rad of the tool under a force and a moment in base axes."""
    wrench = np.zeros((len(q), 6))
    wrench[:, :3] = force
    if moment is not None:
        wrench[:, 3:] = moment
    return fem.deflection(arm.model, q, wrench, state.T_tool[:3, 3])


def flag_of(arm: Arm, quantity: str, value: Array) -> dict[str, bool]:
    """The flag of an answer, empty for indices and where linear statics holds; ``value`` SI, one or more."""
    moved = np.reshape(value, (-1, 1)) if quantity in DISPLACEMENTS else np.zeros((1, 1))
    return {FLAG: True} if beyond_small(arm.robot, moved).any() else {}


def unit_of(quantity: str) -> tuple[str, float]:
    """Key of a quantity in answers, with its unit, and the factor from SI to that."""
    if quantity in DISPLACEMENTS:
        return f"{quantity.replace(' ', '_')}_mm", 1e3
    it = shown(quantity)
    return it.column, it.factor
