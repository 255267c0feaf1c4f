"""What a posture is chosen for: a stiffness index, or the displacement under a given force; units to show it in."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

import fem
from fem.statics.small_displacements import beyond_small, refuse_beyond
from machining.inputs import as_vectors
from machining.posture.room import room
from machining.stiffness.cartesian import translational
from machining.stiffness.indices import INDICES, evaluate, stiffness_index
from machining.task import Task
from machining.toolpaths.path_error import PathError
from robots import InputError, require_one_of
from robots.arrays import Array, Integers

DISPLACEMENTS = ("displacement", "normal displacement")
QUANTITIES = (*INDICES, *DISPLACEMENTS)
# What an arm is posed by of which nothing in N/mm is known (machining.posture.room).
ROOM = "room"


@dataclass(frozen=True, eq=False)
class Objective:
    """What is made large, or small.

    ``quantity``: an index of :data:`machining.INDICES`, made large; ``displacement`` |C_tt F| or ``normal
    displacement`` |n . C_tt F| in m, made small; or :data:`ROOM`, of the arm's kinematics alone. ``force`` (3,) or
    (n, 3) N on the tool, base axes, where the
    quantity needs one. ``aim`` of a path: the mean over its points, or its worst point.

    Raises
    ------
    InputError
        No such quantity or aim, or the force that it needs is missing.
    """

    quantity: str = "k_fs"
    force: Array | None = None
    aim: Literal["mean", "worst"] = "mean"

    def __post_init__(self) -> None:
        require_one_of("objective", self.quantity, (*QUANTITIES, ROOM), code="G004")
        require_one_of("aim of the objective", self.aim, ("mean", "worst"), code="G004")
        uses = INDICES[self.quantity].uses if self.quantity in INDICES else ()
        if self.force is None and (self.minimised or "force" in uses):
            raise InputError(
                f"force for {self.quantity}", code="G004", allowed="N in base axes", remedy="give the force"
            )

    @property
    def minimised(self) -> bool:
        """Whether small is good."""
        return self.quantity in DISPLACEMENTS

    @property
    def sign(self) -> float:
        """Times the quantity: a merit, large is good."""
        return -1.0 if self.minimised else 1.0

    def forces(self, n: int) -> Array | None:
        """Force (n, 3) N at each of n points; errors as :func:`machining.inputs.as_vectors`."""
        return None if self.force is None else as_vectors("force", self.force, n, "N")

    def at(self, rows: slice | Integers, n: int) -> Objective:
        """The same at some of a path's n points."""
        force = self.forces(n)
        return self if force is None else replace(self, force=force[rows])

    def values(self, model: fem.ArmModel, q: Array, task: Task, point: Integers) -> Array:
        """Quantity (k,) of poses q (k, dof) rad at the path points ``point`` (k,).

        Raises
        ------
        InputError
            A value that is not finite (an index that is infinite where nothing deflects), displacements that are all
            beyond small ones, or as the quantity.
        """
        if self.quantity == ROOM:
            return room(model.robot, q)
        normal, forces = task.normals[point], self.forces(task.path.n)
        force = None if forces is None else forces[point]
        if self.quantity == "k_fs":
            value = stiffness_index(model, q, normal, task.tip_at(point))
        elif force is not None and self.minimised:
            d = fem.deflection(model, q, np.hstack([force, np.zeros_like(force)]), task.tip_at(point))[:, :3]
            if len(d) and beyond_small(model.robot, d).all():
                refuse_beyond(model.robot, d, f"{self.quantity} under the force on the tool")
            value = displaced(self.quantity, d, normal)
        else:
            value = self.of_compliance(translational(model, q, task.tip_at(point)), normal, force)
        self.check_finite(value, point)
        return np.asarray(value)

    def of_compliance(self, C: Array, normal: Array, force: Array | None) -> Array:
        """Quantity (k,) of translational compliances C (k, 3, 3) m/N; ``normal`` and ``force`` N (k, 3), base axes."""
        if force is None or not self.minimised:
            return evaluate(self.quantity, C, normal, force)
        return displaced(self.quantity, np.einsum("kab,kb->ka", C, force), normal)

    def check_finite(self, value: Array, point: Integers) -> None:
        """Raise InputError for a value (k,) at the path points (k,) that is not finite."""
        if not np.isfinite(value).all():
            raise self.not_finite(int(point[np.argmax(~np.isfinite(value))]))

    def not_finite(self, point: int) -> PathError:
        """The error of a value that is not finite at a path point."""
        return PathError(
            point,
            f"{self.quantity} at path point {point}",
            code="M005",
            value="not finite",
            allowed="poses in which something deflects",
            remedy="choose k_fs, or a model without rigid directions",
        )


def displaced(quantity: str, d: Array, normal: Array) -> Array:
    """A quantity (k,) m of :data:`DISPLACEMENTS` of displacements d (k, 3) m; ``normal`` (k, 3), unit vectors."""
    along = np.abs(np.einsum("ki,ki->k", d, normal))
    return np.asarray(np.linalg.norm(d, axis=1) if quantity == "displacement" else along)


@dataclass(frozen=True)
class Shown:
    """A quantity of an objective on screens and in files: SI times ``factor`` is in ``unit`` (empty: a number)."""

    quantity: str
    factor: float
    unit: str

    @property
    def label(self) -> str:
        """For axes: ``k_fs (N/mm)``."""
        return f"{self.quantity} ({self.unit})" if self.unit else self.quantity

    @property
    def column(self) -> str:
        """For tables: ``k_fs_N_per_mm``."""
        unit = self.unit.replace("/", "_per_")
        return "_".join(part for part in (self.quantity.replace(" ", "_"), unit) if part)


def shown(quantity: str) -> Shown:
    """Unit of a quantity of :class:`machining.Objective`.

    Raises
    ------
    InputError
        No such quantity.
    """
    require_one_of("quantity", quantity, (*QUANTITIES, ROOM), code="S015")
    if quantity == ROOM:
        return Shown(quantity, 1.0, "")
    if quantity in DISPLACEMENTS:
        return Shown(quantity, 1e6, "um")
    # An index of degree 1 is N/m.
    return Shown(quantity, 1e-3, "N/mm") if INDICES[quantity].degree else Shown(quantity, 1.0, "")
