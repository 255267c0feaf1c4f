"""What a campaign of joint twists cannot judge: laws that no spare angle checks, scatter and noise without freedoms."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from doe.joint_twists.cycles import Cycles
from doe.joint_twists.laws import FEWEST_FOR_A_LAW, FEWEST_FOR_ORDER_TWO, Direction, LawKind, angles_of

KINDS = ("translations", "rotations")
# Fewer spare set-ups say nothing about their scatter.
FEWEST_SPARE = 6
NO_NOISE = (
    "no load cycle has more readings than are fitted to it, and the table gives no standard deviation (sigma_mm, "
    "sigma_twist_mrad): nothing tells the noise of a reading"
)


@dataclass(frozen=True)
class Unjudged:
    """Something that these readings cannot judge: ``what``, of which joints, stiffnesses or kinds, and why."""

    what: str
    of: tuple[str, ...]
    reason: str

    @property
    def words(self) -> str:
        """One sentence."""
        return f"{self.what} of {', '.join(self.of)} cannot be judged: {self.reason}"


def unjudged(
    directions: Mapping[tuple[str, str], Direction],
    cycles: Cycles,
    names: tuple[str, ...],
    asked: LawKind | None,
    scatter_dof: tuple[int, int],
) -> tuple[Unjudged, ...]:
    """All of it, each reason once."""
    found: dict[tuple[str, str], list[str]] = {}

    def add(what: str, of: str, reason: str) -> None:
        found.setdefault((what, reason), []).append(of)

    watched = [j for j in range(len(names)) if (cycles.joint == j).any()]
    for j in watched:
        for reason in _of_angles(len(angles_of(cycles.angle[cycles.joint == j])[0]), asked):
            add("how the stiffnesses vary with the angle", names[j], reason)
        for kind, words in enumerate(KINDS):
            if not cycles.noise_known[j, kind]:
                add(f"how sure the {words} are", names[j], NO_NOISE)
    for (joint, row), d in directions.items():
        for what, reason in _of_law(d, asked):
            add(what, f"{joint}.{row}", reason)
    for words, freedoms in zip(KINDS, scatter_dof, strict=True):
        if freedoms < FEWEST_SPARE:
            add("the scatter between set-ups", words, f"fewer than {FEWEST_SPARE} set-ups beyond the first at an "
                "angle; intervals hold for the noise of the readings alone")  # fmt: skip
    return tuple(Unjudged(what, tuple(of), reason) for (what, reason), of in found.items())


def _of_angles(count: int, asked: LawKind | None) -> list[str]:
    if count == 1:
        return ["all readings at one angle (whole turns apart is the same angle)"]
    if asked is None and count < FEWEST_FOR_A_LAW:
        return [f"fewer than {FEWEST_FOR_A_LAW} angles; constants are taken"]
    if asked is None and count < FEWEST_FOR_ORDER_TWO:
        return [f"fewer than {FEWEST_FOR_ORDER_TWO} angles show nothing that varies faster than once a turn"]
    return []


def _of_law(d: Direction, asked: LawKind | None) -> list[tuple[str, str]]:
    if d.law is None:
        return []
    out, size, count = [], d.law.basis.size, len(d.angle)
    if d.law.kind == "constant" and d.status != "one-sided" and (d.scores if asked is None else asked != "constant"):
        wanted = "a law over the angle" if asked is None else f"the law {asked}"
        out.append((wanted, "it does not settle on these angles; a constant is taken"))
    if 1 < count <= size:
        out.append(("the law's lack of fit", f"{size} numbers through {count} angles leave none to check the law by"))
    lost = [kind for kind, score in d.scores.items() if not np.isfinite(score)]
    if lost:
        out.append((f"how well {' and '.join(lost)} predicts angles left out",
                    "without one of the angles it does not settle"))  # fmt: skip
    return out
