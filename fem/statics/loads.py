"""What loads an arm: arrays that callers hand over, checked; where a load really acts; the arm's own weight.

A load may act beside the read point, and not quite along its nominal direction. The links' weight is the preload that
gears stand under before a load comes.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from fem.model import ArmModel
from fem.statics.transfers import axial_transfers
from robots import InputError, Robot
from robots.arrays import Array, Indices
from robots.constants import STANDARD_GRAVITY
from robots.frames import rotation_rpy
from robots.kinematics import forward_kinematics

# Loads that came of others are remembered for so many changes of them.
RECALLED = 4


def as_wrenches(wrench: ArrayLike, n: int) -> Array:
    """Wrenches (n, 6) from (6,) or (n, 6): force N, moment N m.

    Raises
    ------
    InputError
        Another shape, or a value that is not finite.
    """
    w = np.asarray(wrench, dtype=np.float64)
    _check("wrench array", w, 6, n, "force N, moment N m")
    return np.broadcast_to(w, (n, 6))


def as_points(point: ArrayLike | None, n: int) -> Array | None:
    """Tool points (n, 3) m in the flange frame from (3,) or (n, 3); None stays None (the model's own).

    Raises
    ------
    InputError
        Another shape, or a value that is not finite.
    """
    if point is None:
        return None
    p = np.asarray(point, dtype=np.float64)
    _check("tool point array", p, 3, n, "m in the flange frame")
    return np.broadcast_to(p, (n, 3))


def _check(what: str, values: Array, width: int, n: int, unit: str) -> None:
    allowed = f"finite, shape ({width},) or ({n}, {width}): {unit}"
    if values.shape not in ((width,), (n, width)):
        raise InputError(what, code="A006", value=f"shape {values.shape}", allowed=allowed, remedy="one row a pose")
    if not np.isfinite(values).all():
        bad = np.atleast_2d(values)
        row = int(np.flatnonzero(~np.isfinite(bad).all(axis=1))[0])
        raise InputError(
            f"{what}, row {row}",
            code="A006",
            value=bad[row].tolist(),
            allowed=allowed,
            remedy="remove or complete that row",
        )


@dataclass(frozen=True)
class LoadedPoses:
    """n loaded poses: ``q`` (n, dof) rad, ``wrench`` (n, 6) base axes at ``point`` (n, 3) m in the flange frame."""

    q: Array
    wrench: Array
    point: Array

    def __len__(self) -> int:
        return len(self.q)

    @cached_property
    def distinct(self) -> tuple[LoadedPoses, Indices]:
        """The loaded poses without repeats, in the order in which they come, and which of them each one (n,) is.

        Itself where none comes twice.
        """
        # What is equal has equal bytes but for the sign of zeros.
        rows = np.hstack([self.q, self.wrench, self.point]) + 0.0
        keys = np.ascontiguousarray(rows).view(np.dtype((np.void, rows.itemsize * rows.shape[1]))).reshape(-1)
        _, first, where = np.unique(keys, return_index=True, return_inverse=True)
        if len(first) == len(self):
            return self, np.arange(len(self))
        order = np.argsort(first)
        place = np.empty_like(order)
        place[order] = np.arange(len(order))
        kept = first[order]
        return LoadedPoses(self.q[kept], self.wrench[kept], self.point[kept]), place[where.reshape(-1)]

    def recalled(self, other: LoadedPoses) -> LoadedPoses:
        """Loads that came of these, or those of the last few times that are equal to them.

        What was worked out of them serves again where many effects are tried beside one that changes loads.
        """
        kept: list[LoadedPoses] = self.__dict__.setdefault("_recalled", [])
        found = next((k for k, one in enumerate(kept) if one.equals(other)), None)
        one = other if found is None else kept.pop(found)
        kept[:] = [one, *kept[: RECALLED - 1]]
        return one

    def equals(self, other: LoadedPoses) -> bool:
        """Whether these are the same loads to the last digit."""
        pairs = (self.wrench, other.wrench), (self.q, other.q), (self.point, other.point)
        return all(a is b or np.array_equal(a, b) for a, b in pairs)

    def repeated(self, where: Indices) -> LoadedPoses:
        """Loaded poses (n,) that are these again and again, as ``where`` (n,) says."""
        out = LoadedPoses(self.q[where], self.wrench[where], self.point[where])
        # Where a cached property keeps what it found.
        out.__dict__["distinct"] = (self, where)
        return out


def placed(robot: Robot, at: LoadedPoses, offset: Array, tilt: Array) -> LoadedPoses:
    """The loads turned by ``tilt`` rad about the base's axes and moved ``offset`` m, flange axes; (3,) or (n, 3) each.

    The result has the equivalent wrench at the same read point: a force beside it adds its moment.
    """
    if not (offset.any() or tilt.any()):
        return at
    R = np.broadcast_to(np.moveaxis(rotation_rpy(tilt.T), (0, 1), (-2, -1)), (len(at), 3, 3))
    force, moment = np.einsum("nij,nj->ni", R, at.wrench[:, :3]), np.einsum("nij,nj->ni", R, at.wrench[:, 3:])
    lever = np.einsum("nij,nj->ni", forward_kinematics(robot, at.q).R_flange, np.broadcast_to(offset, (len(at), 3)))
    return LoadedPoses(at.q, np.concatenate([force, moment + np.cross(lever, force)], axis=1), at.point)


def as_read(model: ArmModel, at: LoadedPoses) -> LoadedPoses:
    """The nominal loads of loads that act as the model says: :func:`as_loaded` undone.

    Further tilts and offsets are added to the model's own before loads are placed: turns about several axes cannot be
    put on one after the other in two steps.
    """
    if not (model.load_offset.any() or model.load_tilt.any()):
        return at
    back = rotation_rpy(model.load_tilt).T
    lever = forward_kinematics(model.robot, at.q).R_flange @ model.load_offset
    moment = at.wrench[:, 3:] - np.cross(lever, at.wrench[:, :3])
    return LoadedPoses(at.q, np.hstack([at.wrench[:, :3] @ back.T, moment @ back.T]), at.point)


def turned(model: ArmModel, at: LoadedPoses, R: Array) -> LoadedPoses:
    """Loads that the model's table states in axes which ``R`` (3, 3) turns into the base's."""
    read = as_read(model, at)
    wrench = np.hstack([read.wrench[:, :3] @ R.T, read.wrench[:, 3:] @ R.T])
    return placed(model.robot, LoadedPoses(at.q, wrench, at.point), model.load_offset, model.load_tilt)


def as_loaded(model: ArmModel, q: Array, wrench: Array, point: Array) -> LoadedPoses:
    """Nominal loads as the model says that they act."""
    return placed(model.robot, LoadedPoses(q, wrench, point), model.load_offset, model.load_tilt)


def gravity_torque(model: ArmModel, q: Array) -> Array:
    """Torque (n, dof) N m of the links' weight at the springs about the joints' axes; q (n, dof) rad.

    Weight acts along -Z of the base. Masses as declared (:attr:`ArmModel.masses`), without tool and payload; the bar
    of a parallelogram has none here. Zero where no masses are declared.
    """
    frames = forward_kinematics(model.robot, q)
    out = np.zeros((len(q), model.robot.dof))
    p = model.robot.parallelogram
    serial = replace(model, bar=None)
    for mass in model.masses:
        point = frames.p[:, mass.body] + frames.R[:, mass.body] @ mass.centre
        force = np.array([[0.0], [0.0], [-STANDARD_GRAVITY * mass.kg], [0.0], [0.0], [0.0]])
        # The bar holds what hangs on the driven link and beyond, nothing before it.
        beyond = p is not None and mass.body > p.driven
        for joint, torque in axial_transfers(model if beyond else serial, frames, point):
            if joint < mass.body:
                out[:, joint] += torque.carried(np.broadcast_to(force, (6, len(q))))[0]
    return out
