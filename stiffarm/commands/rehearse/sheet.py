"""What is measured in a rehearsal: poses, loads, points, order, axes and noise, of a table, a sheet or a campaign."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import nnls

from doe import Measurements, bundled_data
from doe.tables.columns import DISPLACEMENTS
from doe.tables.reading import read_set_ups
from fem.arm import Arm
from rehearsal import Arm as World
from rehearsal import Noise, Readings
from rehearsal.design import poses_of, repeated, up_and_down
from rehearsal.readings import in_cycles
from robots import InputError
from robots.arm_class import usual_load
from robots.arrays import Array, Bools, Indices
from robots.quantities import Quantity, relative, rounded

if TYPE_CHECKING:
    from stiffarm.commands.rehearse.command import RehearseRequest

AXES = "xyz"
# What a gauge does where neither the sheet nor an option says it: 3 % of the deflection and 3 um, read to 1 um, and
# set-ups that differ by half a percent.
PERCENT, FLOOR_UM, RESOLUTION_UM, SETUP_PERCENT = 3.0, 3.0, 1.0, 0.5
UM = Quantity("", "um", 1e6, digits=2)
# Readings that repeats must have over their means for their scatter to tell the noise.
ENOUGH = 8
# A campaign of our own: poses, repeats, and loads as shares of the largest.
POSES, REPEATS, SHARES = 27, 3, (0.25, 0.6, 1.0)


@dataclass(frozen=True)
class SetUps:
    """Readings to be made: ``table`` as the diagnosis will see it, ``readings`` in the order of time.

    ``row`` (n,): the table's row of each reading; ``read`` (n, 3): its axes; ``noise``, and ``words`` on where it is
    from; ``source``: of the set-ups, in words.
    """

    source: str
    table: Measurements
    readings: Readings
    row: Indices
    read: Bools
    noise: Noise
    words: str

    def filled(self, d: Array) -> Measurements:
        """The table with readings d (n, 3) m in the order of time."""
        out = np.full((self.table.n, 6), np.nan)
        out[self.row, :3] = d
        return replace(self.table, displacement=out)


def bundled_sheet(robot: str) -> Path | None:
    """The table that is bundled with a robot, if there is one."""
    try:
        return bundled_data(robot)
    except InputError:
        return None


def of_sheet(given: Arm, path: Path, asked: RehearseRequest) -> SetUps:
    """The set-ups of a measurement table or of a sheet to fill in.

    Raises
    ------
    InputError
        A table that does not fit the robot, or in which no displacement along an axis is read.
    """
    if asked.reads is not None:
        raise InputError(
            "--reads",
            code="A002",
            value=asked.reads,
            allowed="nothing where a SHEET says what is read",
            remedy="leave it out, or give --poses for a campaign without a sheet",
        )
    table, columns = read_set_ups(path, given.robot)
    own = table.used[:, :3]
    header = np.array([name in columns for name in DISPLACEMENTS[:3]])
    read = np.where(own.any(axis=1, keepdims=True), own, header & ~table.used.any(axis=1, keepdims=True))
    if not read.any():
        raise InputError(
            f"{table.source}: columns read",
            code="C006",
            value=", ".join(columns),
            allowed="dx_mm, dy_mm or dz_mm",
            remedy="a rehearsal reads displacements, no rotations: add one of these columns",
        )
    kept = np.asarray(read.any(axis=1), dtype=np.bool_)
    table, read = table.select(kept), read[kept]
    noise, words = _noise_of(table, asked)
    blank = replace(table, displacement=np.full((table.n, 6), np.nan), sigma=np.full(table.n, np.nan), extra={})
    return arranged(f"the set-ups of {table.source}", blank, read, noise, words)


def arranged(source: str, table: Measurements, read: Bools, noise: Noise, words: str) -> SetUps:
    """Rows of a table put in the order of time; ``read`` (n, 3) and the noise of single readings in the table's."""
    row = _in_time(table)
    if isinstance(noise.floor_m, np.ndarray):
        noise = replace(noise, floor_m=noise.floor_m[row])
    return SetUps(source, table, _readings(table, row), row, read[row], noise, words)


def campaign(given: Arm, world: World, asked: RehearseRequest, poses: int, rng: np.random.Generator) -> SetUps:
    """A campaign of our own: poses that fill the space, three loads up and down, three repeats.

    The largest load is half of the payload's weight, or half of what arms of this reach bear.
    """
    reads = AXES if asked.reads is None else _axes(asked.reads)
    top = rounded(0.5 * usual_load(given.robot, given.description), 2) or 0.0
    sizes = [rounded(top * share, 2) or 0.0 for share in SHARES]
    r = repeated(poses_of(world, poses, rng), [up_and_down(sizes, np.array([0.0, 0.0, -1.0]))], REPEATS)
    noise = _stated(asked)
    read = np.tile([axis in reads for axis in AXES], (len(r), 1))
    loads = ", ".join(f"{size:g}" for size in sizes)
    source = f"{poses} poses that fill the space, {loads} N up and down, {REPEATS} repeats, reading {', '.join(reads)}"
    return SetUps(source, _table_of(r), r, np.arange(len(r)), read, noise, _words(asked))


def _axes(text: str) -> str:
    if not text or set(text) - set(AXES) or len(set(text)) < len(text):
        raise InputError(
            "--reads", code="C006", value=text, allowed="x, y, z, xy, xz, yz or xyz", remedy="name each axis once"
        )
    return text


