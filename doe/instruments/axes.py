"""Axes of an instrument whose positions are subtracted: the base's, said, or found from the positions themselves.

Positions without a load follow the arm's kinematics in a frame that :func:`doe.absolute.start.started` finds in closed
form, whatever part of the readings is wrong. Only its turn is used: an arm that is off by a millimetre on a metre turns
it by a milliradian, and a deflection by a thousandth of its size.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from doe.absolute.start import started
from doe.absolute.table import absolute_of
from doe.instruments.meanings import AXES
from doe.instruments.values import Read
from doe.tables.columns import RawTable
from robots import InputError, Robot
from robots.arrays import Array, Bools
from robots.errors import listed
from robots.frames import rotation_rpy

FOUND = "found"
# A described arm is off by some millimetres; where half of the readings are off by more, the turn of the axes is in
# doubt by more than one part in a hundred, and so is a deflection.
MISSED_mm = 10.0


@dataclass(frozen=True)
class Axes:
    """What was said of an instrument's axes, and the arm that was measured (``joint_columns``: names of its angles)."""

    said: str | None
    robot: Robot | None
    joint_columns: Mapping[str, str]


def turned(
    along: Mapping[str, Array],
    axes: Axes,
    reference: Read,
    when: str,
    rows: Bools,
    session: tuple[str, ...],
    where: str,
) -> tuple[dict[str, Array], tuple[str, ...]]:
    """Differences of positions in base axes, and remarks.

    Parameters
    ----------
    along : differences (n,) mm by axis of the instrument
    reference, when, rows : readings without a load: rows of a table, and which of its positions
    session : of each difference
    where : names the files in messages

    Raises
    ------
    InputError
        Nothing or nothing useful was said of the axes; they cannot be found.
    """
    if not along:
        return {}, ()
    if axes.said is None:
        raise InputError(
            f"{where}: deflections from positions need the axes of the instrument",
            code="I007",
            allowed="--axes base (those of the robot's base), --axes A,B,C (their orientation in the base "
            "frame, deg about fixed x, then y, then z), or --axes found with --model",
            remedy="state them with --axes",
        )
    if axes.said == "base":
        return {f"d{axis}": values for axis, values in along.items()}, ()
    turns, notes = None, tuple[str, ...]()
    if axes.said != FOUND:
        turns = {name: _said(axes.said) for name in session}
    if missing := [axis for axis in AXES if axis not in along]:
        raise InputError(
            f"--axes {axes.said}: no {listed(missing)} was read",
            code="I007",
            allowed="all of x, y, z",
            remedy="only with --axes base can axes be missing",
        )
    if turns is None:
        turns, notes = _found(axes, reference, when, rows, where)
    if unknown := sorted(set(session) - set(turns)):
        raise InputError(
            f"{where}: sessions {listed(unknown)} have no positions without a load",
            code="I007",
            allowed="some in each session",
            remedy="state their axes with --axes A,B,C",
        )
    R = np.array([turns[name] for name in session]).reshape(-1, 3, 3)
    base = np.einsum("nij,nj->ni", R, np.column_stack([along[axis] for axis in AXES]))
    return {f"d{axis}": base[:, k] for k, axis in enumerate(AXES)}, notes


def _said(text: str) -> Array:
    """The rotation (3, 3) from the instrument's axes to the base's."""
    try:
        turn = np.array([float(part) for part in text.split(",")])
    except ValueError:
        turn = np.full(3, np.nan)
    if turn.shape != (3,) or not np.isfinite(turn).all():
        raise InputError(
            "--axes",
            code="I007",
            value=text,
            allowed="base, found, or three angles A,B,C in deg",
            remedy="give one of these",
        )
    return rotation_rpy(np.radians(turn))


def _found(axes: Axes, read: Read, when: str, rows: Bools, where: str) -> tuple[dict[str, Array], tuple[str, ...]]:
    """Rotations (3, 3) to base axes by session, from positions without a load and the arm's kinematics."""
    if axes.robot is None:
        raise InputError(
            "--axes found: the arm is not known",
            code="I007",
            allowed="--model MODEL with it",
            remedy="name the arm with --model",
        )
    position = np.column_stack([read.numbers[axis, when, ""] for axis in AXES])
    at = np.flatnonzero(rows & np.isfinite(position).all(axis=1))
    cells = joint_cells(read, axes.joint_columns) | {f"{a}_mm": as_text(position[:, k]) for k, a in enumerate(AXES)}
    cells["session"] = sessions_of(read)
    table = tuple(zip(*([column[k] for k in at] for column in cells.values()), strict=True))
    data = absolute_of(RawTable(where, "", tuple(cells), table, tuple(read.places[k][1] for k in at), ()), axes.robot)
    start = started(axes.robot, data)
    middle = 1e3 * float(np.median(start.error))
    if middle > MISSED_mm:
        raise InputError(
            f"{where}: the arm as described misses half of the positions without a load by more than "
            f"{middle:.0f} mm, so their axes are in doubt",
            code="I007",
            allowed=f"up to {MISSED_mm:g} mm",
            remedy="check the model, signs and zeros of the angles and units, or say --axes A,B,C",
        )
    note = (
        f"axes found from {len(data)} positions without a load; half of them are within {middle:.2g} mm of the "
        "positions that the model predicts"
    )
    return {name: frame.R.T for name, frame in zip(data.session.names, start.frames, strict=True)}, (note,)


def sessions_of(read: Read) -> tuple[str, ...]:
    """The session of each row; one for all where none is named."""
    return read.words.get("session", ("all",) * read.n)


def as_text(values: Array) -> tuple[str, ...]:
    """Numbers as cells, empty where NaN."""
    # No instrument reads twelve digits; more would show the round-off of a change of units.
    return tuple("" if np.isnan(v) else f"{v:.12g}" for v in (values + 0.0).tolist())


def joint_cells(read: Read, joint_columns: Mapping[str, str]) -> dict[str, tuple[str, ...]]:
    """Columns of joint angles, in the order of the joints."""
    order = list(joint_columns) or sorted(read.joints, key=lambda name: int("".join(c for c in name if c.isdigit())))
    names = sorted(read.joints, key=order.index)
    return {joint_columns.get(name, f"{name}_deg"): as_text(read.numbers[name, "", ""]) for name in names}
