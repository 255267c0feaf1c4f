"""What a posture is chosen for: a stiffness index, or the displacement under a given force."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

import fem
from fem.statics.small_displacements import beyond_small, refuse_beyond
from machining.inputs import as_vectors
from machining.stiffness.cartesian import translational
from machining.stiffness.indices import INDICES, evaluate, stiffness_index
from machining.task import Task
from robots import InputError, require_one_of
from robots.arrays import Array, Integers

DISPLACEMENTS = ("displacement", "normal displacement")


@dataclass(frozen=True, eq=False)
class Objective:
    """What is made large, or small.

    ``quantity``: an index of :data:`machining.INDICES`, made large; ``displacement`` |C_tt F| or ``normal
    displacement`` |n . C_tt F| in m, made small. ``force`` (3,) or (n, 3) N on the tool, base axes, where the
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
        require_one_of("objective", self.quantity, (*INDICES, *DISPLACEMENTS))
        if self.aim not in ("mean", "worst"):
            raise InputError("aim of the objective", value=self.aim, allowed="mean, worst")
        if self.force is None and (self.minimised or "force" in INDICES[self.quantity].uses):
            raise InputError(f"force for {self.quantity}", allowed="N in base axes", remedy="give the force")

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

    def values(self, model: fem.ArmModel, q: Array, task: Task, point: Integers) -> Array:
        """Quantity (k,) of poses q (k, dof) rad at the path points ``point`` (k,).

        Raises
        ------
        InputError
            A value that is not finite (an index that is infinite where nothing gives way), displacements that are all
            beyond small ones, or as the quantity.
        """
        normal, forces = task.normals[point], self.forces(task.path.n)
        force = None if forces is None else forces[point]
        if self.quantity == "k_fs":
            value = stiffness_index(model, q, normal, task.tip)
        elif force is not None and self.minimised:
            d = fem.deflection(model, q, np.hstack([force, np.zeros_like(force)]), task.tip)[:, :3]
            if len(d) and beyond_small(model.robot, d).all():
                refuse_beyond(model.robot, d, f"{self.quantity} under the force on the tool")
            along = np.abs(np.einsum("ni,ni->n", d, normal))
            value = np.linalg.norm(d, axis=1) if self.quantity == "displacement" else along
        else:
            value = self.of_compliance(translational(model, q, task.tip), normal, force)
        self.check_finite(value, point)
        return np.asarray(value)

    def of_compliance(self, C: Array, normal: Array, force: Array | None) -> Array:
        """Quantity (k,) of translational compliances C (k, 3, 3) m/N; ``normal`` and ``force`` N (k, 3), base axes."""
        if force is None or not self.minimised:
            return evaluate(self.quantity, C, normal, force)
        d = np.einsum("kab,kb->ka", C, force)
        along = np.abs(np.einsum("ki,ki->k", d, normal))
        return np.asarray(np.linalg.norm(d, axis=1) if self.quantity == "displacement" else along)

    def check_finite(self, value: Array, point: Integers) -> None:
        """Raise InputError for a value (k,) at the path points (k,) that is not finite."""
        if not np.isfinite(value).all():
            raise InputError(
                f"{self.quantity} at path point {int(point[np.argmax(~np.isfinite(value))])}",
                value="not finite",
                allowed="poses in which something gives way",
                remedy="choose k_fs, or a model without rigid directions",
            )
