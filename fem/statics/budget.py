"""Where the compliance comes from: each part's share in the strain energy of the loaded arm.

By Clapeyron's theorem half the work of the load is stored as strain energy, ``0.5 w . d = sum_p 0.5 s_p . C_p s_p``.
With :func:`fem.statics.flexibility.deflection_by_part` part p stores ``0.5 w . d_p``, so its share in the energy is
also its share in the tool's displacement along the load, and no part can have a negative one. Only a joint whose
bearing is coupled with its axis is one part: its springs store energy together, and halves of it mean nothing.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Literal, TypeVar

import numpy as np

from fem.model import ArmModel
from fem.statics.flexibility import deflection_by_part
from fem.statics.loads import as_wrenches
from robots import InputError
from robots.arrays import Array

Value = TypeVar("Value", float, Array)
PartKind = Literal["link", "joint", "parallelogram", "other"]

# A part that carries next to nothing has an energy of either sign by round-off; this much of the total at most.
_ROUND_OFF = 1e-9


@dataclass(frozen=True)
class Budget:
    """Strain energy of n poses, split over p parts.

    ``parts``, ``kinds``: names in the order of :func:`fem.statics.flexibility.deflection_by_part` (but see
    :func:`whole_joints`), and what each one is: a link, a joint's springs, the parallelogram's bar or crank, or
    something else (base, tool). ``share`` (n, p): 0 to 1, each row adds up to 1. ``energy`` (n,): total, J.
    """

    parts: tuple[str, ...]
    kinds: tuple[PartKind, ...]
    share: Array
    energy: Array

    @property
    def part_energy(self) -> Array:
        """Strain energy of each part (n, p), J."""
        return self.share * self.energy[:, None]

    def of_kind(self, kind: PartKind) -> Array:
        """Share (n,) of all parts of one kind together."""
        return np.asarray(self.share[:, [k == kind for k in self.kinds]].sum(axis=1))


def compliance_budget(model: ArmModel, q: Array, wrench: Array, point: Array | None = None) -> Budget:
    """Split the strain energy of each pose by part.

    Parameters
    ----------
    q : (n, dof) rad; limits are not checked here
    wrench : (6,) or (n, 6), force N and moment N m in base axes at the tool point
    point : (3,) or (n, 3) m in the flange frame instead of the model's tool point

    Raises
    ------
    InputError
        Shapes, values that are not finite (also those of springs far outside the angles they are known for), a flat
        parallelogram, a pose where nothing deflects under its load, or a part that would release energy (its
        compliance matrix is not that of an elastic part).
    """
    loads = as_wrenches(wrench, len(q))
    displacement = deflection_by_part(model, q, wrench, point)
    by_part = whole_joints(model, {name: 0.5 * np.einsum("ni,ni->n", loads, d) for name, d in displacement.items()})
    energy = np.stack(list(by_part.values()), axis=1) if by_part else np.zeros((len(loads), 0))
    total = energy.sum(axis=1)
    if not np.isfinite(total).all():
        row = int(np.argmin(np.isfinite(total)))
        raise InputError(
            f"pose {row}: the strain energy is not finite",
            code="M005",
            remedy="check the springs that depend on joint angles: far outside the angles of their fit they run away",
        )
    if not (total > 0.0).all():
        row = int(np.argmin(total > 0.0))
        raise InputError(
            f"pose {row}: nothing deflects under this load",
            code="M005",
            value=loads[row].tolist(),
            allowed="a load, and a model that is not rigid against it",
            remedy="give the model flexible links or joint springs",
        )
    wrong = energy < -_ROUND_OFF * total[:, None]
    # The secant of an effect that stiffens takes from what the others store: its own share is none.
    if wrong.any() and model.secants is None:
        row, column = (int(i) for i in np.argwhere(wrong)[0])
        raise InputError(
            f"part {list(by_part)[column]} at pose {row}: strain energy (J)",
            code="M005",
            value=float(energy[row, column]),
            allowed="0 or more",
            remedy="check its stiffness and its mesh: its compliance matrix is not positive",
        )
    energy = np.maximum(energy, 0.0)
    total = energy.sum(axis=1)
    names = tuple(by_part)
    return Budget(names, part_kinds(model, names), energy / total[:, None], total)


def whole_joints(model: ArmModel, values: Mapping[str, Value]) -> dict[str, Value]:
    """Energies or displacements by part with a joint's bearing added to its spring where the two are coupled."""
    out = dict(values)
    for joint in model.joints:
        bearing = f"{joint.name} other directions"
        if joint.is_coupled and bearing in out and joint.name in out:
            out[joint.name] = out[joint.name] + out.pop(bearing)
    return out


def part_kinds(model: ArmModel, names: Collection[str]) -> tuple[PartKind, ...]:
    """What each part is, by its name."""
    links = {link.name for link in model.links}
    joints = tuple(joint.name for joint in model.joints)

    def kind(name: str) -> PartKind:
        if name in links:
            return "link"
        if name in ("bar", "crank"):
            return "parallelogram"
        # "j2", "j2 other directions".
        return "joint" if name in joints or name.startswith(tuple(f"{j} " for j in joints)) else "other"

    return tuple(kind(name) for name in names)
