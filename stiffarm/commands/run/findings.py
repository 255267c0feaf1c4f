"""Everything that a run of the whole chain found, for its report."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from doe import Measurements, PoseEffects
from doe.calibration.prediction import Holdout
from doe.estimation.campaign import Campaign
from doe.tables.notes import ReadingNotes, bundled_notes
from fem import ArmModel
from fem.arm import Arm
from robots import ModelDescription, Remark
from robots.arrays import Array
from stiffarm.commands.calibrate.step import Calibrated
from stiffarm.commands.run import held_out
from stiffarm.commands.run.link_models import LinkCalibrations, LinkModels
from stiffarm.commands.run.missing import Look
from stiffarm.session.caution import caveats
from stiffarm.session.steps import FactorialRuns, RigidJoints, is_bundled
from surrogate import Surrogate, Trained


@dataclass(frozen=True)
class Recommended:
    """The model that predicts poses best that it has not seen: a calibrated variant, or a diagnosed model.

    ``count``: readings behind ``rms_mm``; ``calibrated``: None of a diagnosed model; ``held_out_rms_mm``: of readings
    held out, None without any. Of a diagnosed model ``left_out_rms_mm`` is that of effects chosen anew without the
    poses, where there is such a figure.
    """

    name: str
    description: ModelDescription
    model: ArmModel
    rms_mm: float
    left_out_rms_mm: float
    count: int
    calibrated: Calibrated | None = None
    held_out_rms_mm: float | None = None

    @property
    def depends_on_angles(self) -> bool:
        """Whether its springs were found pose by pose."""
        return self.calibrated is not None and bool(self.calibrated.found.studies)

    @property
    def beside_variants_mm(self) -> dict[str, float]:
        """Its error on readings held out, by its name, where it is no variant."""
        is_other = self.calibrated is None and self.held_out_rms_mm is not None
        return {self.name: float(self.held_out_rms_mm or 0.0)} if is_other else {}


@dataclass(frozen=True)
class Findings:
    """Everything the report tells, computed once; ``used``: the readings of the scheme's loads.

    ``looks``: diagnoses, the last one on all readings; ``rigid`` and ``link_models``: None for an arm without links;
    ``published``: the published scheme's variant, None without one.
    """

    given: Arm
    data: Measurements
    scheme: Campaign
    looks: tuple[Look, ...]
    rigid: RigidJoints | None
    effects: Mapping[str, list[PoseEffects]]
    own: LinkCalibrations
    link_models: LinkModels | None
    best: Recommended
    published: Calibrated | None
    used: Measurements
    seed: int
    factorial: Mapping[str, FactorialRuns] = field(default_factory=dict)
    trained: Mapping[str, Trained] = field(default_factory=dict)
    pose_check: tuple[list[str], Array, Array] = ([], np.zeros(0), np.zeros(0))

    @property
    def variants(self) -> tuple[Calibrated, ...]:
        """Every load path and scheme, with the links that were asked for."""
        return self.own.variants

    @property
    def best_variant(self) -> Calibrated:
        """The calibrated variant that predicts poses best that it has not seen."""
        return min(self.variants, key=lambda v: v.left_out_rms_mm if np.isfinite(v.left_out_rms_mm) else np.inf)

    @property
    def held_out(self) -> dict[str, Holdout]:
        """What each variant makes of the readings held out, if any were."""
        return held_out.of_variants(self.variants)

    @property
    def constant(self) -> Calibrated:
        """The recommended variant, or the first with constant springs."""
        best = self.best.calibrated
        return next(v for v in (*([] if best is None else [best]), *self.variants) if not v.found.studies)

    @property
    def notes(self) -> ReadingNotes:
        """What is known of bundled readings of a published scheme; nothing of others."""
        bundled = self.published is not None and is_bundled(self.given.robot, self.data)
        return bundled_notes(self.given.robot.name) if bundled else ReadingNotes()

    @property
    def rigid_warning(self) -> Remark:
        """What must be said of the recommended model's stiffness: joints held rigid, the load that it holds at."""
        return caveats(replace(self.given, description=self.best.description, model=self.best.model))

    @property
    def title(self) -> str:
        """The robot's title without what stands in brackets."""
        return self.given.description.title.split(" (")[0]

    @property
    def surrogate(self) -> Surrogate:
        """The surrogate of the recommended variant."""
        return self.trained[self.best.name].best


def slug(name: str) -> str:
    """``constant, serial`` -> ``constant_serial``."""
    return re.sub(r"[^A-Za-z0-9]+", "_", name).strip("_")
