"""Everything that a run of the whole chain found, for its report."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from doe import Measurements, PoseEffects
from doe.estimation.campaign import Campaign
from fem.arm import Arm
from robots.arrays import Array
from stiffarm.commands.calibrate.prediction import Holdout
from stiffarm.commands.calibrate.step import Calibrated
from stiffarm.commands.run import held_out
from stiffarm.commands.run.link_models import LinkModels
from stiffarm.session.steps import FactorialRuns, RigidJoints, bundled_sha256
from surrogate import Surrogate, Trained


@dataclass(frozen=True)
class Findings:
    """Everything the report tells, computed once; ``used``: the readings of the scheme's loads."""

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
    used: Measurements
    pose_check: tuple[list[str], Array, Array]
    seed: int

    @property
    def variants(self) -> tuple[Calibrated, ...]:
        """Every load path and scheme, with the links that were asked for."""
        return self.link_models.own.variants

    @property
    def held_out(self) -> dict[str, Holdout]:
        """What each variant makes of the readings held out, if any were."""
        return held_out.of_variants(self.variants)

    @property
    def constant(self) -> Calibrated:
        """The recommended variant, or the first with constant springs."""
        return next(v for v in (self.best, *self.variants) if not v.found.studies)

    @property
    def is_published(self) -> bool:
        """Whether this is the bundled data set, of which the paper's own remarks and doubts hold."""
        return self.data.sha256 == bundled_sha256(self.given.robot.name)

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
    return "_".join(name.replace(",", " ").split())
