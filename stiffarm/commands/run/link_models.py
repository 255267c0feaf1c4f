"""The same calibrations with two models of the links: which results depend on the link model."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final, Literal

import numpy as np

from doe import Measurements, loaded_points, select_loads
from doe.certainty.uncertainty import ParameterEstimate
from doe.estimation.campaign import Campaign, NoiseChoice
from doe.published.parametric import PoseFit
from fem import LinkKind
from fem.arm import Arm
from fem.statics.budget import compliance_budget
from robots import LoadPath
from robots.arrays import Array
from stiffarm.commands.calibrate import step as calibrating
from stiffarm.commands.calibrate.step import Calibrated, Request
from stiffarm.session import inputs, steps
from stiffarm.session.words.springs import at_widest_bound

Agreement = Literal["within", "outside", "unknown"]

BESIDE: Final[Mapping[LinkKind, LinkKind]] = MappingProxyType(
    {"solid": "beam", "shell": "beam", "beam": "rigid", "rigid": "beam"}
)
"""Which links a run is compared with. Shells are built only where they were asked for: they take their time."""
NOUN: Final[Mapping[LinkKind, str]] = MappingProxyType(
    {"rigid": "rigid links", "beam": "beams", "shell": "shells", "solid": "solids"}
)


@dataclass(frozen=True)
class LinkCalibrations:
    """Every load path and scheme with one kind of links.

    ``variants``: in the same order for every kind of links; ``share``: by variant, what links, bar and crank hold
    of the strain energy at the readings used (n,), 0 to 1; ``alone_mm``: by load path, the read displacements of
    the arm with rigid joints (m,), mm or mrad as in :attr:`Calibrated.predicted_mm`.
    """

    links: LinkKind
    variants: tuple[Calibrated, ...]
    share: Mapping[str, Array]
    alone_mm: Mapping[LoadPath, Array]


@dataclass(frozen=True)
class SpringPair:
    """One spring with both kinds of links; (value, low, high) N m/rad each, and at which stage and pose if staged."""

    joint: str
    own: tuple[float, float, float]
    other: tuple[float, float, float]
    where: tuple[str, str] | None = None

    @property
    def agreement(self) -> Agreement:
        """Whether each value lies within the other's interval; unknown where there is no interval."""
        if not np.isfinite([self.own[:2], self.other[:2]]).all() or np.isnan([self.own[2], self.other[2]]).any():
            return "unknown"
        crossed = ((self.own[0], self.other), (self.other[0], self.own))
        return "within" if all(low <= value <= high for value, (_, low, high) in crossed) else "outside"

    @property
    def has_values(self) -> bool:
        """Whether both are numbers, and not the end of the widest range."""
        return not (at_widest_bound(self.own[0]) or at_widest_bound(self.other[0]))

    @property
    def change(self) -> float:
        """Relative difference of the own spring from the other one."""
        return self.own[0] / self.other[0] - 1.0


@dataclass(frozen=True)
class Pair:
    """One load path and scheme with the run's own links and with those beside them."""

    own: Calibrated
    other: Calibrated
    springs: tuple[SpringPair, ...]

    @property
    def left_out_difference_mm(self) -> float:
        """Left-out RMS of the own links minus that of the others: negative where the own ones predict better."""
        return self.own.left_out_rms_mm - self.other.left_out_rms_mm

    def poses_better(self) -> tuple[int, int]:
        """How many poses the own links predict better, of how many that both predict."""
        _, of = np.unique(self.own.pose, return_inverse=True)
        own, other = (np.bincount(of, side.left_out**2) for side in (self.own, self.other))
        both = np.isfinite(own + other)
        return int((own < other)[both].sum()), int(both.sum())


@dataclass(frozen=True)
class LinkModels:
    """The run's own links (``own``) and those it is compared with."""

    own: LinkCalibrations
    other: LinkCalibrations

    @property
    def nouns(self) -> tuple[str, str]:
        """What both kinds of links are called, the run's own first."""
        return NOUN[self.own.links], NOUN[self.other.links]

    @property
    def pairs(self) -> tuple[Pair, ...]:
        """One for each load path and scheme."""
        variants = zip(self.own.variants, self.other.variants, strict=True)
        return tuple(Pair(a, b, _spring_pairs(a, b)) for a, b in variants)


def by_load_path(given: Arm) -> dict[LoadPath, Arm]:
    """The model with its own load path first, then with the other one if the robot has it."""
    own = given.model.load_path
    if given.robot.parallelogram is None:
        return {own: given}
    other: LoadPath = "serial" if own == "parallelogram" else "parallelogram"
    return {own: given, other: inputs.with_load_path(given, other)}


def calibrate(
    models: Mapping[LoadPath, Arm],
    table: Measurements,
    scheme: Campaign,
    report: Callable[[Calibrated], None] | None = None,
    holdout: Measurements | None = None,
) -> LinkCalibrations:
    """Calibrate one kind of links with every load path (:func:`by_load_path`): by stages if any, and all at once.

    ``holdout``: readings that every calibration predicts.
    """
    used = select_loads(table, scheme.loads_N)
    joints, noise = scheme.beside.constant.joints, NoiseChoice(gauge_mm=scheme.noise.gauge_mm)
    constant = calibrating.springs_campaign(scheme.robot, joints, None, scheme.springs.ends, noise)
    staged = [Request(scheme, scheme.loads_N, scheme.springs.ends)] if scheme.stage else []
    requests = (*staged, Request(constant, scheme.loads_N, scheme.springs.ends))
    variants: list[Calibrated] = []
    alone: dict[LoadPath, Array] = {}
    for path, one in models.items():
        made = tuple(calibrating.calibrate(one, table, request, holdout=holdout) for request in requests)
        alone[path] = steps.links_alone(one, used)[used.used] * 1e3
        variants += made
        if report is not None:
            for variant in made:
                report(variant)
    return LinkCalibrations(
        variants[0].model.link_kind, tuple(variants), {v.name: _structure_share(v, used) for v in variants}, alone
    )


def _structure_share(variant: Calibrated, used: Measurements) -> Array:
    """Share (n,) of links, bar and crank in the strain energy of each reading."""
    budget = compliance_budget(variant.model, used.q, used.wrench, loaded_points(variant.model, used))
    return budget.of_kind("link") + budget.of_kind("parallelogram")


def _spring_pairs(own: Calibrated, other: Calibrated) -> tuple[SpringPair, ...]:
    if not own.found.studies:
        springs = zip(own.springs, other.springs, strict=True)
        return tuple(SpringPair(a.parameter.place, _of_estimate(a), _of_estimate(b)) for a, b in springs)
    return tuple(
        SpringPair(joint, _of_fit(a, k), _of_fit(b, k), (mine.stage.name, a.pose))
        for mine, theirs in zip(own.found.studies, other.found.studies, strict=True)
        for a, b in zip(mine.fits, theirs.fits, strict=True)
        for k, joint in enumerate(a.joints)
    )


def _of_estimate(spring: ParameterEstimate) -> tuple[float, float, float]:
    value = float("nan") if spring.status == "not identified" else spring.value
    return (value, *spring.interval)


def _of_fit(fit: PoseFit, k: int) -> tuple[float, float, float]:
    low, high = (float(v) for v in fit.equivalent[k])
    return float(fit.stiffness[k]), low, high
