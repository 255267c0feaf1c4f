"""The table that comes out: columns as the readers of deflections and of absolute positions take them, as text."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

import numpy as np

from doe.instruments.axes import Axes, as_text, joint_cells
from doe.instruments.deflections import MOVED, Deflections, deflections, loads_of, taken
from doe.instruments.mapping_file import Settings
from doe.instruments.meanings import AXES, QUANTITIES, joint_words
from doe.instruments.units import TABLE_UNITS
from doe.instruments.values import Read
from doe.tables.columns import LOADS, SAME_ANGLE_rad
from doe.tables.schema import likely_ours
from robots import InputError, Robot
from robots.arrays import Bools
from robots.errors import line_ranges, listed
from robots.faults import Faults

Cells = dict[str, tuple[str, ...]]
Made = tuple[Cells, list[str], tuple[tuple[str, int], ...]]
DEFLECTIONS, POSITIONS = "deflections", "positions"
OUTPUTS = (DEFLECTIONS, POSITIONS)
_PLAIN = ("payload", "payload_x", "payload_y", "payload_z", "rail", "temperature", "px", "py", "pz")


def kind_of(read: Read, asked: str | None) -> str:
    """What the rows hold: deflections or absolute positions.

    Raises
    ------
    InputError
        Both may be meant.
    """
    if asked is not None and asked not in OUTPUTS:
        raise InputError("--kind", code="I013", value=asked, allowed=", ".join(OUTPUTS), remedy="choose one of them")
    moved = any(key[0] in ("dx", "dy", "dz") or (key[1] and key[0] in AXES) for key in read.numbers)
    placed = any(key[0] in AXES and not key[1] for key in read.numbers)
    if asked == POSITIONS and not placed:
        raise InputError(
            f"{read.name}: no positions among its columns",
            code="I013",
            allowed="x, y and z",
            remedy='say which they are, as in --column "NAME=x mm"',
        )
    if asked is not None:
        return asked
    if moved and placed:
        raise InputError(
            f"{read.name} has positions and deflections",
            code="I013",
            allowed="--kind deflections or positions",
            remedy="say which with --kind, and keep the other columns",
        )
    if placed and not loads_of(read).any():
        return POSITIONS
    return DEFLECTIONS


def table_of(read: Read, kind: str, settings: Settings, robot: Robot | None) -> Made:
    """Columns of the table as text, remarks, and where each row stands in its file.

    ``robot``: names the joint columns; None: q1_deg, q2_deg ...

    Raises
    ------
    InputError
        Rows that make no table of this kind.
    """
    joint_columns = joint_columns_of(robot)
    if settings.target is not None:
        read = _of_target(read, settings.target)
    if kind == POSITIONS:
        return _positions(read, settings, joint_columns)
    if targets := _targets(read):
        raise InputError(
            f"{read.name}: several targets ({listed(targets)}), and a deflection is that of the loaded point",
            code="I012",
            allowed="--target NAME, the one at the loaded point",
            remedy="choose it; for absolute positions: --kind positions",
        )
    return _deflections(deflections(read, Axes(settings.axes, robot, joint_columns), settings.sigma_mm), joint_columns)


def joint_columns_of(robot: Robot | None) -> dict[str, str]:
    """The name of each joint's column, as q3 -> q3real_deg."""
    return joint_words(robot.angle_names) if robot else {}


def _targets(read: Read) -> list[str]:
    named = {key[2] for key in read.numbers if key[2]}
    found = sorted(named or {word for word in read.words.get("target", ()) if word})
    return found if len(found) > 1 else []


def _of_target(read: Read, target: str) -> Read:
    named = sorted({key[2] for key in read.numbers if key[2]})
    if target in named:
        numbers = {(w, t, ""): v for (w, t, of), v in read.numbers.items() if of in ("", target)}
        return replace(read, numbers=numbers, words={**read.words, "target": (target,) * read.n})
    words = read.words.get("target", ())
    if target not in words:
        raise InputError(
            "--target",
            code="I012",
            value=target,
            allowed=listed(named or sorted(set(words))) or "none: no column of targets",
            remedy="choose one of them",
        )
    return taken(read, np.array([word == target for word in words], dtype=np.bool_))


def _lines(read: Read, some: Bools) -> str:
    return line_ranges(sorted({read.places[k][1] for k in np.flatnonzero(some)}))


