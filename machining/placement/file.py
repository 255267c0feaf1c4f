"""Placements in files: where base, turntable and arm stand at each point of a path, for whoever posts the program."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from robots import InputError, require_one_of
from robots.arrays import Array, Bools, Integers
from robots.files.reading import parse_json, read_text

# What this reads is the same in both.
SCHEMAS = ("stiffarm-placement/1", "stiffarm-placement/2")
# Millimetres of a travel, degrees of an angle.
LARGEST = 1e7
# Moves of a source; as many as the readers of tool paths keep.
MOST_MOVES = 10_000_000
Rapid = Literal["linear", "joint"]
RAPIDS: tuple[Rapid, ...] = ("linear", "joint")
REMEDY = "write it again with `stiffarm place`"


@dataclass(frozen=True, eq=False)
class Placement:
    """A placement read from a file.

    ``robot``, ``cell``: their names; ``axes`` (k,) names of the linear axes; ``travel`` (n, k) m at the path's points;
    ``table`` rad; ``gamma`` (n,) rad; ``joints`` names and ``q`` (n, dof) rad; ``moves`` (n,): moves of the source that
    end at the points, ``count``: moves that the source has. ``rapid``: how its rapid moves have to go.
    """

    robot: str
    cell: str
    axes: tuple[str, ...]
    travel: Array
    table: float
    gamma: Array
    joints: tuple[str, ...]
    q: Array
    moves: Integers
    count: int
    rapid: Rapid = "linear"

    def at_moves(self, rapid: Bools | None = None) -> Array:
        """Travels (count, k) m at each move of the source, as :class:`machining.programs.posting.PostSettings` takes.

        What the axes have to go between two cuts the moves between them share evenly; the rapid ones alone where
        ``rapid`` (count,) says which these are and there is one: a plunge or a retract at feed is no time to travel.
        """
        return self._spread(self.travel, rapid)

    def gamma_at_moves(self, rapid: Bools | None = None) -> Array:
        """Angle gamma (count,) rad at each move of the source, likewise."""
        return self._spread(np.unwrap(self.gamma)[:, None], rapid)[:, 0]

    def joints_at_moves(self, rapid: Bools | None = None) -> Array:
        """Joint angles (count, dof) rad at each move of the source, likewise: which branch and turns are meant."""
        return self._spread(self.q, rapid)

    def at_every_move(self, rapid: Bools) -> dict[str, Any]:
        """Fields of :class:`machining.programs.posting.PostSettings` that a placement says, for all moves."""
        found = {
            "gamma": self.gamma_at_moves(rapid),
            "travel": self.at_moves(rapid),
            "table": self.table,
            "near": self.joints_at_moves(rapid),
        }
        # Straight ones may be joint motion too, if a user wants that.
        return found | ({"rapid": self.rapid} if self.rapid == "joint" else {})

    def _spread(self, values: Array, rapid: Bools | None) -> Array:
        """Values (n, k) at the path's points carried over to all moves, (count, k)."""
        # The moves from one point of the path to the next; those that take a share of the way between them.
        piece = np.searchsorted(self.moves, np.arange(self.count))
        takes = np.ones(self.count, dtype=np.bool_)
        if rapid is not None:
            has = np.bincount(piece, weights=rapid, minlength=len(self.moves) + 1) > 0.0
            takes = np.where(has[piece], rapid, True)
        clock = np.cumsum(takes)
        columns = [np.interp(clock, clock[self.moves], column) for column in values.T]
        return np.stack(columns, axis=1) if columns else np.zeros((self.count, 0))


def placement_content(placement: Placement) -> dict[str, Any]:
    """What :func:`read_placement` reads, as a JSON object: keys with units."""
    travel = {f"e{i + 1}_mm": _column(1e3 * column) for i, column in enumerate(placement.travel.T)}
    joints = {name: _column(column) for name, column in zip(placement.joints, np.degrees(placement.q).T, strict=True)}
    return {
        "schema": SCHEMAS[-1],
        "robot": placement.robot,
        "cell": placement.cell,
        "linear_axes": list(placement.axes),
        "turntable_deg": float(np.degrees(placement.table)),
        "source_moves": placement.count,
        "rapid_moves": placement.rapid,
        "points": {
            "move": placement.moves.tolist(),
            **travel,
            "gamma_deg": _column(np.degrees(placement.gamma)),
            **joints,
        },
    }


def read_placement(path: str | Path) -> Placement:
    """Read the ``placement.json`` of `stiffarm place`; keys that are not known are left alone.

    Raises
    ------
    InputError
        The file cannot be read, is of another kind or version, lacks a key, or holds columns of unequal length or
        numbers that are not finite.
    """
    file = Path(path)
    content = parse_json(read_text(file, "placement", remedy=REMEDY), f"placement {file}", remedy=REMEDY)
    if not isinstance(content, dict) or content.get("schema") not in SCHEMAS:
        found = content.get("schema") if isinstance(content, dict) else type(content).__name__
        allowed = " or ".join(SCHEMAS)
        raise InputError(f"schema of placement {file.name}", code="F006", value=found, allowed=allowed, remedy=REMEDY)
    try:
        return _placement(content)
    except (KeyError, TypeError, ValueError) as error:
        what = f"key {error} is missing" if isinstance(error, KeyError) else str(error)
        raise InputError(f"placement {file.name}: {what}", code="F006", remedy=REMEDY) from error


def _placement(content: Mapping[str, Any]) -> Placement:
    points = content["points"]
    axes = tuple(str(name) for name in content["linear_axes"])
    moves = _whole(points["move"], "points.move")
    n, count = len(moves), int(_whole([content["source_moves"]], "source_moves")[0])
    rapid = content.get("rapid_moves", "linear")
    require_one_of("rapid_moves of the placement", rapid, RAPIDS, code="F006", remedy=REMEDY)
    joints = tuple(name for name in points if name.endswith("_deg") and name != "gamma_deg")
    travel = [_numbers(points, f"e{i + 1}_mm", n) * 1e-3 for i in range(len(axes))]
    q = [np.radians(_numbers(points, name, n)) for name in joints]
    if not n or moves.min() < 0 or moves.max() >= count or (np.diff(moves) <= 0).any():
        raise ValueError(f"moves must rise within 0 to {count - 1}")
    return Placement(
        robot=str(content["robot"]),
        cell=str(content["cell"]),
        axes=axes,
        travel=np.stack(travel, axis=1) if travel else np.zeros((n, 0)),
        table=float(np.radians(_numbers(content, "turntable_deg")[0])),
        gamma=np.radians(_numbers(points, "gamma_deg", n)),
        joints=joints,
        q=np.stack(q, axis=1),
        moves=moves,
        count=count,
        rapid=rapid,
    )


def _numbers(points: Mapping[str, Any], name: str, n: int | None = None) -> Array:
    """Numbers (n,) of a column, or the one number of a key."""
    column = np.array([points[name]] if n is None else points[name], dtype=np.float64)
    if column.shape != (n or 1,) or not (np.abs(column) <= LARGEST).all():
        raise ValueError(f"{name} must hold {n or 1} finite numbers of at most {LARGEST:g}")
    return column


def _whole(values: Any, name: str) -> Integers:
    """Whole numbers from 0 to the largest number of moves."""
    if not isinstance(values, list) or not all(type(v) is int and 0 <= v <= MOST_MOVES for v in values):
        raise ValueError(f"{name} must hold whole numbers from 0 to {MOST_MOVES}")
    return np.array(values, dtype=np.int64)


def _column(values: Array) -> list[float]:
    # Ten digits: a nanometre on ten metres.
    return [float(f"{v:.10g}") for v in values]
