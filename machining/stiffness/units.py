"""Units in which the quantities of an objective are shown: N/mm, um, or a pure number."""

from __future__ import annotations

from dataclasses import dataclass

from machining import INDICES
from machining.stiffness.objective import DISPLACEMENTS
from robots import InputError


@dataclass(frozen=True)
class Shown:
    """A quantity on screens and in files: SI times ``factor`` is in ``unit`` (empty: a number)."""

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
    if quantity in DISPLACEMENTS:
        return Shown(quantity, 1e6, "um")
    if quantity not in INDICES:
        raise InputError("quantity", value=quantity, allowed=", ".join((*INDICES, *DISPLACEMENTS)))
    # An index of degree 1 is N/m.
    return Shown(quantity, 1e-3, "N/mm") if INDICES[quantity].degree else Shown(quantity, 1.0, "")