def _common(read: Read, notes: list[str]) -> Cells:
    """Columns that both kinds of tables have."""
    out: Cells = {}
    for name in _PLAIN:
        if (name, "", "") in read.numbers:
            out[QUANTITIES[name][1]] = as_text(read.numbers[name, "", ""])
    for name, column in (("temperature", "temperature_C"), ("time", "time_s")):
        if (name, "after", "") in read.numbers:  # of two readings the one under load counts
            out[column] = as_text(read.numbers[name, "after", ""])
            notes.append(f"{column} is that of the reading after the load")
    time = read.numbers.get(("time", "", ""), read.numbers.get(("time", "after", "")))
    if time is not None and np.isfinite(time).any():
        out["time_s"] = as_text(time - np.nanmin(time))
        if not read.dated:
            notes.append("clock times have no date: all count as of one day")
    return out


def _with_kept(cells: Cells, read: Read, notes: list[str], joints: Collection[str]) -> Cells:
    """Columns that are kept, under names that no reader takes for its own; ``joints``: names of the model's columns."""
    out = {**cells, **{name: words for name, words in read.words.items() if name not in cells}}
    for name, words in read.kept.items():
        plain = " ".join(name.split())
        own = plain in out or likely_ours(plain, joints)
        out[f"original {plain}" if own else plain] = words
        if own:
            notes.append(f"column {plain} is kept as 'original {plain}'")
    return out


def _positions(read: Read, settings: Settings, joint_columns: Mapping[str, str]) -> Made:
    notes = list[str]()
    if any(key[1] and key[0] in AXES for key in read.numbers):
        raise InputError(
            f"{read.name}: positions before and after a load",
            code="I013",
            allowed="--kind deflections",
            remedy="leave --kind out, or keep one of the two",
        )
    if loads_of(read).any():
        raise InputError(
            f"{read.name}: positions under a load that is hung, which a table of positions cannot hold",
            code="I013",
            allowed="masses that the flange carries",
            remedy='say so, as in --column "NAME=payload kg"',
        )
    read = _one_row_a_target(read, notes)
    if missing := [axis for axis in AXES if (axis, "", "") not in read.numbers]:
        raise InputError(
            f"{read.name}: no {listed(missing)} among its columns",
            code="I013",
            allowed="x, y and z of a target",
            remedy='say which it is, as in --column "NAME=z mm"',
        )
    position = np.column_stack([read.numbers[axis, "", ""] for axis in AXES])
    there = np.isfinite(position)
    faults = Faults(read.name)
    for k in np.flatnonzero(there.any(axis=1) & ~there.all(axis=1)):
        file, line = read.places[k]
        faults.say(
            line,
            f"{file}, row {line}: a coordinate is missing",
            code="I013",
            allowed="x, y and z, or none of them",
            remedy="fill it in, or clear the others",
        )
    faults.raise_if_any("readings")
    unread = np.asarray(~there.any(axis=1), dtype=np.bool_)
    if unread.any():
        notes.append(f"rows without a position left out: {_lines(read, unread)}")
        read = taken(read, ~unread)
    if not read.n:
        raise InputError(f"{read.name}: no row has a position", code="I013", remedy="export it again")
    cells: Cells = {}
    for name in ("pose", "session", "target"):
        if name in read.words:
            cells[name] = read.words[name]
    cells |= joint_cells(read, joint_columns)
    cells |= {f"{axis}_mm": as_text(read.numbers[axis, "", ""]) for axis in AXES}
    for axis in AXES:  # rotations of a target: in deg, as a table of positions has them
        if (f"r{axis}", "", "") in read.numbers:
            cells[f"r{axis}_deg"] = as_text(
                read.numbers[f"r{axis}", "", ""] * TABLE_UNITS["turn"][1] / TABLE_UNITS["angle"][1]
            )
    cells |= _common(read, notes)
    sigma = read.numbers.get(
        ("sigma", "", ""), np.full(read.n, np.nan if settings.sigma_mm is None else settings.sigma_mm)
    )
    if np.isfinite(sigma).any():
        cells["sigma_mm"] = as_text(sigma)
    return _with_kept(cells, read, notes, joint_columns.values()), notes, read.places


