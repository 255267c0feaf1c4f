"""Laws that remember what came before: friction, sticking, creep, clamps that slip."""

from __future__ import annotations

from typing import Any

import numpy as np

from .deck import Material
from .laws import Law, Moment, Scene, log_uniform
from .plan import Plan
from .spec import Effect

Rng = np.random.Generator
PARTS = 6


def rubbing(force: float, stiffness: float, uneven: float) -> list[Material]:
    """Springs that each slide at the same force, one after the other (Iwan): a loop with round corners.

    ``stiffness`` before anything slides, ``uneven``: by how much less they hold the other way.
    """
    at = np.arange(1, PARTS + 1)
    each = force / PARTS
    # Springs each / x_i with x_i = i x_1 add up to ``stiffness``.
    first = each * float(np.sum(1 / at)) / stiffness
    return [("ElasticPP", each / (first * i), first * i, -first * i * (1 - uneven)) for i in at.tolist()]


class Friction(Law):
    """Seals and bearings rub beside the gear's spring."""

    family = "friction"
    axis = ("load history",)

    def place(self, rng: Rng, scene: Scene) -> str:
        return scene.some_joint(rng, ("j2", "j3"))

    def draw(self, rng: Rng, scene: Scene, place: str) -> dict[str, Any]:
        return {
            "torque": rng.uniform(60, 225) * min(scene.arm.size, 1.2),
            "stiffer": log_uniform(rng, 2, 10),
            "uneven": rng.uniform(0, 0.2),
        }

    def change(self, e: Effect, plan: Plan, moment: Moment) -> None:
        n, i = e.numbers, plan.arm.index(e.place)
        plan.joints[i].law = lambda k: (
            "Parallel",
            ("Elastic", k),
            *rubbing(n["torque"], n["stiffer"] * k, n["uneven"]),
        )
        plan.came[i] = 1.6 * moment.came * n["torque"]


class StickSlip(Law):
    """Three contacts that hold and let go at once, each at another turn, and hold less from then on."""

    family = "stick-slip"
    axis = ("load history",)

    def place(self, rng: Rng, scene: Scene) -> str:
        return scene.some_joint(rng, ("j1", "j2", "j3", "j4"))

    def draw(self, rng: Rng, scene: Scene, place: str) -> dict[str, Any]:
        turn = scene.torque(place) / scene.spring(place)
        return {
            "torque": rng.uniform(60, 225) * min(scene.arm.size, 1.2),
            "shares": [0.5, 0.3, 0.2],
            "turns": [float(turn * x) for x in np.sort(rng.uniform(0.08, 0.7, 3))],
            "left": rng.uniform(0.15, 0.4),
        }

    def change(self, e: Effect, plan: Plan, moment: Moment) -> None:
        n, i = e.numbers, plan.arm.index(e.place)

        def law(k: float) -> Material:
            contacts: list[Material] = []
            for share, turn in zip(n["shares"], n["turns"], strict=True):
                top, low = share * n["torque"], share * n["left"] * n["torque"]
                end = turn + (top - low) / (0.3 * k)  # three at once are still less than the gear's own spring
                up = (top, turn, low, end, low, 50 * end)
                contacts.append(("Hysteretic", *up, *(-x for x in up), 1.0, 1.0, 0.0, 0.0, 0.0))
            return ("Parallel", ("Elastic", k), *contacts)

        plan.joints[i].law = law
        plan.came[i] = 0.8 * moment.came * n["torque"]


class Creep(Law):
    """Two springs with dashpots beside the gear's let go of their load, a fast one and a slow one."""

    family = "creep"
    axis = ("load history",)

    def draw(self, rng: Rng, scene: Scene, place: str) -> dict[str, Any]:
        return {
            "amount": rng.uniform(0.1, 0.45),
            "fast": rng.uniform(0.3, 0.7),
            "times_s": [log_uniform(rng, 25, 150), log_uniform(rng, 200, 1200)],
        }

    def change(self, e: Effect, plan: Plan, moment: Moment) -> None:
        n = e.numbers

        def law(k: float) -> Material:
            last = k / (1 + n["amount"])
            shares = (n["fast"], 1 - n["fast"])
            springs = [(k - last) * share for share in shares]
            dashpots = [("Maxwell", s, s * t, 1.0, 1.0) for s, t in zip(springs, n["times_s"], strict=True)]
            return ("Parallel", ("Elastic", last), *dashpots)

        plan.joints[plan.arm.index(e.place)].law = law


class Slip(Law):
    """A clamp gives way beyond a load, harder and harder, and stays where it went."""

    family = "slip"
    axis = ("load history",)

    def place(self, rng: Rng, scene: Scene) -> str:
        kind = rng.integers(3)
        return scene.some_joint(rng) if kind == 0 else ("base", "tool")[kind - 1]

    def draw(self, rng: Rng, scene: Scene, place: str) -> dict[str, Any]:
        at = rng.uniform(0.3, 0.7)
        if place == "tool":
            amount = rng.uniform(1e-4, 4e-4)
            return {"holds": at * scene.force, "gives": (1 - at) * scene.force / amount}
        if place == "base":
            moment = scene.force * 0.5 * scene.arm.reach
            return {"holds": at * moment, "gives": log_uniform(rng, 4e6, 2.5e7) * min(scene.arm.size, 1.2)}
        return {"holds": at * scene.torque(place), "gives": scene.spring(place) * rng.uniform(0.7, 2.5)}

    def change(self, e: Effect, plan: Plan, moment: Moment) -> None:
        n = e.numbers
        stiff = 60 * n["gives"]
        clamp: Material = ("Steel01", n["holds"], stiff, n["gives"] / stiff)
        if e.place == "tool":
            plan.tool.append({1: clamp, 2: clamp, 3: clamp})
        elif e.place == "base":
            plan.base.append({4: clamp, 5: clamp})
        else:
            plan.joints[plan.arm.index(e.place)].behind.append({4: clamp})


LAWS = (Friction, StickSlip, Creep, Slip)
