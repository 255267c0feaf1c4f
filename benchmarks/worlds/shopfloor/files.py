"""How a set is written: the model as the program may know it, tables, and what may be seen of the campaign."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterable, Mapping, Sequence

from benchmarks.worlds.shopfloor.arms import Floats, Robot, source_of, urdf
from benchmarks.worlds.shopfloor.campaign import Timeline, air
from benchmarks.worlds.shopfloor.cases import Case

FORCES = ("fx_N", "fy_N", "fz_N")
MOVES = ("dx_mm", "dy_mm", "dz_mm")
PHASES = {1: "loading", -1: "unloading"}
DRAWING_NOTE = "# Springs are nominal: what the maker's sheet says, not what was measured.\n"


def model_text(case: Case) -> str:
    """The arm's file with nominal springs; joints to be held rigid have none, and a hidden load path is serial."""
    arm = case.truth.drawing
    if case.by_urdf:
        return urdf(arm)
    text = source_of(arm.name).read_text(encoding="utf-8")
    if case.truth.hides("load-path"):
        text = text.replace('load_path = "parallelogram"', 'load_path = "serial"')
    head, *blocks = re.split(r"(?m)^(?=\[\[joint\]\]$)", text)
    return DRAWING_NOTE + head + "".join(_with_spring(case, arm, k, block) for k, block in enumerate(blocks))


def _with_spring(case: Case, arm: Robot, k: int, block: str) -> str:
    block = re.sub(r"(?m)^stiffness = .*\n", "", block, count=1)
    if k not in case.springs:
        return block
    line = f'stiffness = {{ value = {arm.axes[k].spring:.6g}, unit = "N m/rad", source = "assumed" }}\n'
    return re.sub(r"(?m)^(limits = .*\n)", lambda found: found.group(1) + line, block, count=1)


def coordinates(case: Case) -> tuple[str, ...]:
    """Columns of the angles; a URDF's joints are named by themselves."""
    arm = case.truth.drawing
    return tuple(f"{a.name}_deg" if case.by_urdf else a.coordinate for a in arm.axes)


def read_axes(case: Case) -> tuple[str, ...]:
    return tuple(MOVES[case.axes])


def temperature(case: Case, line: Timeline) -> Floats:
    """Of the hall's air, or of a joint's housing, which the drives warm by up to 14 degrees."""
    hall = air(line.time, case.truth.mood)
    return hall + 14.0 * line.warm if case.thermometer == "housing" else hall


def clocks(case: Case, line: Timeline) -> list[dict[str, str]]:
    """Time, temperature and session of each reading."""
    rows = line.reads
    many = int(line.session.max()) > 0
    warm = temperature(case, line)
    return [
        {
            "time_s": f"{line.time[i]:.0f}",
            **({} if case.thermometer == "none" else {"temperature_C": f"{warm[i]:.1f}"}),
            **({"session": f"day-{line.session[i] + 1}"} if many else {}),
        }
        for i in rows
    ]


def load_columns(case: Case) -> tuple[str, ...]:
    return FORCES if len(case.ways) > 1 else FORCES[2:]


def rows_of(case: Case, q_deg: Floats, line: Timeline, d: Floats, digits: int, first_pose: int) -> list[dict[str, str]]:
    """The table's rows in the order of reading; d (n_reads, 3) m."""
    names, loads = coordinates(case), load_columns(case)
    out = []
    for step, (i, move) in enumerate(zip(line.reads, d, strict=True), start=1):
        p = int(line.pose[i])
        row = {"pose": str(p + first_pose), "repeat": str(line.repeat[i])}
        if case.down:
            row["phase"] = PHASES[int(line.phase[i])]
        row["step"] = str(step)
        row |= {name: f"{angle:g}" for name, angle in zip(names, q_deg[p], strict=True)}
        force = dict(zip(FORCES, line.force[i], strict=True))
        row |= {name: f"{force[name] + 0.0:.10g}" for name in loads}
        row |= {name: f"{1e3 * move[MOVES.index(name)] + 0.0:.{digits}f}" for name in read_axes(case)}
        out.append(row)
    return out


def to_csv(rows: Sequence[Mapping[str, str]], columns: Iterable[str] | None = None) -> str:
    out = io.StringIO()
    names = list(dict.fromkeys(columns if columns is not None else (name for row in rows for name in row)))
    writer = csv.DictWriter(out, names, restval="", lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return out.getvalue()


def digits(case: Case) -> int:
    """Decimals of a millimetre that the gauge shows."""
    return 2 if case.noise.resolution > 5e-6 else 3
