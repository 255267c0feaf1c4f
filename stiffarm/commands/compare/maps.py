"""Two maps of the same points: each quantity of both, and by how much they differ, point by point."""

from __future__ import annotations

import logging
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from robots import InputError
from robots.arrays import Array, Bools, Indices
from robots.constants import NORMAL_95
from robots.errors import listed
from surrogate.maps.columns import JOINT_LABEL

# Points nearer than this are one point, mm.
SAME_mm: Final = 1e-3
# What a map is of: two of these that differ are two quantities.
OF: Final = ("load", "load_direction", "normal", "force_N")
# What else a reader must know of two maps that differ in it.
MADE: Final = ("links", "load_path", "pose", "stiffness_from", "tool_on_flange", "part_in_base", "model_hash")
# Of the stiffness along the load a map of a calibrated model has this.
STIFFNESS, UNCERTAINTY = "stiffness_N_per_mm", "uncertainty_percent"
# Arrays that are no quantities: shares, poses, marks.
_OTHER: Final = ("share_of_", "softest_part", "near_singular", "workpiece", "reached", UNCERTAINTY, "jacobian")


@dataclass(frozen=True, eq=False)
class MapFile:
    """A map as its file has it: ``points`` (n, 3) mm, where ``reached``; ``values`` (n,) by name, ``units``, labels.

    ``of``: what it is of and how it was made, words by name; ``q`` (n, dof) deg.
    """

    name: str
    points: Array
    reached: Bools
    q: Array
    values: Mapping[str, Array]
    units: Mapping[str, str]
    labels: Mapping[str, str]
    of: Mapping[str, str]


@dataclass(frozen=True, eq=False)
class Quantity:
    """One quantity of two maps at the points (n,) that both reach.

    ``change`` (n,): second over first less one where ``is_share``, else the difference; ``beyond`` (n,): whether that
    is more than the uncertainty of both explains, None where they do not say it.
    """

    name: str
    label: str
    unit: str
    a: Array
    b: Array
    change: Array
    is_share: bool
    beyond: Bools | None


@dataclass(frozen=True, eq=False)
class MapPair:
    """Two maps side by side.

    ``only_a``, ``only_b``: points that only one of them reaches; ``remarks``: how else they differ.
    """

    points: Array
    q: Array
    quantities: tuple[Quantity, ...]
    only_a: int
    only_b: int
    remarks: tuple[str, ...]


def read_map(path: Path, name: str) -> MapFile:
    """A map from VTK.

    Raises
    ------
    InputError
        The file cannot be read, or is no map of ours.
    """
    import pyvista

    try:
        with _quiet():
            mesh = pyvista.read(path)
    except Exception as error:  # VTK raises what it likes on spoilt files
        raise InputError(f"map {path} cannot be read ({error})", code="A012", remedy="make the map again") from error
    words = {key: [str(v) for v in mesh.field_data[key]] for key in mesh.field_data.keys()}  # noqa: SIM118 - no mapping
    if "units" not in words or "robot" not in words or not mesh.n_points:
        raise InputError(
            f"{path} is no map of stiffarm", code="A012", allowed="the .vtu, .vti or .vtp of `stiffarm map`"
        )
    units, labels = (
        dict(one.split(" = ", 1) for one in words.get(key, []) if " = " in one) for key in ("units", "labels")
    )
    arrays = {key: np.asarray(mesh.point_data[key], dtype=np.float64) for key in mesh.point_data.keys()}  # noqa: SIM118
    reached = arrays.get("reached", np.ones(mesh.n_points)) > 0.5
    joints = [key for key in arrays if labels.get(key, "").startswith(JOINT_LABEL)]
    values = {key: v for key, v in arrays.items() if v.ndim == 1 and key not in joints and not key.startswith(_OTHER)}
    q = np.stack([arrays[key] for key in joints], axis=1) if joints else np.zeros((mesh.n_points, 0))
    kept = {**values, **({UNCERTAINTY: arrays[UNCERTAINTY]} if UNCERTAINTY in arrays else {})}
    of = {key: v[0] for key, v in words.items() if key not in ("units", "labels") and not key.endswith("_categories")}
    return MapFile(name, np.asarray(mesh.points, dtype=np.float64), reached, q, kept, units, labels, of)


@contextmanager
def _quiet() -> Iterator[None]:
    """Nothing of what VTK complains of on three ways: it shows in what it gives."""
    import pyvista

    logging.disable(logging.ERROR)
    try:
        with warnings.catch_warnings(), pyvista.vtk_verbosity("off"):
            warnings.simplefilter("ignore")
            yield
    finally:
        logging.disable(logging.NOTSET)


