"""Measured deflections: the table in memory."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from itertools import chain, compress
from typing import Any, TypeVar

import numpy as np

from robots import InputError
from robots.arrays import Array, Bools, Indices

Label = TypeVar("Label", bound=Hashable)


@dataclass(frozen=True, eq=False)
class Measurements:
    """Deflection readings of n poses and loads; SI, base frame.

    ``source`` and ``sha256`` name the file. ``q`` (n, dof) rad; ``wrench`` (n, 6) N, N m;
    ``displacement`` (n, 6) m, rad, NaN = not read; ``point`` (n, 3) m in the flange frame, a NaN row =
    the model's tool point; ``sigma`` (n,) m and ``step`` (n,), NaN = not given. ``row_numbers`` are lines
    of the file (header = 1). ``extra`` keeps unknown columns as text, ``notes`` the warnings in words. ``time`` (n,) s
    and ``temperature`` (n,) deg C, NaN = not given; ``session`` (n,): day or visit, "" = not given.

    Raises
    ------
    InputError
        A field has another length than ``q``, or ``q`` or ``wrench`` is not finite.
    """

    source: str
    sha256: str
    q: Array
    wrench: Array
    displacement: Array
    point: Array
    sigma: Array
    pose: tuple[str, ...]
    repeat: tuple[int | None, ...]
    phase: tuple[str | None, ...]
    step: Array
    row_numbers: tuple[int, ...]
    extra: dict[str, tuple[str, ...]]
    notes: tuple[str, ...]
    time: Array = field(default_factory=lambda: np.zeros(0))
    temperature: Array = field(default_factory=lambda: np.zeros(0))
    session: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for name, nothing in (
            ("time", np.full(len(self.q), np.nan)),
            ("temperature", np.full(len(self.q), np.nan)),
            ("session", ("",) * len(self.q)),
        ):
            if not len(getattr(self, name)):
                object.__setattr__(self, name, nothing)
        if self.q.ndim != 2 or not (np.isfinite(self.q).all() and np.isfinite(self.wrench).all()):
            raise InputError("measurements: q, wrench", code="B001", allowed="finite numbers, (n, dof) and (n, 6)")
        check_columns("measurements", {**self.extra, **columns_of(self)}, self.q, wrench=6, displacement=6, point=3)

    @property
    def n(self) -> int:
        """Number of readings."""
        return len(self.q)

    @property
    def loads_N(self) -> Array:  # noqa: N802 - the unit's letter
        """Magnitude of the force (n,), N; moments do not count."""
        return np.asarray(np.linalg.norm(self.wrench[:, :3], axis=1), dtype=np.float64)

    @property
    def levels_N(self) -> tuple[float, ...]:  # noqa: N802 - as above
        """Magnitudes of the forces, each once, rising, to three digits."""
        return tuple(sorted({float(f"{v:.3g}") for v in self.loads_N.tolist()}))

    @property
    def used(self) -> Bools:
        """Which components were read (n, 6)."""
        return np.asarray(~np.isnan(self.displacement), dtype=np.bool_)

    @property
    def deflection(self) -> Array:
        """Length (n,), m, of what was read of each translation; NaN where nothing was."""
        read = self.used[:, :3]
        size = np.linalg.norm(np.where(read, self.displacement[:, :3], 0.0), axis=1)
        return np.asarray(np.where(read.any(axis=1), size, np.nan))

    @property
    def largest(self) -> tuple[Indices, Array]:
        """Of each reading the translation that was read largest: 0 to 2 (n,), and its size (n,), m.

        NaN where no translation was read.
        """
        size = np.where(self.used[:, :3], np.abs(self.displacement[:, :3]), -1.0)
        at, most = size.argmax(axis=1), size.max(axis=1)
        return at, np.where(most < 0.0, np.nan, most)

    def says_the_same(self, other: Measurements) -> bool:
        """Whether the other table has the same readings, in any order and however its file is written."""

        def rows(table: Measurements) -> Array:
            # To far below what any gauge or controller shows; NaN, which equals nothing, as a number that none shows.
            found = np.hstack([table.q, table.wrench, 1e3 * table.displacement, table.point])
            found = np.nan_to_num(np.round(found, 6), nan=1e30) + 0.0
            return np.asarray(found[np.lexsort(found.T)])

        return self.q.shape == other.q.shape and bool(np.allclose(rows(self), rows(other), rtol=0.0, atol=2e-6))

    def select(self, mask: Bools) -> Measurements:
        """Return the readings where ``mask`` (n,) is true; source, hash and notes stay."""
        mask = np.asarray(mask)
        if mask.dtype != np.bool_ or mask.shape != (self.n,):
            raise InputError("mask", code="B001", value=f"{mask.dtype} {mask.shape}", allowed=f"bool ({self.n},)")
        extra = {name: tuple(compress(column, mask)) for name, column in self.extra.items()}
        return replace(self, **selected(self, mask), extra=extra)  # type: ignore[arg-type]

    def pose_groups(self) -> dict[str, Indices]:
        """Row indices of each pose label, labels in order of first appearance."""
        return rows_of(self.pose)


def load_size(wrench: Array) -> Array:
    """Size of loads (n,) from wrenches (n, 6): of the force, or of the moment where there is no force."""
    force = np.linalg.norm(wrench[:, :3], axis=1)
    return np.asarray(np.where(force > 0.0, force, np.linalg.norm(wrench[:, 3:], axis=1)))


def rows_of(labels: Sequence[Label]) -> dict[Label, Indices]:
    """Rows of each label, labels in order of first appearance."""
    groups: dict[Label, list[int]] = {}
    for i, label in enumerate(labels):
        groups.setdefault(label, []).append(i)
    return {label: np.array(rows, dtype=np.intp) for label, rows in groups.items()}


def largest_rows(labels: Sequence[Label], size: Array) -> Indices:
    """Of each label the row whose ``size`` (n,) is largest, labels in order of first appearance; NaN is the least."""
    known = np.where(np.isnan(size), -np.inf, size)
    return np.array([rows[known[rows].argmax()] for rows in rows_of(labels).values()], dtype=np.intp)


def columns_of(table: Any) -> dict[str, Array | tuple[Any, ...]]:
    """The columns of a table in memory, a dataclass: its arrays and tuples, but for its notes."""
    values = {item.name: getattr(table, item.name) for item in fields(table) if item.name != "notes"}
    return {name: value for name, value in values.items() if isinstance(value, np.ndarray | tuple)}


def check_columns(what: str, columns: Mapping[str, Array | tuple[Any, ...]], q: Array, **widths: int) -> None:
    """Raise InputError where a column has another length than ``q`` (n, dof), or another width than its own, if any."""
    every = {"q": q.shape[1:]} | {name: (width,) for name, width in widths.items()}
    for name, column in columns.items():
        shape, expected = np.shape(column), (len(q), *every.get(name, ()))
        if shape != expected:
            raise InputError(f"{what}: {name}", code="B001", value=f"shape {shape}", allowed=f"{expected}")


def selected(table: Any, mask: Bools) -> dict[str, object]:
    """Columns of a table where ``mask`` (n,) is true."""
    return {
        name: column[mask] if isinstance(column, np.ndarray) else tuple(compress(column, mask))
        for name, column in columns_of(table).items()
    }


def stacked(tables: Sequence[Any]) -> dict[str, object]:
    """Columns of several tables of one kind, one below the other."""
    every = [columns_of(table) for table in tables]
    return {
        name: np.concatenate([columns[name] for columns in every])
        if isinstance(column, np.ndarray)
        else tuple(chain.from_iterable(columns[name] for columns in every))
        for name, column in every[0].items()
    }
