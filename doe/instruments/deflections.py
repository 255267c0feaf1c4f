"""Deflections as differences: readings after the load minus those before it, with the variance of both.

Two layouts: both readings in one row (x before, x after), or rows without a load beside rows with one at the same pose.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from doe.instruments.axes import Axes, sessions_of, turned
from doe.instruments.meanings import AXES
from doe.instruments.values import Read
from doe.tables.columns import LOADS, SAME_ANGLE_rad
from doe.tables.measurements import rows_of
from robots import InputError
from robots.arrays import Array, Bools, Indices
from robots.errors import line_ranges
from robots.faults import Faults

# Angles about three axes subtract as a rotation does to as many parts of itself as they have rad: to 2 %.
LARGEST_TURN_mrad = 20.0
MOVED = ("dx", "dy", "dz", "rx", "ry", "rz")
SIGMA = ("sigma", "", "")


@dataclass(frozen=True)
class Deflections:
    """Rows of deflections: ``moved`` by component (mm, mrad), ``sigma`` (n,) mm, the rows' other columns, remarks."""

    read: Read
    moved: dict[str, Array]
    sigma: Array
    notes: tuple[str, ...]


def loads_of(read: Read) -> Array:
    """Loads (n, 6) in N, N m; what is hung pulls down."""
    out = np.zeros((read.n, 6))
    for key, values in read.numbers.items():
        name = "fz_N" if key[0] == "hung" else f"{key[0]}_N" if key[0].startswith("f") else f"{key[0]}_Nm"
        if key[0] == "hung" or name in LOADS:
            out[:, LOADS.index(name)] += values
    return out


def deflections(read: Read, axes: Axes, sigma_mm: float | None) -> Deflections:
    """Deflections of all rows.

    ``axes``: of an instrument whose positions are subtracted; ``sigma_mm``: standard deviation of one reading of a
    coordinate, where the file has none.

    Raises
    ------
    InputError
        Readings before the load without those after it, rows with a load without any that has none, or positions
        whose axes are not said.
    """
    if not loads_of(read).any():
        raise InputError(
            f"{read.name}: no load among its columns",
            code="I005",
            allowed="loads, as fz in N or a mass hung on the tool",
            remedy='say which it is, as in --column "NAME=hung kg", or give --fill "hung=20 kg"; absolute '
            "positions without loads: --kind positions",
        )
    _check_pairs(read)
    if axes.said is not None and not any(key[0] in AXES for key in read.numbers):
        raise InputError(
            f"--axes {axes.said}: no positions are subtracted here",
            code="I007",
            allowed="with columns x, y and z",
            remedy="leave it out: gauges read along axes of the base",
        )
    if any(key[1] == "before" and key[0] in (*AXES, *MOVED) for key in read.numbers):
        _refuse_unloaded(read)
        _check_turns(read, axes)
        return _of_pairs(read, axes, sigma_mm)
    unloaded = np.asarray(~loads_of(read).any(axis=1), dtype=np.bool_)
    if unloaded.any() or any((axis, "", "") in read.numbers for axis in AXES):
        _check_turns(read, axes)
        return _of_rows(read, unloaded, axes, sigma_mm)
    moved = {name: read.numbers[name, "", ""] for name in MOVED if (name, "", "") in read.numbers}
    return Deflections(read, moved, _sigma(read, sigma_mm), ())


def _check_turns(read: Read, axes: Axes) -> None:
    """Refuse orientations: differences of angles about axes are a rotation only where all of them are small."""
    for (what, when, _), values in read.numbers.items():
        if what not in ("rx", "ry", "rz"):
            continue
        if axes.said not in (None, "base"):
            raise InputError(
                f"{read.name}: {what} about axes of an instrument",
                code="I008",
                allowed="rotations about the base's axes",
                remedy='keep it, as in --column "NAME=keep"',
            )
        largest = float(np.nanmax(np.abs(values), initial=0.0))
        if largest > LARGEST_TURN_mrad:
            raise InputError(
                f"{read.name}: {what} {when}".rstrip(),
                code="I008",
                value=f"{largest:g} mrad",
                allowed=f"up to {LARGEST_TURN_mrad:g} mrad: differences of larger angles are no rotation",
                remedy='keep it, as in --column "NAME=keep"',
            )


