"""What an effect is: a code, parameters with units and plausible ranges, and a law that acts at one stage.

Stages, in the order in which they act on a prediction:

- ``frame``: forces and readings are stated in other axes than the base's; the law gives the rotation (3, 3) from these
  to the base's. Forces go through it before all else, displacements back before a gauge reads them.
- ``model``: the arm has another compliance; the law turns an :class:`ArmModel` into another one.
- ``load``: the arm carries another load, or stands elsewhere; the law turns the loaded poses into others.
- ``arm``: a part gives way by a law of its own (not linear, or with a memory); the law returns the displacement that
  comes on top.
- ``gauge``: what is read is not what happened; the law turns displacements into readings.

A law is a plain function of what it acts on, the :class:`fem.effects.situation.Situation` and the parameters' values
in SI. In every *amplitude* it is linear, or nearly so, starting from no effect at zero; *shapes* say how the law bends.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from robots import InputError, require_one_of
from robots.arrays import Array
from robots.schema.units import DIMENSIONS, factor

Stage = Literal["frame", "model", "load", "arm", "gauge"]
Role = Literal["amplitude", "shape"]
Scale = Literal["linear", "compliance"]
DependsOn = Literal["torque", "angle", "load", "pose", "clock", "temperature", "session"]
# What tells an effect from others: where readings must differ to show it.
Axis = Literal["pose", "load", "load history", "clock", "temperature", "session", "direction"]

# What a law may be off by, as a share of the effect (one standard deviation each way): laws of torque, angle and clock
# are assumed, a structure's compliance is nearly straight, and geometry is exact.
ASSUMED_LAW, NEARLY_STRAIGHT, EXACT = 0.1, 0.04, 0.0
DOUBTS: dict[Stage, float] = {
    "frame": EXACT,
    "model": NEARLY_STRAIGHT,
    "load": EXACT,
    "arm": ASSUMED_LAW,
    "gauge": EXACT,
}

STAGES: tuple[Stage, ...] = ("frame", "model", "load", "arm", "gauge")


@dataclass(frozen=True)
class EffectParameter:
    """One number of a law.

    ``dimension``: of :data:`robots.schema.units.DIMENSIONS`; ``lower`` to ``upper``: plausible range, SI, ``source`` of
    it. ``scale``: "compliance" for a stiffness, which acts as 1/value; else "linear". ``signed``: an amplitude that may
    have either sign; its range is then that of its size. ``grid``: values tried for a shape; ``default``: its value
    where none is given. ``unit``: in which files and screens show it. ``meaning``: for the shop floor, may be empty.
    ``fine``: of a shape that may have any value between those tried, and acts by it; ``of_stays``: of one that makes a
    difference only where the arm stayed at a pose for several load cycles.
    """

    name: str
    dimension: str
    unit: str
    lower: float
    upper: float
    source: str
    role: Role = "amplitude"
    scale: Scale = "linear"
    signed: bool = False
    grid: tuple[float, ...] = ()
    default: float | None = None
    meaning: str = ""
    fine: bool = False
    of_stays: bool = False

    def __post_init__(self) -> None:
        require_one_of(f"effect parameter {self.name}: dimension", self.dimension, DIMENSIONS, code="M011")
        try:
            factor(self.dimension, self.unit)
        except ValueError as error:
            raise InputError(
                f"effect parameter {self.name}: {error}", code="M011", remedy="name a unit of that dimension"
            ) from None
        if not (0.0 <= self.lower < self.upper < math.inf or (self.role == "shape" and self.lower < self.upper)):
            raise InputError(
                f"effect parameter {self.name}: plausible range",
                code="M011",
                value=f"{self.lower:g} to {self.upper:g} (SI)",
                allowed="0 <= lower < upper, finite",
            )
        if self.scale == "compliance" and not self.lower > 0.0:
            raise InputError(
                f"effect parameter {self.name}: lower end of a stiffness", code="M011", value=self.lower, allowed="> 0"
            )
        if self.role == "shape" and not self.grid:
            raise InputError(
                f"effect parameter {self.name}: grid of a shape", code="M011", value="none", allowed="values to try"
            )

    @property
    def si_unit(self) -> str:
        """SI unit of the value."""
        # Compliances have an SI unit for each pair of kinds of rows.
        return self.unit if factor(self.dimension, self.unit) == 1.0 else DIMENSIONS[self.dimension].si

    @property
    def size(self) -> tuple[float, float]:
        """Plausible sizes of the amplitude that acts (1/value for a stiffness), smallest first."""
        if self.scale == "compliance":
            return 1.0 / self.upper, 1.0 / self.lower
        return self.lower, self.upper

    def value(self, amplitude: float) -> float:
        """Value in SI for an amplitude."""
        if self.scale == "compliance":
            return math.inf if amplitude == 0.0 else 1.0 / amplitude
        return amplitude

    def amplitude(self, value: float) -> float:
        """The amplitude that acts, for a value in SI."""
        return 1.0 / value if self.scale == "compliance" else value


# Called with what the stage acts on, the situation, and the parameters' amplitudes or shapes (k,) in SI.
Law = Callable[[Any, Any, Array], Any]


@dataclass(frozen=True)
class Effect:
    """A candidate that a model may be missing.

    ``code``: family and place, ``backlash:j2``; ``words``: what it is, for a report. ``law(subject, situation, v)``:
    ``subject`` is None (stage "frame"; returns (3, 3)), an ArmModel ("model"), LoadedPoses ("load"), None ("arm";
    returns (n, 6) on top) or displacements (n, 6) ("gauge"). v (k,): amplitudes and shapes in the order of
    ``parameters``; a stiffness comes as a compliance. ``needs_history``: readings must say in which order loads were
    put on. ``family``: effects that act alike and are cured alike. ``own``: a user's (:mod:`fem.effects.catalogue`):
    what its law gives is checked, and nothing is taken for granted of how it depends on the springs.

    What a diagnosis asks of it:

    ``depends_on``: what its law varies with: the torque at its place if that is a joint (else the load's size), its
    joint's angle, the load, the pose as a whole, or when it was read. ``differs``: which points (k,) of the shapes'
    grid give a law of their own, where not all do. ``doubt``: what its law may be off by as a share of itself, one
    standard deviation; None: as usual at its stage (``DOUBTS``). ``chance``: beforehand, over that of others of its
    family. ``slot``: of effects with the same slot at one place only one is weighed, a second one would correct the
    first; empty: none. ``spring``: the joint whose axial spring it is in series with: where that is fitted, nothing is
    left to tell. ``usual``: standard deviation of its only amplitude in every arm, missing or not, SI; 0: none.
    ``gross``: of a kind that nothing hides behind: asked about only while nothing has been found.
    ``widths``: factors of the amplitudes' standard deviations beforehand that are all tried: of a law of any size.
    ``held_rigid``: of a part that the model holds rigid and that gives way a little in every arm.
    ``lasting``: whether it acts whenever the arm works, measured or not; None: as usual at its stage, parts of the arm
    do and loads and gauges do not.
    """

    code: str
    words: str
    stage: Stage
    parameters: tuple[EffectParameter, ...]
    law: Law
    family: str
    needs_history: bool = False
    own: bool = False
    depends_on: DependsOn = "torque"
    differs: Callable[[Array], bool] | None = None
    doubt: float | None = None
    chance: float = 1.0
    slot: str = ""
    spring: str = ""
    usual: float = 0.0
    gross: bool = False
    widths: tuple[float, ...] = (1.0,)
    lasting: bool | None = None
    held_rigid: bool = False

    def __post_init__(self) -> None:
        require_one_of(f"effect {self.code}: stage", self.stage, STAGES, code="M011")
        names = [p.name for p in self.parameters]
        if len(set(names)) < len(names):
            raise InputError(
                f"effect {self.code}: parameters", code="M011", value=", ".join(names), allowed="each name once"
            )

    @property
    def place(self) -> str:
        """Where it acts: what the code says behind the colon, empty where it is not one of several."""
        return self.code.partition(":")[2]

    @property
    def axis(self) -> Axis:
        """Along what it acts: poses, loads, their history, time, or how the table's axes lie."""
        if self.depends_on in ("clock", "temperature", "session"):
            return self.depends_on
        if self.needs_history:
            return "load history"
        if self.stage == "frame":
            return "direction"
        bent = self.stage == "arm" and self.depends_on == "torque"
        return "load" if bent or self.depends_on == "load" else "pose"

    @property
    def needs_clock(self) -> bool:
        """Whether readings must say when, in the whole campaign, they were taken."""
        return self.depends_on in ("clock", "temperature", "session")

    @property
    def has_memory(self) -> bool:
        """Whether equal loads at one pose may give unequal answers; of a user's own law that is not known."""
        return self.own or self.needs_history or self.needs_clock

    @property
    def of_the_arm(self) -> bool:
        """Whether it acts whenever the arm works; else it is of one measurement, of its loads and gauges."""
        return self.stage in ("model", "arm") if self.lasting is None else self.lasting

    @property
    def law_doubt(self) -> float:
        """What its law may be off by as a share of the effect, one standard deviation; none where nothing is free."""
        if not self.amplitudes:
            return 0.0
        return DOUBTS[self.stage] if self.doubt is None else self.doubt

    @property
    def drawn_over(self) -> Literal["torque", "angle"] | None:
        """What a picture of its law has on the axis; None where it is no law of one place."""
        if self.own or not self.place:
            return None
        if self.depends_on == "torque":
            return "torque" if self.stage == "arm" else None
        return "angle" if self.depends_on == "angle" else None

    @property
    def amplitudes(self) -> list[int]:
        """Indices of the amplitudes among the parameters."""
        return [k for k, p in enumerate(self.parameters) if p.role == "amplitude"]

    @property
    def shapes(self) -> list[int]:
        """Indices of the shapes among the parameters."""
        return [k for k, p in enumerate(self.parameters) if p.role == "shape"]

    @property
    def fine(self) -> list[int]:
        """Indices of the shapes that may lie between the values tried (:class:`EffectParameter`)."""
        return [k for k, p in enumerate(self.parameters) if p.fine and len(p.grid) > 1]

    def without_stays(self) -> Effect:
        """The effect for readings of one load cycle a stay: shapes that make no difference there at their defaults."""
        if not any(p.of_stays for p in self.parameters):
            return self
        held = (replace(p, grid=(p.default,)) if p.of_stays and p.default is not None else p for p in self.parameters)
        return replace(self, parameters=tuple(held))

    def placed(self, values: Mapping[str, float]) -> PlacedEffect:
        """The effect with values in SI for all parameters, by name.

        Raises
        ------
        InputError
            A name that the effect does not have, one that is missing, or a value that is not finite.
        """
        names = [p.name for p in self.parameters]
        values = {p.name: p.default for p in self.parameters if p.default is not None} | dict(values)
        unknown = sorted(set(values) - set(names))
        missing = [name for name in names if name not in values]
        if unknown or missing:
            raise InputError(
                f"parameters of effect {self.code}",
                code="M011",
                value=f"unknown {', '.join(unknown)}" if unknown else f"missing {', '.join(missing)}",
                allowed=", ".join(names) or "none",
            )
        inner = []
        for p in self.parameters:
            if not math.isfinite(values[p.name]) or (p.scale == "compliance" and not values[p.name] > 0.0):
                allowed = f"a finite number{' above 0' if p.scale == 'compliance' else ''} ({p.si_unit})"
                raise InputError(f"{self.code}.{p.name}", code="M011", value=values[p.name], allowed=allowed)
            inner.append(p.amplitude(values[p.name]))
        return PlacedEffect(self, np.array(inner))


@dataclass(frozen=True)
class PlacedEffect:
    """An effect with its numbers: ``values`` (k,) as :class:`Effect`'s law takes them."""

    effect: Effect
    values: Array

    @property
    def by_name(self) -> dict[str, float]:
        """Values in SI, by the parameters' names."""
        return {p.name: p.value(float(v)) for p, v in zip(self.effect.parameters, self.values, strict=True)}