def compare_maps(a: MapFile, b: MapFile) -> MapPair:
    """Two maps of one robot at the same points.

    Raises
    ------
    InputError
        Other robots, loads or normals, points, quantities or units.
    """
    if a.of.get("robot") != b.of.get("robot"):
        raise InputError(
            f"{a.name} is of {a.of.get('robot')}, {b.name} of {b.of.get('robot')}",
            code="A012",
            allowed="one robot",
            remedy="compare maps of one robot",
        )
    for key in OF:
        if a.of.get(key) != b.of.get(key):
            said = " and ".join(one.of.get(key, "not said") for one in (a, b))
            raise InputError(
                f"{a.name} and {b.name} are of other quantities: {key.replace('_', ' ')}",
                code="A012",
                value=said,
                allowed="the same in both",
                remedy="make both maps with one command, with the same load and normal",
            )
    i, j = _same_points(a, b)
    names = [name for name in a.values if name in b.values and name != UNCERTAINTY]
    if not names:
        raise InputError(
            f"{a.name} and {b.name} have no quantity in common",
            code="A012",
            value=f"{listed(a.values)} and {listed(b.values)}",
            allowed="maps of the same quantities",
            remedy="make both with the same --values",
        )
    other = [name for name in names if a.units.get(name, "") != b.units.get(name, "")]
    if other:
        raise InputError(
            f"{a.name} and {b.name}: units of {other[0]}",
            code="A012",
            allowed="the same in both",
            value=f"{a.units.get(other[0])} and {b.units.get(other[0])}",
            remedy="make both maps with one version of stiffarm",
        )
    remarks = [
        f"{key.replace('_', ' ')}: {a.of.get(key, 'not said')} and {b.of.get(key, 'not said')}"
        for key in MADE
        if a.of.get(key) != b.of.get(key) and key != "model_hash"
    ]
    if a.of.get("warning") != b.of.get("warning"):
        # How much of an arm is calibrated decides its stiffness more than anything that two maps are compared for.
        remarks[:0] = [
            f"warning: {one.name} is {one.of['warning'][0].lower()}{one.of['warning'][1:].rstrip('.')}"
            for one in (a, b)
            if "calibrated" in one.of.get("warning", "")
        ]
    if a.of.get("model_hash") == b.of.get("model_hash"):
        remarks.append("both maps are of the very same model")
    lacking = [name for name in {*a.values, *b.values} - {UNCERTAINTY} if name not in names]
    if lacking:
        remarks.append(f"only one of the maps has {listed(sorted(lacking))}")
    moved = np.abs(a.q[i] - b.q[j]).max(axis=1) > 0.1 if a.q.shape[1] == b.q.shape[1] and len(i) else np.zeros(len(i))
    if moved.any():
        remarks.append(f"at {int(moved.sum())} of {len(i)} points the arm stands in another pose")
    quantities = tuple(_quantity(name, a, b, i, j) for name in names)
    return MapPair(
        a.points[i], a.q[i], quantities, int(a.reached.sum()) - len(i), int(b.reached.sum()) - len(j), tuple(remarks)
    )


def _same_points(a: MapFile, b: MapFile) -> tuple[Indices, Indices]:
    """Rows (k,) of both at the points that both reach."""
    by_pose = any(_many_poses(one) for one in (a, b))
    keys = [_keys(one, by_pose) for one in (a, b)]
    index = [{key: k for k, key in enumerate(own) if one.reached[k]} for own, one in zip(keys, (a, b), strict=True)]
    shared = [key for key in index[0] if key in index[1]]
    least = min(len(index[0]), len(index[1]))
    if len(shared) < max(1, least // 2):
        raise InputError(
            f"{a.name} and {b.name} have other points",
            code="A012",
            value=f"{len(shared)} of {least} in common",
            allowed="the same grid",
            remedy="make both maps with the same grid",
        )
    rows = np.array([(index[0][key], index[1][key]) for key in shared], dtype=np.intp)
    return rows[:, 0], rows[:, 1]


def _many_poses(one: MapFile) -> bool:
    """Whether a map is of poses, some of which may reach the same point: a sweep of the joints."""
    where = np.round(one.points[one.reached] / SAME_mm)
    return len(np.unique(where, axis=0)) < len(where)


def _keys(one: MapFile, by_pose: bool) -> list[tuple[float, ...]]:
    """What tells a point from others: where it is, or, of a sweep of the joints, its pose."""
    where = np.round(one.q, 4) if by_pose and one.q.shape[1] else np.round(one.points / SAME_mm) * SAME_mm
    return [tuple(row) for row in (where + 0.0).tolist()]


def _quantity(name: str, a: MapFile, b: MapFile, i: Indices, j: Indices) -> Quantity:
    first, second = a.values[name][i], b.values[name][j]
    unit = a.units.get(name, "")
    is_share = unit in ("N/mm", "um/N")
    with np.errstate(divide="ignore", invalid="ignore"):
        change = second / first - 1.0 if is_share else second - first
    beyond = None
    if name == STIFFNESS and UNCERTAINTY in a.values and UNCERTAINTY in b.values:
        sd = 0.01 * np.hypot(a.values[UNCERTAINTY][i], b.values[UNCERTAINTY][j])
        # A share of the compliance: the logarithm's standard deviation.
        beyond = np.asarray(np.abs(np.log(np.maximum(second / first, 1e-300))) > NORMAL_95 * sd, dtype=np.bool_)
    return Quantity(name, a.labels.get(name, name), unit, first, second, change, is_share, beyond)
