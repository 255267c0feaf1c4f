"""Two maps of the same points: each quantity of both, and by how much they differ, point by point."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from robots import InputError
from robots.arrays import Array, Bools, Indices
from robots.constants import M_TO_MM, NORMAL_95
from robots.errors import listed
from surrogate.maps.data import Field, MapData

# Points nearer than this are one point, mm; poses that differ by more than this (rad) are two.
SAME_mm: Final = 1e-3
MOVED: Final = np.radians(0.1)
# What a map is of: two of these that differ are two quantities.
OF: Final = ("load", "load_direction", "normal", "force_N")
# What else a reader must know of two maps that differ in it.
MADE: Final = ("links", "load_path", "pose", "stiffness_from", "tool_on_flange", "part_in_base", "model_hash")
# Of the stiffness along the load a map of a calibrated model has this.
STIFFNESS, UNCERTAINTY = "stiffness_N_per_mm", "uncertainty_percent"
# Arrays that are no quantities: shares, poses, marks.
_OTHER: Final = ("share_of_", "softest_part", "near_singular", "workpiece", "reached", UNCERTAINTY, "jacobian")


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

    @property
    def known(self) -> Bools:
        """Points (n,) at which both have a value."""
        return np.asarray(np.isfinite(self.a) & np.isfinite(self.b) & np.isfinite(self.change))

    @property
    def spread(self) -> Array:
        """The change (3,) that 5, 50 and 95 % of the points stay below; NaN where none has a value."""
        change = self.change[self.known]
        return np.quantile(change, [0.05, 0.5, 0.95]) if len(change) else np.full(3, np.nan)

    @property
    def share_beyond(self) -> float:
        """Share of the points at which the uncertainty does not explain the change; NaN where that is not known."""
        return float(np.mean(self.beyond[self.known])) if self.beyond is not None and self.known.any() else np.nan


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


def compare_maps(a: MapData, b: MapData, called: tuple[str, str] = ("the first map", "the second map")) -> MapPair:
    """Two maps of one robot at the same points; ``called``: what messages call them.

    Raises
    ------
    InputError
        Other robots, loads or normals, points, quantities or units.
    """
    if a.metadata.get("robot") != b.metadata.get("robot"):
        raise InputError(
            f"{called[0]} is of {a.metadata.get('robot')}, {called[1]} of {b.metadata.get('robot')}",
            code="A012",
            allowed="one robot",
            remedy="compare maps of one robot",
        )
    for key in OF:
        if a.metadata.get(key) != b.metadata.get(key):
            said = " and ".join(one.metadata.get(key, "not said") for one in (a, b))
            raise InputError(
                f"{called[0]} and {called[1]} are of other quantities: {key.replace('_', ' ')}",
                code="A012",
                value=said,
                allowed="the same in both",
                remedy="make both maps with one command, with the same load and normal",
            )
    i, j = _same_points(a, b, called)
    first, second = (_quantities(one) for one in (a, b))
    names = [name for name in first if name in second and name != UNCERTAINTY]
    if not names:
        raise InputError(
            f"{called[0]} and {called[1]} have no quantity in common",
            code="A012",
            value=f"{listed(first)} and {listed(second)}",
            allowed="maps of the same quantities",
            remedy="make both with the same --values",
        )
    other = [name for name in names if first[name].unit != second[name].unit]
    if other:
        raise InputError(
            f"{called[0]} and {called[1]}: units of {other[0]}",
            code="A012",
            allowed="the same in both",
            value=f"{first[other[0]].unit} and {second[other[0]].unit}",
            remedy="make both maps with one version of stiffarm",
        )
    remarks = [
        f"{key.replace('_', ' ')}: {a.metadata.get(key, 'not said')} and {b.metadata.get(key, 'not said')}"
        for key in MADE
        if a.metadata.get(key) != b.metadata.get(key) and key != "model_hash"
    ]
    if a.metadata.get("warning") != b.metadata.get("warning"):
        # How much of an arm is calibrated decides its stiffness more than anything that two maps are compared for.
        remarks[:0] = [
            f"warning: {name} is {one.metadata['warning'][0].lower()}{one.metadata['warning'][1:].rstrip('.')}"
            for one, name in zip((a, b), called, strict=True)
            if "calibrated" in one.metadata.get("warning", "")
        ]
    if a.metadata.get("model_hash") == b.metadata.get("model_hash"):
        remarks.append("both maps are of the very same model")
    lacking = [name for name in {*first, *second} - {UNCERTAINTY} if name not in names]
    if lacking:
        remarks.append(f"only one of the maps has {listed(sorted(lacking))}")
    moved = np.abs(a.q[i] - b.q[j]).max(axis=1) > MOVED if a.q.shape[1] == b.q.shape[1] and len(i) else np.zeros(len(i))
    if moved.any():
        remarks.append(f"at {int(moved.sum())} of {len(i)} points the arm stands in another pose")
    quantities = tuple(_quantity(name, first, second, i, j) for name in names)
    return MapPair(
        M_TO_MM * a.points[i],
        np.degrees(a.q[i]),
        quantities,
        int(a.reached.sum()) - len(i),
        int(b.reached.sum()) - len(j),
        tuple(remarks),
    )


def _quantities(one: MapData) -> dict[str, Field]:
    """The fields that are quantities, and the uncertainty."""
    return {name: f for name, f in one.fields.items() if name == UNCERTAINTY or not name.startswith(_OTHER)}


def _same_points(a: MapData, b: MapData, called: tuple[str, str]) -> tuple[Indices, Indices]:
    """Rows (k,) of both at the points that both reach."""
    by_pose = any(_many_poses(one) for one in (a, b))
    keys = [_keys(one, by_pose) for one in (a, b)]
    index = [{key: k for k, key in enumerate(own) if one.reached[k]} for own, one in zip(keys, (a, b), strict=True)]
    shared = [key for key in index[0] if key in index[1]]
    least = min(len(index[0]), len(index[1]))
    if len(shared) < max(1, least // 2):
        raise InputError(
            f"{called[0]} and {called[1]} have other points",
            code="A012",
            value=f"{len(shared)} of {least} in common",
            allowed="the same grid",
            remedy="make both maps with the same grid",
        )
    rows = np.array([(index[0][key], index[1][key]) for key in shared], dtype=np.intp)
    return rows[:, 0], rows[:, 1]


def _many_poses(one: MapData) -> bool:
    """Whether a map is of poses, some of which may reach the same point: a sweep of the joints."""
    where = np.round(M_TO_MM * one.points[one.reached] / SAME_mm)
    return len(np.unique(where, axis=0)) < len(where)


def _keys(one: MapData, by_pose: bool) -> list[tuple[float, ...]]:
    """What tells a point from others: where it is, or, of a sweep of the joints, its pose."""
    where = (
        np.round(np.degrees(one.q), 4)
        if by_pose and one.q.shape[1]
        else np.round(M_TO_MM * one.points / SAME_mm) * SAME_mm
    )
    return [tuple(row) for row in (where + 0.0).tolist()]


def _quantity(name: str, a: Mapping[str, Field], b: Mapping[str, Field], i: Indices, j: Indices) -> Quantity:
    first, second = a[name].values[i], b[name].values[j]
    unit = a[name].unit
    is_share = unit in ("N/mm", "um/N")
    with np.errstate(divide="ignore", invalid="ignore"):
        change = second / first - 1.0 if is_share else second - first
    beyond = None
    if name == STIFFNESS and UNCERTAINTY in a and UNCERTAINTY in b:
        sd = 0.01 * np.hypot(a[UNCERTAINTY].values[i], b[UNCERTAINTY].values[j])
        # A share of the compliance: the logarithm's standard deviation.
        beyond = np.asarray(np.abs(np.log(np.maximum(second / first, 1e-300))) > NORMAL_95 * sd, dtype=np.bool_)
    return Quantity(name, a[name].label, unit, first, second, change, is_share, beyond)