def _refuse_unloaded(read: Read) -> None:
    faults = Faults(read.name)
    for k in np.flatnonzero(~loads_of(read).any(axis=1)):
        file, line = read.places[k]
        faults.say(
            line,
            f"{file}, row {line}: the load is 0, and the row has readings before and after it",
            code="I008",
            allowed="a load other than 0",
            remedy="give the load, or leave the line out with --rows",
        )
    faults.raise_if_any("readings")


def _check_pairs(read: Read) -> None:
    for what, when, target in read.numbers:
        if when and what in (*AXES, *MOVED):
            other = "after" if when == "before" else "before"
            if (what, other, target) not in read.numbers:
                raise InputError(
                    f"{read.name}: {what} was read {when} the load, and no column holds it {other}",
                    code="I008",
                    allowed="both, or one column of deflections",
                    remedy=f'say which it is, as in --column "NAME={what} mm {other}"',
                )
            if (what, "", target) in read.numbers:
                raise InputError(
                    f"{read.name}: {what} {when} the load, and {what} without before or after",
                    code="I008",
                    allowed="one or the other",
                    remedy='leave one out, as in --column "NAME=keep"',
                )
        double = f"d{what}" if what in AXES else ""
        if any(key[0] == double for key in read.numbers):
            raise InputError(
                f"{read.name}: positions {what} and deflections {double} both",
                code="I008",
                allowed="one of them",
                remedy='keep the other, as in --column "NAME=keep"',
            )


def _sigma(read: Read, sigma_mm: float | None, when: str = "") -> Array:
    for key in (("sigma", when, ""), SIGMA):
        if key in read.numbers:
            return read.numbers[key]
    return np.full(read.n, np.nan if sigma_mm is None else sigma_mm)


def _of_pairs(read: Read, axes: Axes, sigma_mm: float | None) -> Deflections:
    """Before and after in one row."""

    def difference(what: str) -> Array | None:
        keys = (what, "after", ""), (what, "before", "")
        return read.numbers[keys[0]] - read.numbers[keys[1]] if keys[0] in read.numbers else None

    moved = {name: values for name in MOVED if (values := difference(name)) is not None}
    moved |= {name: read.numbers[name, "", ""] for name in MOVED if (name, "", "") in read.numbers}
    along = {axis: values for axis in AXES if (values := difference(axis)) is not None}
    sigma = np.hypot(_sigma(read, sigma_mm, "before"), _sigma(read, sigma_mm, "after"))
    note = f"deflections are {', '.join((*along, *moved))} after minus before"
    every = np.ones(read.n, dtype=np.bool_)
    base, notes = turned(along, axes, read, "before", every, sessions_of(read), read.name)
    return Deflections(read, moved | base, sigma, (note, *notes))


