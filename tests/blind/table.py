"""The measurement table: readings to CSV, and a proposed sheet back to readings."""

from __future__ import annotations

import csv
import io

import numpy as np

from rehearsal.arm import Arm
from rehearsal.readings import Readings, in_cycles
from robots.arrays import Array

AXES = ("x", "y", "z")


def to_csv(arm: Arm, r: Readings, d: Array, reads: str, label: str = "P") -> str:
    """The table of DESIGN.md: deflections in mm to the micrometre, whatever was read; poses ``label`` 01, 02, ..."""
    columns = ["pose", "step", "repeat", "phase", *arm.coordinates, "fx_N", "fy_N", "fz_N"]
    columns += [f"d{axis}_mm" for axis in reads]
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(columns)
    degrees = np.round(np.degrees(r.q), 2) + 0.0
    picked = [AXES.index(axis) for axis in reads]
    for k in range(len(r)):
        phase = "unloading" if r.unloading[k] else "loading"
        row = [f"{label}{r.setup[k] + 1:02d}", k + 1, r.repeat[k], phase]
        row += [f"{v:g}" for v in degrees[k]] + [f"{v:g}" for v in r.force[k] + 0.0]
        row += [f"{1e3 * d[k, a] + 0.0:.3f}" for a in picked]
        writer.writerow(row)
    return out.getvalue()


def number(row: dict[str, str], name: str) -> float:
    """A cell's number, 0 where it is empty or missing."""
    text = (row.get(name) or "").strip()
    return float(text) if text else 0.0


def from_sheet(
    arm: Arm, text: str, first_setup: int, highest: float
) -> tuple[list[dict[str, str]], list[int], Readings]:
    """A sheet's rows as they stand, the order in which they are taken, and the readings in that order.

    Rows are taken in the order of ``step`` where it is given; set-ups and cycles by
    :func:`rehearsal.readings.in_cycles`, ``highest`` the largest load (N) of the campaign.
    """
    sample = text.splitlines()[0] if text.strip() else ""
    rows = list(csv.DictReader(io.StringIO(text), delimiter=";" if ";" in sample else ","))
    for name in ("mx_Nm", "my_Nm", "mz_Nm", "px_mm", "py_mm", "pz_mm"):
        if any(number(row, name) for row in rows):
            raise ValueError(f"{name} is not 0: the hidden arm is loaded by forces at its tool point only")
    stated = [bool((row.get("step") or "").strip()) for row in rows]
    order = sorted(range(len(rows)), key=lambda k: number(rows[k], "step")) if rows and all(stated) else None
    order = list(range(len(rows))) if order is None else order
    q = np.radians([[number(rows[k], name) for name in arm.coordinates] for k in order]).reshape(-1, 6)
    force = np.array([[number(rows[k], f"f{axis}_N") for axis in AXES] for k in order]).reshape(-1, 3)
    down = np.array([(rows[k].get("phase") or "").strip() == "unloading" for k in order], dtype=bool)
    repeat = np.array([int(number(rows[k], "repeat") or 1) for k in order], dtype=int)
    setup, cycle, peaks = in_cycles(q, force, down, repeat, highest, first_setup)
    clock = 1 + np.arange(1, len(q) + 1) / 486  # the pace of a campaign of 27 poses
    return rows, order, Readings(q, force, setup, cycle, down, repeat, clock, peaks)


def fill(rows: list[dict[str, str]], order: list[int], d: Array, reads: str) -> str:
    """The sheet with its readings filled in, rows where they stood: the axes it has columns for, else ``reads``."""
    reads = "".join(axis for axis in AXES if f"d{axis}_mm" in rows[0]) or reads
    names = list(rows[0]) + [f"d{axis}_mm" for axis in reads if f"d{axis}_mm" not in rows[0]]
    for place, k in enumerate(order):
        for axis in reads:
            rows[k][f"d{axis}_mm"] = f"{1e3 * d[place, AXES.index(axis)] + 0.0:.3f}"
    out = io.StringIO()
    writer = csv.DictWriter(out, names, lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return out.getvalue()