def _table_of(r: Readings) -> Measurements:
    n = len(r)
    phase = tuple("unloading" if down else "loading" for down in r.unloading)
    return Measurements(
        "campaign",
        "",
        r.q,
        r.wrench,
        np.full((n, 6), np.nan),
        np.full((n, 3), np.nan),
        np.full(n, np.nan),
        tuple(f"P{k + 1:02d}" for k in r.setup),
        tuple(int(k) for k in r.repeat),
        phase,
        np.arange(1.0, n + 1.0),
        tuple(range(2, n + 2)),
        {},
        (),
    )


def held_out(r: Readings) -> Measurements:
    """Other readings of the world as a table; each is a loading from zero."""
    table = _table_of(r)
    point = table.point if r.point is None else r.point
    pose = tuple(f"U{k + 1:02d}" for k in r.setup)
    return replace(table, source="poses held out", pose=pose, point=point, step=np.full(len(r), np.nan))


def _in_time(m: Measurements) -> Indices:
    """Rows in the order in which they are taken: by step; without steps pose by pose, a repeat after the other."""
    if np.isfinite(m.step).all():
        return np.argsort(m.step, kind="stable").astype(np.intp)
    labels = {label: k for k, label in enumerate(dict.fromkeys(m.pose))}
    keys = [(labels[m.pose[k]], m.repeat[k] or 0, k) for k in range(m.n)]
    return np.array([key[2] for key in sorted(keys)], dtype=np.intp)


def _readings(m: Measurements, row: Indices) -> Readings:
    q, wrench = m.q[row], m.wrench[row]
    down = np.array([m.phase[k] == "unloading" for k in row], dtype=np.bool_)
    repeat = np.array([m.repeat[k] or 1 for k in row], dtype=np.int64)
    setup, cycle, peak = in_cycles(q, wrench[:, :3], down, repeat, 0.0)
    moment = wrench[:, 3:] if wrench[:, 3:].any() else None
    point = m.point[row] if np.isfinite(m.point).any() else None
    return Readings(q, wrench[:, :3], setup, cycle, down, repeat, np.linspace(0.0, 1.0, m.n), peak, moment, point)


def _stated(asked: RehearseRequest) -> Noise:
    percent = PERCENT if asked.noise_percent is None else asked.noise_percent
    floor = FLOOR_UM if asked.noise_um is None else asked.noise_um
    return Noise(0.01 * percent, 1e-6 * floor, 1e-6 * RESOLUTION_UM, 0.01 * asked.setup_percent)


def _words(asked: RehearseRequest) -> str:
    n = _stated(asked)
    said = "assumed" if asked.noise_percent is None and asked.noise_um is None else "as asked"
    return f"{relative(n.share)} of the deflection and {UM.text(float(np.max(n.floor_m)), unit=True)} a reading, {said}"


def _noise_of(m: Measurements, asked: RehearseRequest) -> tuple[Noise, str]:
    """Noise as asked; else by the column sigma_mm, in the table's order; else by the repeats' scatter; else assumed."""
    stated = _stated(asked)
    if asked.noise_percent is not None or asked.noise_um is not None:
        return stated, _words(asked)
    if np.isfinite(m.sigma).all():
        return replace(stated, share=0.0, floor_m=m.sigma[:, None]), "the standard deviations of column sigma_mm"
    scatter = _scatter(m)
    if scatter is None:
        return stated, _words(asked)
    share, floor = scatter
    words = (
        f"{relative(share)} of the deflection and {UM.text(floor, unit=True)} a reading, by the scatter of the repeats"
    )
    return replace(stated, share=share, floor_m=floor), words


def _scatter(m: Measurements) -> tuple[float, float] | None:
    """Share and floor (m) by readings of one pose, load, phase and point; None where there are hardly any."""
    groups: dict[object, list[int]] = {}
    point = np.nan_to_num(m.point, nan=1e9)
    for k in range(m.n):
        groups.setdefault((m.pose[k], m.phase[k], *m.wrench[k].round(6), *point[k].round(9)), []).append(k)
    size, variance, weight = list[float](), list[float](), list[int]()
    for rows in groups.values():
        for axis in range(3):
            d = m.displacement[rows, axis]
            d = d[np.isfinite(d)]
            if len(d) > 1:
                size.append(float(d.mean()))
                variance.append(float(d.var(ddof=1)))
                weight.append(len(d) - 1)
    if sum(weight) < ENOUGH:
        return None
    # Weighed by what the mean scatter makes of them: a variance scatters like itself.
    w = np.sqrt(weight)
    A = np.column_stack([np.ones(len(size)), np.square(size)]) * w[:, None]
    scale = np.maximum(np.linalg.norm(A, axis=0), 1e-300)
    found = nnls(A / scale, np.array(variance) * w)[0] / scale
    return float(np.sqrt(found[1])), float(np.sqrt(found[0]))


def distinct_loads(r: Readings, most: int = 4) -> Sequence[int]:
    """Rows of readings whose loads stand for all: of the distinct ones so many at most, spread over their sizes."""
    _, first = np.unique(np.round(r.wrench, 6), axis=0, return_index=True)
    order = first[np.argsort(np.linalg.norm(r.force[first], axis=1), kind="stable")]
    picked = np.unique(np.linspace(0, len(order) - 1, min(most, len(order))).round().astype(int))
    return [int(order[k]) for k in picked]
