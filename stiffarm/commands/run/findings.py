"""Everything that a run of the whole chain found, for its report."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from doe import Measurements, PoseEffects
from doe.estimation.campaign import Campaign
from fem.arm import Arm
from robots.arrays import Array
from stiffarm.commands.calibrate.step import Calibrated
from stiffarm.commands.run.held_out import HeldOut
from stiffarm.commands.run.link_models import LinkModels
from stiffarm.session.steps import FactorialRuns, RigidJoints
from surrogate import Surrogate, Trained


@dataclass(frozen=True)
class Findings:
    """Everything the report tells, computed once."""

    given: Arm
    data: Measurements
    scheme: Campaign
    rigid: RigidJoints
    effects: Mapping[str, list[PoseEffects]]
    link_models: LinkModels
    best: Calibrated
    published: Calibrated
    factorial: Mapping[str, FactorialRuns]
    trained: Mapping[str, Trained]
    budget_mm: Mapping[str, Array]
    budget_poses: tuple[str, ...]
    pose_check: tuple[list[str], Array, Array]
    seed: int
    held_out: HeldOut | None = None

    @property
    def variants(self) -> tuple[Calibrated, ...]:
        """Every load path and scheme, with the links that were asked for."""
        return self.link_models.own.variants

    @property
    def surrogate(self) -> Surrogate:
        """The surrogate of the recommended variant."""
        return self.trained[self.best.name].best


def slug(name: str) -> str:
    """``constant, serial`` -> ``constant_serial``."""
    return "_".join(name.replace(",", " ").split())
