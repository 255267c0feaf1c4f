"""What is done in every new set-up: the loads it takes and where, as is usual; loaded poses; the table to fill in."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np

from doe.tables.columns import DISPLACEMENTS, LOADS
from doe.tables.measurements import Measurements
from fem import ArmModel
from fem.statics.loads import LoadedPoses, as_loaded
from robots import InputError
from robots.arrays import Array
from robots.constants import DOWN

# A table may hold a measured force for each reading; a plan is made for a few nominal loads and directions.
MOST_LOADS, MOST_DIRECTIONS = 5, 6


@dataclass(frozen=True)
class Protocol:
    """What is done in every new set-up.

    ``forces`` (l,) N, rising; ``directions`` (d, 3) unit vectors, base axes: each set-up takes one of them with all
    the forces, and takes them off again if ``unloading``; ``components``: what is read (0..5); ``repeats`` of the
    whole; ``point``: where it is loaded and read, m in the flange frame, None for the model's tool point.
    """

    forces: Array
    directions: Array
    components: tuple[int, ...] = (2,)
    repeats: int = 1
    unloading: bool = False
    point: tuple[float, float, float] | None = None

    def __post_init__(self) -> None:
        length = np.linalg.norm(self.directions, axis=1) if self.directions.ndim == 2 else np.zeros(0)
        if self.directions.shape[1:] != (3,) or not length.size or not np.allclose(length, 1.0):
            raise InputError(
                "directions of a plan", code="C006", value=self.directions.tolist(), allowed="unit vectors (d, 3)"
            )
        if self.forces.size == 0 or not (np.isfinite(self.forces) & (self.forces > 0.0)).all():
            raise InputError("forces of a plan (N)", code="C006", value=self.forces.tolist(), allowed="greater than 0")
        if not self.components or not set(self.components) <= set(range(6)):
            raise InputError("components to read", code="C006", value=self.components, allowed="0 to 5, one or more")
        if not 1 <= self.repeats <= 1000:
            raise InputError("repeats of a plan", code="C006", value=self.repeats, allowed="1 to 1000")

    @property
    def course(self) -> Array:
        """Forces N in the order in which they act.

        The largest is read once: nothing changes between the last step up and the first one down.
        """
        return np.concatenate([self.forces, self.forces[-2::-1]]) if self.unloading else self.forces

    @property
    def phases(self) -> tuple[str | None, ...]:
        """Loading or unloading for each force of the course; None where nothing is taken off."""
        up = len(self.forces)
        return ("loading",) * up + ("unloading",) * (up - 1) if self.unloading else (None,) * up

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the columns to fill in."""
        return tuple(DISPLACEMENTS[k] for k in self.components)

    @property
    def hangs(self) -> bool:
        """Whether a load pulls straight down in any of the set-ups."""
        return bool((self.directions @ DOWN > 0.99).any())

    def at(self, model: ArmModel) -> Array:
        """Where it is loaded and read, (3,) m in the flange frame."""
        if self.point is None:
            return np.asarray(model.robot.T_flange_tool[:3, 3])
        return np.asarray(np.array(self.point) + model.load_point)

    def loaded(self, model: ArmModel, q: Array, force: Array) -> LoadedPoses:
        """Poses q (n, dof) rad under nominal forces (n, 3) N at the point, placed as the model says that they act."""
        return as_loaded(model, q, np.hstack([force, np.zeros_like(force)]), np.tile(self.at(model), (len(q), 1)))

    def every(self, model: ArmModel, poses: Array, forces: Array) -> LoadedPoses:
        """Every pose (N, dof) rad under every direction and these forces (l,) N, poses slowest, forces fastest."""
        loads = (self.directions[:, None] * forces[:, None]).reshape(-1, 3)
        return self.loaded(model, np.repeat(poses, len(loads), axis=0), np.tile(loads, (len(poses), 1)))


def usual_loads(forces: Array) -> Array:
    """Magnitudes (l,) N of forces (n, 3), rising, to three digits; of many the least, a middle and the largest."""
    loads = np.unique([float(f"{v:.3g}") for v in np.linalg.norm(forces, axis=1) if v > 0.0])
    return loads[np.unique([0, len(loads) // 2, len(loads) - 1])] if len(loads) > MOST_LOADS else loads


def usual_directions(forces: Array) -> Array:
    """Unit vectors (d, 3) along forces (n, 3) N; of many the axes that they are nearest to; of none straight down."""
    size = np.linalg.norm(forces, axis=1)
    if not (size > 0.0).any():
        return np.array([DOWN])
    unit = np.unique(np.round(forces[size > 0.0] / size[size > 0.0, None], 3), axis=0) + 0.0
    if len(unit) <= MOST_DIRECTIONS:
        return np.asarray(unit / np.linalg.norm(unit, axis=1, keepdims=True))
    main = np.abs(unit).argmax(axis=1)
    nearest = np.zeros_like(unit)
    nearest[np.arange(len(unit)), main] = np.sign(unit[np.arange(len(unit)), main])
    return np.unique(nearest, axis=0)


def usual_point(points: Array, tool: Array) -> tuple[float, float, float] | None:
    """The one of points (n, 3) m that most readings were taken at; None where that is ``tool`` (3,), NaN, or none."""
    if not len(points):
        return None
    some, count = np.unique(np.round(points, 9), axis=0, return_counts=True, equal_nan=True)
    x, y, z = most = some[int(np.argmax(count))]
    return None if np.isnan(most).any() or np.allclose(most, tool, atol=1e-9) else (float(x), float(y), float(z))


def new_labels(n: int, head: str, taken: Collection[str]) -> tuple[str, ...]:
    """``N1``, ``N2`` ...: n labels in a row, none of which is taken."""
    first = 1
    while any(f"{head}{first + k}" in taken for k in range(n)):
        first += 1
    return tuple(f"{head}{first + k}" for k in range(n))


def table_to_fill(
    source: str, q: Array, direction: Array, labels: Sequence[str], protocol: Protocol, first_step: int = 1
) -> Measurements:
    """The readings of set-ups, nothing read yet, in the order of measuring: set-up by set-up, repeat by repeat.

    ``q`` (n, dof) rad and ``direction`` (n, 3) of the set-ups. Write it with
    :func:`doe.tables.reading.write_measurements` and ``to_fill=protocol.columns``.
    """
    course, sets, repeats = protocol.course, len(q), protocol.repeats
    each = np.repeat(np.arange(sets), repeats * len(course))
    total = len(each)
    wrench, nowhere = np.zeros((total, len(LOADS))), (np.nan, np.nan, np.nan)
    wrench[:, :3] = direction[each] * np.tile(course, sets * repeats)[:, None]
    number = np.tile(np.repeat(np.arange(1, repeats + 1), len(course)), sets).tolist()
    return Measurements(
        source=source,
        sha256="",
        q=q[each],
        wrench=wrench + 0.0,
        displacement=np.full((total, len(DISPLACEMENTS)), np.nan),
        point=np.tile(protocol.point or nowhere, (total, 1)),
        sigma=np.full(total, np.nan),
        pose=tuple(np.array(labels, dtype=object)[each]),
        repeat=tuple(number) if repeats > 1 else (None,) * total,
        phase=protocol.phases * (sets * repeats),
        step=first_step + np.arange(total, dtype=np.float64),
        row_numbers=tuple(range(2, total + 2)),
        extra={},
        notes=(),
    )
