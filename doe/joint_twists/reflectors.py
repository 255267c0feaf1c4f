"""Retroreflectors of a tracker on two neighbouring arms: rigid-body fits, and tables of their coordinates.

Tables have one row a reflector. Columns beside those of :func:`doe.joint_twists.table.read_twists`: ``reading`` (label:
rows of one reading have one pose, joint, load and phase), ``arm`` (before or behind the joint), ``reflector`` (label),
its coordinates in the robot's base frame without the load ``x0_mm y0_mm z0_mm`` and under it ``x_mm y_mm z_mm``;
``sigma_mm``: the tracker's noise in a coordinate. Where that is not given it is estimated from what the rigid-body fits
leave over.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from doe.joint_twists.readings import ARMS, LOADED, UNLOADED
from doe.tables.measurements import rows_of
from doe.tables.schema import Cells
from robots import InputError, Robot, forward_kinematics
from robots.arrays import Array, Indices

FEWEST = 3
# Second singular value of the reflectors' spread over the first: below it a turn about their line is not seen.
THIN = 0.05
# A reflector that moved further under the load was knocked, or two were mixed up.
FARTHEST_M = 0.05


@dataclass(frozen=True)
class Motion:
    """Rigid motion of a body, small: ``x -> x + t + r x (x - origin)``.

    ``twist`` (6,): t (m), r (rad) in the axes of the coordinates, at ``origin``; ``covariance`` (6, 6) for noise of
    one (m) in each coordinate of each reflector, unloaded and loaded; ``residuals`` (k, 3) m.
    """

    twist: Array
    covariance: Array
    residuals: Array


def motion(unloaded: Array, loaded: Array, origin: Array, what: str) -> Motion:
    """Motion of an arm from its reflectors (k, 3) m before and under the load, at ``origin`` (3,).

    Raises
    ------
    InputError
        Fewer than three reflectors, or reflectors nearly in line: the turn about that line is not seen.
    """
    if len(unloaded) < FEWEST:
        raise InputError(
            f"{what}: reflectors",
            code="J002",
            value=len(unloaded),
            allowed=f"{FEWEST} or more, not in line",
            remedy="a rigid body's motion needs three points",
        )
    centre, there = unloaded.mean(axis=0), loaded.mean(axis=0)
    for arms in (unloaded - centre, loaded - there):
        spread = np.linalg.svd(arms, compute_uv=False)
        if spread[1] < THIN * spread[0]:
            raise InputError(
                f"{what}: reflectors nearly in line",
                code="J002",
                value=f"spread across the line {spread[1] / max(spread[0], 1e-300):.3f} of that along it",
                allowed=f"{THIN} or more",
                remedy="move one reflector away from the line: the turn about it cannot be seen",
            )
    # Least squares over rotations (Kabsch 1976, doi:10.1107/S0567739476001873).
    turn = Rotation.align_vectors(loaded - there, unloaded - centre)[0]
    t = there + turn.apply(origin - centre) - origin
    residuals = loaded - there - turn.apply(unloaded - centre)
    return Motion(np.concatenate([t, turn.as_rotvec()]), _covariance(unloaded - origin), residuals)


def _covariance(arms: Array) -> Array:
    """Covariance of t and r for unit noise in unloaded and loaded coordinates alike: (sum G^T G)^-1 times two."""
    G = np.zeros((len(arms), 3, 6))
    G[:, :, :3] = np.eye(3)
    # r x a, for a turn about each axis.
    G[:, :, 3:] = np.swapaxes(np.cross(np.eye(3), arms[:, None]), 1, 2)
    # Scaled to the reflectors' size, so that metres and radians do not spoil the inversion.
    size = np.concatenate([np.ones(3), np.full(3, 1.0 / max(np.linalg.norm(arms, axis=1).max(), 1e-9))])
    A = np.einsum("kia,kib->ab", G * size, G * size)
    return np.asarray(2.0 * np.outer(size, size) * np.linalg.inv(A))


def relative(before: Motion, behind: Motion, R: Array) -> tuple[Array, Array]:
    """Twist (6,) of the arm behind a joint against the arm before it, in axes R (3, 3), and its covariance (6, 6).

    Both motions at the same origin and of the same noise.
    """
    turn = np.zeros((6, 6))
    turn[:3, :3] = turn[3:, 3:] = R.T
    twist = turn @ (behind.twist - before.twist)
    return twist, turn @ (behind.covariance + before.covariance) @ turn.T


@dataclass(frozen=True)
class _Fit:
    """One reading: its first row, its twist, the covariance for unit noise, squares left over, and their number."""

    row: int
    twist: Array
    covariance: Array
    squares: float
    spare: int


def reflector_columns(cells: Cells, columns: Mapping[str, Any], robot: Robot) -> dict[str, Any]:
    """Columns of readings, each from several rows of reflectors; ``columns``: what every row says beside these."""
    faults, lines = cells.faults, cells.table.lines
    unloaded, loaded = cells.numbers(*UNLOADED), cells.numbers(*LOADED)
    sigma = cells.numbers("sigma_mm")[:, 0]
    label, arm = cells.texts("reading"), cells.words("arm")
    moved = 1e3 * np.linalg.norm(loaded - unloaded, axis=1)
    cells.check(
        moved > 1e3 * FARTHEST_M,
        f"columns x_mm y_mm z_mm, the reflector moved by more than {1e3 * FARTHEST_M:g} mm",
        code="J002",
        value=lambda i: f"{moved[i]:.1f} mm",
        allowed="displacements under load",
        remedy="check units and the reflector's label",
    )
    faults.raise_if_any("measurements")
    frames = forward_kinematics(robot, columns["q"])
    number = np.unique(columns["phase"], return_inverse=True)[1].reshape(-1)
    same = np.column_stack([*(columns[name] for name in ("q", "wrench", "point", "joint")), number])
    fits = []
    for rows in rows_of(label).values():
        j = int(columns["joint"][rows[0]])
        if (same[rows] != same[rows[0]]).any():
            faults.add(
                lines[rows[0]],
                f"reading {label[rows[0]]}: its rows differ in pose, joint, load or phase",
                code="J002",
                allowed="one of each a reading",
                remedy="give each reading a label of its own",
            )
            continue
        R = frames.R[rows[0], j + 1] @ robot.R_post[j].T
        try:
            fits.append(_fit(rows, unloaded, loaded, arm, frames.p[rows[0], j + 1], R, f"reading {label[rows[0]]}"))
        except InputError as error:
            faults.record(lines[rows[0]], error)
    faults.raise_if_any("measurements")
    first = np.array([fit.row for fit in fits], dtype=np.intp)
    noise, note = _noise(fits, sigma[first])
    covariance = np.array([np.diag(fit.covariance) for fit in fits])
    every = {**columns, "row_numbers": lines}
    return {
        name: values[first] if isinstance(values, np.ndarray) else tuple(values[i] for i in first)
        for name, values in every.items()
    } | {
        "twist": np.array([fit.twist for fit in fits]),
        "sigma": noise[:, None] * np.sqrt(covariance),
        "notes": (note,),
    }


def _fit(rows: Indices, unloaded: Array, loaded: Array, arm: Sequence[str], origin: Array, R: Array, what: str) -> _Fit:
    moved: dict[str, Motion] = {}
    for side in ARMS:
        own = rows[[arm[i] == side for i in rows]]
        moved[side] = motion(unloaded[own], loaded[own], origin, f"{what}, arm {side} the joint")
    twist, covariance = relative(moved["before"], moved["behind"], R)
    squares = sum(float((m.residuals**2).sum()) for m in moved.values())
    return _Fit(int(rows[0]), twist, covariance, squares, 3 * len(rows) - 12)


def _noise(fits: Sequence[_Fit], given: Array) -> tuple[Array, str]:
    """The tracker's noise in a coordinate (n,) m, as given or from what the fits leave over."""
    # Residuals are differences of two coordinates: twice the variance.
    spare = sum(fit.spare for fit in fits)
    found = np.sqrt(sum(fit.squares for fit in fits) / (2.0 * spare)) if spare else np.nan
    if np.isfinite(given).all():
        return given, f"reflectors: rigid-body fits leave {1e6 * found:.1f} um in a coordinate"
    if not spare:
        return given, "reflectors: three an arm and no sigma_mm: the noise comes from the load cycles alone"
    words = f"reflectors: noise of {1e6 * found:.1f} um in a coordinate, from what the rigid-body fits leave over"
    return np.where(np.isfinite(given), given, found), words
