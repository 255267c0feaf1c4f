"""What is wrong or odd in a measurement table: faults line by line, and remarks on units and signs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from doe.tables.columns import DISPLACEMENTS, POINT
from doe.tables.measurements import Measurements
from robots import InputError, Robot
from robots.arrays import Array
from robots.faults import Faults


def joint_keys(q: Array) -> list[tuple[float, ...]]:
    """Poses (n,) that can be compared: angles to 1e-9 rad."""
    # 1e-9 rad is the robots' own tolerance for "the same angle".
    return [tuple(row) for row in np.round(q, 9).tolist()]


def check_read(m: Measurements, faults: Faults) -> None:
    """Record that nothing was read."""
    if not m.used.any():
        faults.add(m.row_numbers[0], "no deflection was read, here or in any row",
                   allowed=f"at least one of {', '.join(DISPLACEMENTS)}", remedy="fill in the readings")  # fmt: skip


def check_loads(m: Measurements, faults: Faults) -> None:
    """Record loads that are zero, and points that are incomplete."""
    given = ~np.isnan(m.point)
    unloaded = np.asarray(~m.wrench.any(axis=1), dtype=np.bool_)
    if unloaded.all():
        faults.add(m.row_numbers[0], "the load is zero in every component, here and in every row",
                   allowed="loads other than 0",
                   remedy="give them, or remove the rows: deflections are relative to the unloaded arm")  # fmt: skip
        unloaded = np.zeros(m.n, dtype=np.bool_)
    for wrong, problem, allowed, remedy in (
        (unloaded, "the load is zero in every component", "a load other than 0",
         "give the load, or remove the row: deflections are relative to the unloaded arm"),
        (given.any(axis=1) & ~given.all(axis=1), f"columns {', '.join(POINT)}: the point is incomplete",
         "three numbers, or three empty cells (the tool point)", "fill in the missing coordinate, 0 too"),
    ):  # fmt: skip
        for i in np.flatnonzero(wrong):
            faults.add(m.row_numbers[i], problem, allowed=allowed, remedy=remedy)


def check_labels(m: Measurements, faults: Faults) -> None:
    """Record labels that stand for several poses."""
    first: dict[str, tuple[int, tuple[float, ...]]] = {}
    for line, label, key in zip(m.row_numbers, m.pose, joint_keys(m.q), strict=True):
        known_line, known_key = first.setdefault(label, (line, key))
        if key != known_key:
            faults.add(line, "column pose, the label stands for other joint angles before", value=label,
                       allowed=f"the angles of row {known_line}",
                       remedy="correct the angles, or give this pose a label of its own")  # fmt: skip


def repeated_readings(m: Measurements) -> Iterator[tuple[int, int, bool]]:
    """Readings that stand there twice: position, position of the earlier one, and whether their values agree."""
    # NaN never equals itself; inf cannot occur in a table, so it can stand for "not given" in a key.
    settings = np.nan_to_num(np.column_stack([m.wrench, m.point, m.step]), nan=np.inf)
    seen: dict[object, list[int]] = {}
    keys = zip(joint_keys(m.q), map(tuple, settings.tolist()), m.repeat, m.phase, strict=True)
    for i, key in enumerate(keys):
        earlier = seen.setdefault(key, [])
        for j in earlier:
            both = m.used[i] & m.used[j]
            if both.any():
                yield i, j, bool(np.array_equal(m.displacement[i, both], m.displacement[j, both]))
                break
        earlier.append(i)


def check_duplicates(m: Measurements, faults: Faults, files: Sequence[str] | None = None) -> None:
    """Record readings that stand there twice; ``files`` (n,): of readings from several."""
    if not m.wrench.any():
        return  # said once: without their loads all readings of a pose look like one another
    for i, j, same in repeated_readings(m):
        row = f"row {m.row_numbers[j]}" + (f" of {files[j]}" if files else "")
        problem = f"the reading {'repeats' if same else 'contradicts'} that of {row}"
        faults.add(m.row_numbers[i], f"{problem} (same joints, load, point, repeat, phase and step)",
                   allowed="each reading once", file=files[i] if files else None,
                   remedy="give each a number in the column repeat, or remove one")  # fmt: skip


def check_limits(q: Array, pose: Sequence[str], lines: Sequence[int], robot: Robot, faults: Faults) -> None:
    """Record poses q (n, dof) rad, with labels and lines (n,), that the robot cannot take."""
    outside = np.flatnonzero(~robot.reachable(q))
    if outside.size and robot.reachable(np.degrees(q)).all():
        problem = f"{outside.size} of {len(q)} poses cannot be taken as typed, all of them with angles read as radians"
        faults.add(lines[int(outside[0])], problem, allowed="joint angles in degrees",
                   remedy="convert the joint columns to degrees")  # fmt: skip
        return
    _, first, rows = np.unique(np.round(q[outside], 9), axis=0, return_index=True, return_counts=True)
    for i, count in sorted(zip(outside[first].tolist(), rows.tolist(), strict=True)):
        times = f", and {count - 1} more of this pose" if count > 1 else ""
        for problem in robot.violations(q[i]):
            faults.add(lines[i], f"pose {pose[i]}{times} cannot be taken: {problem}",
                       allowed=f"the limits of {robot.name}", remedy="correct the pose or model")  # fmt: skip


def plausibility_notes(m: Measurements) -> Iterator[str]:
    """Say what looks like a wrong sign (units are judged by the class of arm: :mod:`doe.plausibility.units_check`)."""
    force, moved = m.wrench[:, :3], m.displacement[:, :3]
    loaded = force != 0.0
    # Only where every loaded direction was read is the directional stiffness known.
    work = np.where(loaded, force * moved, 0.0).sum(axis=1)
    known = loaded.any(axis=1) & np.isfinite(work) & (work != 0.0)
    against = int((work[known] < 0.0).sum())
    if 2 * against > int(known.sum()):
        yield (f"{against} of {int(known.sum())} readings move against the load: the sign looks wrong "
               "(a downward load has fz_N < 0 and gives dz_mm < 0)")  # fmt: skip


def refuse_seen(seen: Measurements, held_out: Measurements, by: str = "the diagnosis") -> None:
    """Refuse readings to be held out whose poses (joint angles, whatever the label) were seen ``by`` what they judge.

    Raises
    ------
    InputError
        Another number of joints, or poses that are in both tables, which it names.
    """
    what = f"readings to hold out (--holdout {held_out.source})"
    if seen.q.shape[1] != held_out.q.shape[1]:
        raise InputError(f"{what}: joints", value=held_out.q.shape[1], allowed=f"{seen.q.shape[1]}")
    known = set(joint_keys(seen.q))
    both = [label for label, key in zip(held_out.pose, joint_keys(held_out.q), strict=True) if key in known]
    if both:
        raise InputError(
            f"{what}: poses that are in {seen.source} too",
            value=", ".join(dict.fromkeys(both)),
            allowed=f"poses that {by} has not seen",
            remedy="remove them from one of the two tables",
        )
