"""What is wrong or odd in a measurement table: faults line by line, and remarks on units and signs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from doe.tables.columns import DISPLACEMENTS, POINT
from doe.tables.measurements import Measurements
from robots import InputError, Robot
from robots.arrays import Array, Bools, Indices
from robots.faults import Faults

_IN_FULL = 200


def joint_keys(q: Array) -> list[tuple[float, ...]]:
    """Poses (n,) that can be compared: angles to 1e-9 rad."""
    # 1e-9 rad is the robots' own tolerance for "the same angle".
    return [tuple(row) for row in np.round(q, 9).tolist()]


def check_read(m: Measurements, faults: Faults) -> None:
    """Record that nothing was read."""
    if not m.used.any():
        faults.add(
            m.row_numbers[0],
            "no deflection was read, here or in any row",
            code="T006",
            allowed=f"at least one of {', '.join(DISPLACEMENTS)}",
            remedy="fill in the readings",
        )


def check_loads(m: Measurements, faults: Faults) -> None:
    """Record loads that are zero, and points that are incomplete."""
    given = ~np.isnan(m.point)
    unloaded = np.asarray(~m.wrench.any(axis=1), dtype=np.bool_)
    if unloaded.all():
        faults.add(
            m.row_numbers[0],
            "the load is zero in every component, here and in every row",
            code="T006",
            allowed="loads other than 0",
            remedy="give them, or remove the rows: deflections are relative to the unloaded arm",
        )
        unloaded = np.zeros(m.n, dtype=np.bool_)
    faults.each(
        [m.row_numbers[i] for i in np.flatnonzero(unloaded)],
        lambda _: {
            "problem": "the load is zero in every component",
            "allowed": "a load other than 0",
            "remedy": "give the load, or remove the row: deflections are relative to the unloaded arm",
        },
        code="T006",
    )
    faults.each(
        [m.row_numbers[i] for i in np.flatnonzero(given.any(axis=1) & ~given.all(axis=1))],
        lambda _: {
            "problem": f"columns {', '.join(POINT)}: the point is incomplete",
            "allowed": "three numbers, or three empty cells (the tool point)",
            "remedy": "fill in the missing coordinate, 0 too",
        },
        code="T004",
    )


def check_labels(m: Measurements, faults: Faults) -> None:
    """Record labels that stand for several poses."""
    _, first, which = np.unique(_numbered(m.pose), return_index=True, return_inverse=True)
    known = first[which]
    other = np.flatnonzero((np.round(m.q, 9) != np.round(m.q[known], 9)).any(axis=1))
    faults.each(
        [m.row_numbers[i] for i in other],
        lambda n: {
            "problem": "column pose, the label stands for other joint angles before",
            "value": m.pose[other[n]],
            "allowed": f"the angles of row {m.row_numbers[known[other[n]]]}",
            "remedy": "correct the angles, or give this pose a label of its own",
        },
        code="T007",
    )


def _numbered(words: Sequence[object]) -> Array:
    """Numbers (n,) that are the same where words are."""
    number: dict[object, float] = {}
    return np.array([number.setdefault(word, float(len(number))) for word in words])


def repeated_readings(m: Measurements) -> tuple[Indices, Indices, Bools]:
    """Readings that stand there twice: places (k,), places of the earlier ones, and whether their values agree."""
    # NaN never equals itself; inf cannot occur in a table, so it can stand for "not given" in a key.
    settings = np.nan_to_num(np.column_stack([m.wrench, m.point, m.step]), nan=np.inf)
    words = np.column_stack([_numbered(m.repeat), _numbered(m.phase)])
    keys = np.column_stack([np.round(m.q, 9), settings, words]) + 0.0
    row, data = keys.strides[0], keys.tobytes()
    group = _numbered([data[k : k + row] for k in range(0, len(data), row)])
    earlier = np.full(m.n, m.n, dtype=np.intp)
    for used in m.used.T:  # the first reading of the same setting that has a component in common
        rows = np.flatnonzero(used)
        _, first, which = np.unique(group[rows], return_index=True, return_inverse=True)
        earlier[rows] = np.minimum(earlier[rows], rows[first[which.reshape(-1)]])
    at = np.flatnonzero(earlier < np.arange(m.n))
    both = m.used[at] & m.used[earlier[at]]
    same = ((m.displacement[at] == m.displacement[earlier[at]]) | ~both).all(axis=1)
    return at, earlier[at], same


def check_duplicates(m: Measurements, faults: Faults, files: Sequence[str] | None = None) -> None:
    """Record readings that stand there twice; ``files`` (n,): of readings from several."""
    if not m.wrench.any():
        return  # said once: without their loads all readings of a pose look like one another
    at, earlier, same = repeated_readings(m)

    def fault(n: int) -> dict[str, str | None]:
        i, j = int(at[n]), int(earlier[n])
        row = f"row {m.row_numbers[j]}" + (f" of {files[j]}" if files else "")
        problem = f"the reading {'repeats' if same[n] else 'contradicts'} that of {row}"
        return {
            "problem": f"{problem} (same joints, load, point, repeat, phase and step)",
            "allowed": "each reading once",
            "file": files[i] if files else None,
            "remedy": "give each a number in the column repeat, or remove one",
        }

    faults.each([m.row_numbers[i] for i in at], fault, code="T007")


def check_limits(q: Array, pose: Sequence[str], lines: Sequence[int], robot: Robot, faults: Faults) -> None:
    """Record poses q (n, dof) rad, with labels and lines (n,), that the robot cannot take."""
    outside = np.flatnonzero(~robot.reachable(q))
    if outside.size and robot.reachable(np.degrees(q)).all():
        problem = f"{outside.size} of {len(q)} poses cannot be taken as typed, all of them with angles read as radians"
        faults.add(
            lines[int(outside[0])],
            problem,
            code="T005",
            allowed="joint angles in degrees",
            remedy="convert the joint columns to degrees",
        )
        return
    _, first, rows = np.unique(np.round(q[outside], 9), axis=0, return_index=True, return_counts=True)
    order = np.argsort(first)
    poses, times = outside[first[order]], rows[order]
    # Of the first poses each limit is a fault of its own, of the others each pose.
    shown = [(k, problem) for k, i in enumerate(poses[:_IN_FULL]) for problem in robot.violations(q[i])]
    shown += [(k, "") for k in range(_IN_FULL, len(poses))]

    def fault(n: int) -> dict[str, str]:
        k, problem = shown[n]
        i, more = int(poses[k]), f", and {times[k] - 1} more of this pose" if times[k] > 1 else ""
        problem = problem or "; ".join(robot.violations(q[i]))
        return {
            "problem": f"pose {pose[i]}{more} cannot be taken: {problem}",
            "allowed": f"the limits of {robot.name}",
            "remedy": "correct the pose or model",
        }

    faults.each([lines[int(poses[k])] for k, _ in shown], fault, code="T005")


def work_done(m: Measurements) -> tuple[Array, Bools]:
    """Force times displacement (n,), N m, and of which readings it is known: all their loaded directions were read."""
    force = m.wrench[:, :3]
    work = np.where(force != 0.0, force * m.displacement[:, :3], 0.0).sum(axis=1)
    return work, (force != 0.0).any(axis=1) & np.isfinite(work) & (work != 0.0)


def plausibility_notes(m: Measurements) -> Iterator[str]:
    """Say what looks like a wrong sign (units are judged by the class of arm: :mod:`doe.plausibility.units_check`)."""
    work, known = work_done(m)
    against = int((work[known] < 0.0).sum())
    if 2 * against > int(known.sum()):
        yield (
            f"{against} of {int(known.sum())} readings move against the load: the sign looks wrong "
            "(a downward load has fz_N < 0 and gives dz_mm < 0)"
        )


def refuse_seen(seen: Measurements, held_out: Measurements, by: str = "the diagnosis") -> None:
    """Refuse readings to be held out whose poses (joint angles, whatever the label) were seen ``by`` what they judge.

    Raises
    ------
    InputError
        Another number of joints, or poses that are in both tables, which it names.
    """
    what = f"readings to hold out (--holdout {held_out.source})"
    if seen.q.shape[1] != held_out.q.shape[1]:
        raise InputError(f"{what}: joints", code="T008", value=held_out.q.shape[1], allowed=f"{seen.q.shape[1]}")
    known = set(joint_keys(seen.q))
    both = [label for label, key in zip(held_out.pose, joint_keys(held_out.q), strict=True) if key in known]
    if both:
        raise InputError(
            f"{what}: poses that are in {seen.source} too",
            code="T008",
            value=", ".join(dict.fromkeys(both)),
            allowed=f"poses that {by} has not seen",
            remedy="remove them from one of the two tables",
        )