def _of_rows(read: Read, unloaded: Bools, axes: Axes, sigma_mm: float | None) -> Deflections:
    """Rows with a load minus the mean of those without at the same pose, target and session."""
    if not unloaded.any():
        raise InputError(
            f"{read.name}: all rows have a load, so there are no unloaded positions to compare with",
            code="I008",
            allowed="rows with load 0 at the same poses, or positions before and after the load",
            remedy='add them; if these are deflections say so, as in --column "NAME=dz mm"; for positions under '
            'payloads that the flange carries: --kind positions, --column "NAME=payload kg"',
        )
    names = [name for name in (*AXES, *MOVED) if (name, "", "") in read.numbers]
    values = np.column_stack([read.numbers[name, "", ""] for name in names])
    own = _sigma(read, sigma_mm)
    out, variance, idle = np.full_like(values, np.nan), np.full(read.n, np.nan), list[int]()
    for at, loaded in _cycles(read, unloaded):
        if not len(loaded):
            idle += [read.places[k][1] for k in at]
        counts = np.isfinite(values[at]).sum(axis=0)
        mean = np.nansum(values[at], axis=0) / np.maximum(counts, 1)
        out[loaded] = values[loaded] - np.where(counts > 0, mean, np.nan)
        # Of components that were not read in all of these rows the mean is that of fewer.
        fewer = len(at) / max(int(counts[counts > 0].min(initial=len(at))), 1)
        variance[loaded] = own[loaded] ** 2 + fewer * np.sum(own[at] ** 2) / len(at) ** 2
    moved = dict(zip(names, out[~unloaded].T, strict=True))
    kept = taken(read, ~unloaded)
    along: dict[str, Array] = {axis: moved[axis] for axis in AXES if axis in moved}
    rest = {name: moved[name] for name in MOVED if name in moved}
    notes = [f"deflections are relative to {int(unloaded.sum())} rows without a load, pose by pose"]
    if idle:
        notes.append(f"unloaded rows without a loaded row at the same pose, not used: {line_ranges(sorted(idle))}")
    base, found = turned(along, axes, read, "", unloaded, sessions_of(kept), read.name)
    return Deflections(kept, rest | base, np.sqrt(variance[~unloaded]), (*notes, *found))


def _cycles(read: Read, unloaded: Bools) -> list[tuple[Indices, Indices]]:
    """Rows of each set-up: those without a load that the others are compared with, and those with one.

    Raises
    ------
    InputErrors
        Set-ups without a row that has no load, each row named.
    """
    phase = np.array(read.words.get("phase", ("",) * read.n))
    faults, out = Faults(read.name), list[tuple[Indices, Indices]]()
    for rows in rows_of(_set_ups(read)).values():
        at = rows[unloaded[rows] & (phase[rows] != "unloading")]
        at = at if len(at) else rows[unloaded[rows]]
        loaded = rows[~unloaded[rows]]
        if len(at):
            out.append((at, loaded))
            continue
        for k in loaded:
            file, line = read.places[k]
            faults.say(
                line,
                f"{file}, row {line}: this set-up has no row without a load",
                code="I008",
                allowed="a row with load 0 at each pose (same label, target, session, repeat)",
                remedy="add it, or label the rows of one set-up alike (pose)",
            )
    faults.raise_if_any("readings")
    return out


def _set_ups(read: Read) -> list[tuple[object, ...]]:
    """What tells the set-ups of rows apart: label or joint angles, target, session, repeat."""
    more = [read.words[name] for name in ("target", "session", "repeat") if name in read.words]
    poses: Sequence[object] = read.words["pose"] if "pose" in read.words else _poses(read)
    return list(zip(poses, *more, strict=True))


def _poses(read: Read) -> list[int]:
    """Numbers (n,) of poses whose angles agree as a controller shows them twice: to a hundredth of a degree."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    q = np.column_stack([read.numbers[name, "", ""] for name in read.joints])
    # Repeats with the very same angles would be pairs by the square of their number.
    different, which = np.unique(q, axis=0, return_inverse=True)
    reach = np.degrees(SAME_ANGLE_rad) * (1 + 1e-9)
    a, b = cKDTree(different).query_pairs(reach, p=np.inf, output_type="ndarray").T
    near = coo_array((np.ones(len(a)), (a, b)), shape=(len(different), len(different)))
    _, number = connected_components(near, directed=False)
    return [int(k) for k in number[which.reshape(-1)]]


def taken(read: Read, keep: Bools) -> Read:
    """Some of the rows."""
    at = np.flatnonzero(keep)
    return replace(
        read,
        numbers={key: values[at] for key, values in read.numbers.items()},
        words={name: tuple(cells[k] for k in at) for name, cells in read.words.items()},
        kept={name: tuple(cells[k] for k in at) for name, cells in read.kept.items()},
        places=tuple(read.places[k] for k in at),
    )
