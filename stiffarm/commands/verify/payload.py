"""A verification as JSON and as table rows, in the units of the shop."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from machining.verification import KIND_CODES, Offence, Verification
from stiffarm.commands.verify.words import REMEDIES, sentence, shown, verdict
from stiffarm.session.json_text import number

# Offences in verification.json and on stdout; all of them are counted.
LISTED = 200


def payload(found: Verification) -> dict[str, Any]:
    """Verdict, counts, the worst offences, and the least or greatest figures; keys with units."""
    program, demands, swept, path = found.program, found.demands, found.swept, found.path
    nearest = int(np.argmin(swept.distance))
    pair = swept.names[swept.pair[nearest]] if swept.pair[nearest] >= 0 else None
    return {
        "schema": "stiffarm-verification/1",
        "robot": program.robot.name,
        "cell": program.cell.name,
        "source": program.motions.source,
        "moves": program.n,
        "clean": found.clean,
        "verdict": verdict(found),
        "errors": len(found.errors),
        "warnings": len(found.offences) - len(found.errors),
        "counts": [
            {"kind": str(kind), "code": KIND_CODES[kind], "severity": str(severity), "count": count}
            for (kind, severity), count in found.counts.items()
        ],
        "offences": [_offence(found, o) for o in found.ranked[:LISTED]],
        "offences_left_out": max(0, len(found.offences) - LISTED),
        "interpolation": demands.interpolation,
        "safety_mm": found.safety * 1e3,
        "resolution_mm": demands.resolution * 1e3,
        "tolerance_mm": demands.tolerance * 1e3,
        "smoothing_ms": demands.smoothing * 1e3,
        "poses_measured": swept.samples + (0 if found.rapid is None else found.rapid.samples),
        "least_distance_mm": None if swept.distance[nearest] < 0.0 else number(float(swept.distance[nearest] * 1e3)),
        "least_distance_bodies": None if pair is None else list(pair),
        "least_distance_move": nearest,
        "distances_worked_out_up_to_mm": swept.within * 1e3,
        "time_s": number(float(found.timing.total + program.motions.dwell.sum())),
        "greatest_speed_share": _shares(found, found.timing.speed, found.axes.speed),
        "greatest_acceleration_share": _shares(found, found.timing.acceleration, found.axes.acceleration),
        "greatest_linearisation_error_um": _greatest(path.line * 1e6),
        "greatest_point_deviation_um": _greatest(path.point * 1e6),
        "least_singular_distance": number(float(path.singular.min())),
        "not_looked_at": list(found.not_looked_at),
        "notes": list(found.notes),
    }


def move_columns(found: Verification) -> dict[str, Any]:
    """Columns of moves.csv by name."""
    axes, timing, path = found.axes, found.timing, found.path
    columns: dict[str, Any] = {
        "move": np.arange(found.program.n),
        "line": found.program.motions.line,
        "rapid": found.program.motions.rapid.astype(int),
        "time_s": timing.time,
        "distance_mm": np.where(found.swept.distance < 0.0, 0.0, found.swept.distance * 1e3),
        "proven_distance_mm": np.clip(found.swept.proven, 0.0, None) * 1e3,
        "overlap": np.isfinite(found.swept.hit).astype(int),
        "linearisation_error_um": path.line * 1e6,
        "point_deviation_um": path.point * 1e6,
        "singular_distance": path.singular,
    }
    for j, name in enumerate(axes.names):
        for what, rates in (("speed", timing.speed), ("acceleration", timing.acceleration)):
            values, unit = shown(1.0, axes.unit(j, "/s" if what == "speed" else "/s^2"))
            key = unit.replace("/", "_per_").replace("^", "")
            columns[f"{name}_{what}_{key}"] = rates[:, j] * values
    return columns


def offence_rows(found: Verification) -> Iterator[dict[str, Any]]:
    """Rows of offences.csv: all of them in the order of the program; ``rank``: 1 is the worst."""
    ranks = {id(offence): place for place, offence in enumerate(found.ranked, 1)}
    for offence in found.offences:
        row = {"rank": ranks[id(offence)], **_offence(found, offence)}
        bodies = row.pop("bodies") or ["", ""]
        pose = row.pop("pose")
        yield row | {"body_1": bodies[0], "body_2": bodies[1]} | pose


def _offence(found: Verification, offence: Offence) -> dict[str, Any]:
    value, unit = shown(offence.value, offence.unit)
    limit, _ = shown(offence.limit, offence.unit)
    axes = found.axes
    pose = {}
    for j, name in enumerate(axes.names):
        there, at = shown(float(offence.values[j]), axes.unit(j))
        pose[f"{name}_{at}"] = number(there)
    return {
        "kind": str(offence.kind),
        "code": KIND_CODES[offence.kind],
        "severity": str(offence.severity),
        "line": offence.line,
        "program_file_line": offence.nc_line,
        "move": offence.move,
        "moves": offence.moves,
        "share_of_move": number(offence.at),
        "value": number(value),
        "limit": number(limit),
        "unit": unit,
        "axis": offence.axis or None,
        "bodies": None if offence.bodies is None else list(offence.bodies),
        "words": sentence(offence),
        "remedy": REMEDIES[offence.kind],
        "pose": pose,
    }


def _shares(found: Verification, rates: Any, limits: Any) -> dict[str, float | None]:
    """Greatest share of each axis' limit; null where either is not known."""
    out = {}
    for name, column, limit in zip(found.axes.names, rates.T, limits, strict=True):
        known = np.isfinite(limit) and np.isfinite(column).any()
        out[name] = number(float(np.nanmax(column) / limit)) if known else None
    return out


def _greatest(values: Any) -> float | None:
    return number(float(np.nanmax(values))) if np.isfinite(values).any() else None
