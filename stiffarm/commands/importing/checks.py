"""What a user must know of imported links before trusting their stiffness: departures, poor elements, soft shells."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fem import build_model
from robots import ModelDescription, Remark
from stiffarm.commands.importing.step import MadeShell

# Shells are softer than their beams by their rings and walls, by up to this factor; beyond, one of the two is no
# model of the link.
MOST_RATIO = 3.0


@dataclass(frozen=True)
class TipCompliance:
    """Largest tip displacement for a unit force (m/N), root held, of a link as shell and as beam."""

    shell: float
    beam: float

    @property
    def ratio(self) -> float:
        """Shell over beam; infinite for a rigid beam."""
        return self.shell / self.beam if self.beam > 0.0 else float("inf")

    def warning(self) -> str | None:
        """What to say where the two differ by more than ``MOST_RATIO``."""
        if 1.0 / MOST_RATIO <= self.ratio <= MOST_RATIO:
            return None
        softer = self.ratio > 1.0
        times = self.ratio if softer else 1.0 / self.ratio
        why = (
            "its walls deflect around the joints, or lie far from the line between them"
            if softer
            else "the beam's section stands for only part of the casing"
        )
        return Remark(
            f"WARNING: its tip is {times:.3g} times as compliant as a {'shell' if softer else 'beam'} "
            f"({1e9 * (self.shell if softer else self.beam):.3g} um/kN) than as a {'beam' if softer else 'shell'} "
            f"({1e9 * (self.beam if softer else self.shell):.3g} um/kN): {why}; look at its rings and wall, "
            f"and compare both with --links",
            code="W025",
        )


def tip_compliances(description: ModelDescription, names: tuple[str, ...]) -> dict[str, TipCompliance]:
    """Of the links of these names, by condensing each as a shell and as a beam.

    The shells come from the cache, or are left there for the commands that follow. Raises InputError where a model
    cannot be built.
    """
    chosen = description.model_copy(update={"link": [link for link in description.link if link.name in names]})
    shells, beams = (build_model(chosen, kind).links for kind in ("shell", "beam"))
    found = {}
    for shell, beam in zip(shells, beams, strict=True):
        first = 6 * (shell.element.interfaces.index("tip") - 1)
        block = slice(first, first + 3)
        at = [float(np.linalg.eigvalsh(part.element.flexibility[block, block])[-1]) for part in (shell, beam)]
        found[shell.name] = TipCompliance(*at)
    return found


def warnings_of(made: MadeShell, compliance: TipCompliance) -> list[str]:
    """All warnings of one link: departure first, then what the gate says, then shell against beam."""
    said = [line for line in made.link.report if line.startswith("WARNING")]
    soft = compliance.warning()
    return [*said, *made.verdict.warnings, *([soft] if soft else [])]
