"""An arm: its description, its kinematics and its mechanics in one object, as every step takes it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

from fem.effects import Maker, PlacedEffect, build_arm, reading_effects
from fem.effects.secant import StatedLoad, plain, with_secants
from fem.model import ArmModel, LinkKind
from robots import LoadPath, ModelDescription, Robot
from robots.joint_errors import designed
from robots.robot import as_designed, robot_from
from robots.schema.description import FlangeCoupling


@dataclass(frozen=True)
class Arm:
    """A robot arm ready to be loaded: what its file says, its kinematics, its mechanics, and its effects.

    ``model`` has the description's effects of stage "model"; ``effects``: the others, on loads, parts and readings;
    ``own``: laws of the user's own effects; ``source``: the name or file of the model that it was read from.
    """

    description: ModelDescription
    robot: Robot
    model: ArmModel
    effects: tuple[PlacedEffect, ...] = ()
    own: tuple[Maker, ...] = ()
    source: str = ""

    def at_load(self, load: StatedLoad) -> Self:
        """The arm whose model has its effects at a stated load (:func:`fem.effects.secant.with_secants`).

        Whatever is said in N/mm is asked of this one. Itself where no effect is the arm's own.
        """
        model = with_secants(self.model, self.effects, load)
        return self if model is self.model else replace(self, model=model)

    @classmethod
    def of(
        cls,
        description: ModelDescription,
        links: LinkKind = "beam",
        load_path: LoadPath | None = None,
        own: Sequence[Maker] = (),
    ) -> Arm:
        """Build the arm of a description; ``load_path`` None: the description's.

        Raises
        ------
        InputError
            An effect that this arm cannot have, or numbers that do not fit it.
        """
        model = build_arm(description, links, load_path, own=own)
        return cls(description, robot_from(description), model, reading_effects(description, model, own), tuple(own))

    @property
    def joints_without_springs(self) -> tuple[str, ...]:
        """Joints that do not give way about their axes; in a bundled robot those that nobody has calibrated."""
        here = self.robot.limits.mean(axis=1)[None]
        return tuple(joint.name for joint in self.model.joints if not joint.axial.compliance(here).any())

    @property
    def as_designed(self) -> Self:
        """The arm without errors of zeros and geometry, as its controller has it: what angles of programs belong to."""
        if self.robot.errors is None:
            return self
        description = designed(self.description)
        changed = replace(self, description=description, robot=as_designed(self.robot))
        return changed._with(plain(self.model).as_designed)

    def with_load_path(self, load_path: LoadPath) -> Arm:
        """The same arm with another load path."""
        model = plain(self.model)
        if load_path == model.load_path:
            return self
        if load_path == "serial":
            # The links are the same, and building shells again would take its time.
            return self._with(replace(model, load_path="serial", bar=None))
        return self._with(build_arm(self.description, model.link_kind, load_path, own=self.own))

    def with_links(self, links: LinkKind) -> Arm:
        """The same arm with another kind of links."""
        return self._with(build_arm(self.description, links, self.model.load_path, own=self.own))

    def _with(self, model: ArmModel) -> Self:
        """The arm with another model, at the load that this one's is stated at."""
        secants = self.model.secants
        changed = replace(self, model=model)
        return changed if secants is None else changed.at_load(secants.load)


def with_flanges(description: ModelDescription, coupling: FlangeCoupling) -> ModelDescription:
    """The description with all flanges, the crank's too, coupled in one way."""
    p = description.parallelogram
    links = []
    for link in description.link:
        names = ("root", "tip", "pin") if p is not None and link.body == p.driven else ("root", "tip")
        links.append(link.model_copy(update={"flanges": dict.fromkeys(names, coupling)}))
    crank = None if p is None else p.model_copy(update={"crank_flanges": coupling})
    return description.model_copy(update={"link": tuple(links), "parallelogram": crank})