def _one_row_a_target(read: Read, notes: list[str]) -> Read:
    """Targets that stand beside one another in a row, below one another."""
    targets = list(dict.fromkeys(key[2] for key in read.numbers if key[2]))
    if not targets:
        return read
    if any(not key[2] and key[0] in AXES for key in read.numbers):
        raise InputError(
            f"{read.name}: coordinates with a target and without one",
            code="I012",
            allowed="a target for each",
            remedy='name it, as in --column "X=x mm of ball"',
        )
    parts = [replace(_of_target(read, target)) for target in targets]
    notes.append(f"{len(targets)} targets of a row become rows of their own: {listed(targets)}")
    keys = list(dict.fromkeys(key for part in parts for key in part.numbers))
    gone = [np.full(read.n, np.nan) for _ in parts]
    numbers = {
        key: np.column_stack([part.numbers.get(key, none) for part, none in zip(parts, gone, strict=True)]).ravel()
        for key in keys
    }

    def spread(words: Mapping[str, Sequence[str]]) -> Cells:
        return {name: tuple(cell for cell in cells for _ in targets) for name, cells in words.items()}

    words = spread(read.words) | {"target": tuple(targets) * read.n}
    places = tuple(place for place in read.places for _ in targets)
    return replace(read, numbers=numbers, words=words, kept=spread(read.kept), places=places)


def _deflections(found: Deflections, joint_columns: Mapping[str, str]) -> Made:
    notes, read = list(found.notes), found.read
    moved = np.column_stack([found.moved[name] for name in MOVED if name in found.moved])
    unread = np.asarray(~np.isfinite(moved).any(axis=1), dtype=np.bool_)
    if unread.any():
        notes.append(f"rows without any reading left out: {_lines(read, unread)}")
    keep = ~unread
    read = _same_angles(taken(read, keep), notes)
    if not read.n:
        raise InputError(f"{read.name}: no row has a reading under load", code="I005", remedy="export it again")
    cells: Cells = {name: read.words[name] for name in ("pose", "session") if name in read.words}
    cells |= joint_cells(read, joint_columns)
    loads = loads_of(read)
    cells |= {name: as_text(loads[:, k]) for k, name in enumerate(LOADS) if loads[:, k].any()}
    cells |= {QUANTITIES[name][1]: as_text(values[keep]) for name, values in found.moved.items()}
    if np.isfinite(found.sigma[keep]).any():
        cells["sigma_mm"] = as_text(found.sigma[keep])
    cells |= _common(read, notes)
    if "repeat" not in read.words:
        numbers = _repeats(cells, read)
        if any(number != "1" for number in numbers):
            cells["repeat"] = numbers
            notes.append("readings of the same pose and load are numbered as repeats")
    return _with_kept(cells, read, notes, joint_columns.values()), notes, read.places


def _same_angles(read: Read, notes: list[str]) -> Read:
    """One label has one set of angles: where a controller shows them a little apart, those of its first row."""
    if "pose" not in read.words:
        return read
    q = np.column_stack([read.numbers[name, "", ""] for name in read.joints])
    first: dict[str, int] = {}
    faults, off = Faults(read.name), 0.0
    for k, label in enumerate(read.words["pose"]):
        at = first.setdefault(label, k)
        apart = float(np.abs(q[k] - q[at]).max())
        # Readings of ten digits differ in the last one.
        if apart > np.degrees(SAME_ANGLE_rad) * (1 + 1e-9):
            file, line = read.places[k]
            faults.say(
                line,
                f"{file}, row {line}, pose {label}: its joint angles differ by {apart:.3g} deg from those of "
                f"row {read.places[at][1]}",
                code="I008",
                allowed=f"up to {np.degrees(SAME_ANGLE_rad):g} deg for one label",
                remedy='correct them, or keep the label as words: --column "NAME=keep"',
            )
        off = max(off, apart)
        q[k] = q[at]
    faults.raise_if_any("readings")
    if off > 0.0:
        notes.append(f"joint angles of one pose differ by up to {off:.2g} deg: those of its first row stand for all")
    return replace(read, numbers=read.numbers | {(n, "", ""): q[:, k] for k, n in enumerate(read.joints)})


def _repeats(cells: Cells, read: Read) -> tuple[str, ...]:
    names = [name for name in (*cells, "phase", "step") if name in cells or name in read.words]
    told = [
        name
        for name in names
        if name not in ("sigma_mm", "time_s", "temperature_C", "session")
        and not name.startswith(("d", "rx_", "ry_", "rz_"))
    ]
    columns = [cells.get(name, read.words.get(name, ())) for name in told]
    seen: Counter[tuple[str, ...]] = Counter()
    out = []
    for row in zip(*columns, strict=True):
        seen[row] += 1
        out.append(str(seen[row]))
    return tuple(out)
