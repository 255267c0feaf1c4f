"""Relative displacements and twists between neighbouring arms under loads at the flange: the table in memory."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from doe.tables.measurements import columns_of, selected, stacked
from robots import InputError
from robots.arrays import Array, Bools, Indices


@dataclass(frozen=True, eq=False)
class TwistReadings:
    """Readings of n loads, each of one joint; SI.

    ``q`` (n, dof) rad; ``joint`` (n,) index of the joint watched; ``wrench`` (n, 6) N, N m at ``point``, flange axes;
    ``point`` (n, 3) m, flange frame. ``twist`` (n, 6): displacement (m) and rotation (rad) of the arm behind the joint
    against the arm before it, in the joint's modified DH frame (Z along the gear axis, turning with the arm behind the
    joint), at that frame's origin; NaN = not read. ``sigma`` (n, 6): their standard deviations, NaN = not given.
    ``phase`` (n,): loading or unloading. ``setup`` (n,): label of the set-up. ``row_numbers``: lines of the file.
    ``synthetic``: the table says that it was made up.

    Raises
    ------
    InputError
        A field has another length than ``q``.
    """

    source: str
    sha256: str
    q: Array
    joint: Indices
    wrench: Array
    point: Array
    twist: Array
    sigma: Array
    phase: tuple[str, ...]
    setup: tuple[str, ...]
    row_numbers: tuple[int, ...]
    synthetic: bool
    notes: tuple[str, ...]

    def __post_init__(self) -> None:
        widths = {"q": self.q.shape[1:], "wrench": (6,), "point": (3,), "twist": (6,), "sigma": (6,)}
        for name, column in columns_of(self).items():
            shape, expected = np.shape(column), (self.n, *widths.get(name, ()))
            if shape != expected:
                raise InputError(f"twist readings: {name}", value=f"shape {shape}", allowed=f"{expected}")

    @property
    def n(self) -> int:
        """Number of readings."""
        return len(self.q)

    @property
    def load(self) -> Array:
        """Size of the load (n,): of the force, or of the moment where there is no force."""
        force = np.linalg.norm(self.wrench[:, :3], axis=1)
        return np.asarray(np.where(force > 0.0, force, np.linalg.norm(self.wrench[:, 3:], axis=1)))

    @property
    def is_loading(self) -> Bools:
        """Which readings were taken on the way up (n,)."""
        return np.array([phase == "loading" for phase in self.phase], dtype=np.bool_)

    def select(self, mask: Bools) -> TwistReadings:
        """The readings where ``mask`` (n,) is true."""
        return replace(self, **selected(self, mask))  # type: ignore[arg-type]


def joined(tables: Sequence[TwistReadings]) -> TwistReadings:
    """Several tables of one robot as one; set-ups of different files stay apart.

    Raises
    ------
    InputError
        No table, the same file twice, or synthetic and measured tables together.
    """
    if not tables:
        raise InputError("tables of joint twists", value=0, allowed="1 or more")
    if len(tables) == 1:
        return tables[0]
    if len({t.sha256 for t in tables}) < len(tables):
        raise InputError("tables of joint twists: the same file twice", remedy="leave one of them out")
    if len({t.synthetic for t in tables}) > 1:
        raise InputError(
            "tables of joint twists: synthetic and measured ones together",
            value=", ".join(t.source for t in tables if t.synthetic),
            allowed="either kind",
            remedy="leave the synthetic ones out",
        )
    apart = [replace(t, setup=tuple(f"{label} ({t.source})" for label in t.setup)) for t in tables]
    return replace(
        tables[0],
        **stacked(apart),  # type: ignore[arg-type]
        source=" + ".join(t.source for t in tables),
        sha256=hashlib.sha256("".join(t.sha256 for t in tables).encode()).hexdigest(),
        notes=tuple(f"{t.source}: {note}" for t in tables for note in t.notes),
    )
