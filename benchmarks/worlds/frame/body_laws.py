"""Laws of what stands between the joints: the base, links, the parallelogram, the tool."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from .arms import GRAVITY
from .deck import STIFF, Deck, Material
from .laws import Law, Moment, Scene, log_uniform
from .plan import Plan, X, Y
from .spec import Effect

Rng = np.random.Generator


class AtBase(Law):
    """The base, of which there is one."""

    bare = True
    spot = "base"


class BaseTilt(AtBase):
    """A floor that gives way more one way than the other."""

    family = "base-tilt"

    def draw(self, rng: Rng, scene: Scene, place: str) -> dict[str, Any]:
        k = log_uniform(rng, 2e6, 4e7) * min(scene.arm.size, 1.2)
        return {"about_x": k, "about_y": k * log_uniform(rng, 0.6, 1.7)}

    def change(self, e: Effect, plan: Plan, moment: Moment) -> None:
        plan.base.append({4: ("Elastic", e.numbers["about_x"]), 5: ("Elastic", e.numbers["about_y"])})


class BaseVertical(AtBase):
    """Levelling feet: the base sinks and comes up."""

    family = "base-vertical"

    def draw(self, rng: Rng, scene: Scene, place: str) -> dict[str, Any]:
        return {"stiffness": log_uniform(rng, 2e6, 2e7) * min(scene.arm.size, 1.2), "other_way": rng.uniform(0.8, 1.2)}

    def change(self, e: Effect, plan: Plan, moment: Moment) -> None:
        k = e.numbers["stiffness"]
        plan.base.append({3: ("Elastic", k, 0.0, k * e.numbers["other_way"])})


class LooseBase(AtBase):
    """Four feet that press but do not pull, each with a bolt that does, weakly: beyond a moment one side lifts."""

    family = "loose-base"
    axis = ("load",)

    def draw(self, rng: Rng, scene: Scene, place: str) -> dict[str, Any]:
        arm = scene.arm
        out = rng.uniform(0.22, 0.4)
        bolt = log_uniform(rng, 3e6, 2e7) * min(arm.size, 1.2) / (2 * out**2)
        mass = sum(arm.masses.values())
        lifts = 0.25 * arm.reach * mass * GRAVITY + rng.uniform(0.1, 0.5) * scene.force * 0.5 * arm.reach
        return {
            "out_m": out,
            "bolt": bolt,
            "foot": bolt * rng.uniform(8, 25),
            "press": max(0.0, lifts / out - mass * GRAVITY),
        }

    def change(self, e: Effect, plan: Plan, moment: Moment) -> None:
        n = e.numbers
        plan.press += n["press"]

        def mount(deck: Deck, ground: int) -> int:
            base = deck.node(deck.at(ground))
            stiff: Material = ("Elastic", STIFF)
            deck.spring(ground, base, {1: stiff, 2: stiff, 6: stiff}, X, Y)
            for x, y in ((1, 1), (1, -1), (-1, 1), (-1, -1)):
                at = deck.at(ground) + n["out_m"] * np.array([x, y, 0])
                foot, floor = deck.reach(base, at), deck.node(at)
                deck.fix(floor)
                deck.spring(floor, foot, {3: ("Parallel", ("ENT", n["foot"]), ("Elastic", n["bolt"]))}, X, Y)
            return base

        plan.mount = mount


class ToolCompliance(Law):
    """A tool changer that gives way across the tool, not alike both ways."""

    family = "tool-compliance"
    bare = True
    spot = "tool"

    def draw(self, rng: Rng, scene: Scene, place: str) -> dict[str, Any]:
        c = rng.uniform(1.5e-7, 6e-7)
        return {"along_x": 1 / c, "along_y": rng.uniform(0.7, 1.4) / c}

    def change(self, e: Effect, plan: Plan, moment: Moment) -> None:
        plan.tool.append({1: ("Elastic", e.numbers["along_x"]), 2: ("Elastic", e.numbers["along_y"])})


class LinkFlexibility(Law):
    """A casing of walls thinner than drawn, as an elastic beam."""

    family = "link-flexibility"
    arms = ("xr701", "kr60-3", "tx200", "crane6", "reed7")

    def place(self, rng: Rng, scene: Scene) -> str:
        return str(rng.choice([link.name for link in scene.arm.links if link.body not in ("base", "j6", "j7")]))

    def draw(self, rng: Rng, scene: Scene, place: str) -> dict[str, Any]:
        return {"softer": log_uniform(rng, 2, 7)}

    def change(self, e: Effect, plan: Plan, moment: Moment) -> None:
        link = next(link for link in plan.arm.links if link.name == e.place)
        body = 0 if link.body == "base" else plan.arm.index(link.body) + 1
        s, by = link.section, e.numbers["softer"]
        plan.beams[body] = replace(s, area=s.area / by, inertia=s.inertia / by, torsion=s.torsion / by)


class ByParallelogram(Law):
    """Of the arm that has one."""

    arms = ("xr701",)
    bare = True
    spot = "j3"


class Bar(ByParallelogram):
    """The bar and its pins give way along the bar."""

    family = "parallelogram-bar"
    path = "parallelogram"

    def draw(self, rng: Rng, scene: Scene, place: str) -> dict[str, Any]:
        return {"stiffness": log_uniform(rng, 2, 15) * scene.spring("j3") / 0.4**2}

    def change(self, e: Effect, plan: Plan, moment: Moment) -> None:
        plan.bar = e.numbers["stiffness"]


class LoadPath(ByParallelogram):
    """The model takes for a serial arm what has a parallelogram."""

    family = "load-path"

    def draw(self, rng: Rng, scene: Scene, place: str) -> dict[str, Any]:
        return {"bar": log_uniform(rng, 3e8, 3e9)}

    def change(self, e: Effect, plan: Plan, moment: Moment) -> None:
        plan.path, plan.bar = "parallelogram", e.numbers["bar"]


class PartialLoadPath(ByParallelogram):
    """A brake holds the elbow too: the forearm's moment divides by the stiffnesses of both ways."""

    family = "partial-load-path"

    def draw(self, rng: Rng, scene: Scene, place: str) -> dict[str, Any]:
        return {"share": rng.uniform(0.25, 0.75), "bar": log_uniform(rng, 3e8, 3e9)}

    def change(self, e: Effect, plan: Plan, moment: Moment) -> None:
        plan.path, plan.bar, plan.share = "parallelogram", e.numbers["bar"], e.numbers["share"]


LAWS = (BaseTilt, BaseVertical, LooseBase, ToolCompliance, LinkFlexibility, Bar, LoadPath, PartialLoadPath)
