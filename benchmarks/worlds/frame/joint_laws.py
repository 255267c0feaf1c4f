"""Laws of joints and of what stands between them: by pose, load and clock, and those that remember."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..shared import Effect, log_uniform, sign
from .arm import GRAVITY, STIFF, Deck, Material
from .plan import Law, Moment, Nodes, Plan, Scene, X, Y

Array = NDArray[np.float64]
HUGE = 1e12
Rng = np.random.Generator


class Compliance(Law):
    """A joint that the model holds rigid; a little stiffer one way than the other."""

    family = "joint-compliance"

    def draw(self, rng: Rng, scene: Scene, place: str) -> dict[str, Any]:
        usual = scene.spring(place)
        k = float(np.clip(log_uniform(rng, 5e4, 2e6), 0.4 * usual, 1.6 * usual))
        return {"stiffness": k, "other_way": rng.uniform(0.93, 1.07)}

    def rigid(self, place: str) -> tuple[str, ...]:
        return (place,)

    def change(self, e: Effect, plan: Plan, moment: Moment) -> None:
        k = e.numbers["stiffness"]
        plan.joints[plan.arm.index(e.place)].law = lambda _: ("Elastic", k, 0.0, k * e.numbers["other_way"])


class Tilt(Law):
    """Bearings give way across the axis, not alike in both directions."""

    family = "joint-tilt"

    def draw(self, rng: Rng, scene: Scene, place: str) -> dict[str, Any]:
        k = log_uniform(rng, 5e5, 5e6) * min(scene.arm.size, 1.2)
        return {"about_y": k, "about_z": k * rng.uniform(0.6, 1.6)}

    def change(self, e: Effect, plan: Plan, moment: Moment) -> None:
        joint = plan.joints[plan.arm.index(e.place)]
        joint.bearing |= {5: ("Elastic", e.numbers["about_y"]), 6: ("Elastic", e.numbers["about_z"])}


class ByAngle(Law):
    """Softer around one angle: a bump of von Mises' shape."""

    family = "angle-dependent-stiffness"

    def draw(self, rng: Rng, scene: Scene, place: str) -> dict[str, Any]:
        return {
            "amount": rng.uniform(0.1, 0.45) * sign(rng),
            "at_rad": rng.uniform(-np.pi, np.pi),
            "narrow": rng.uniform(0.8, 3.0),
        }

    def change(self, e: Effect, plan: Plan, moment: Moment) -> None:
        i, n = plan.arm.index(e.place), e.numbers
        bump = np.exp(n["narrow"] * (np.cos(plan.turn[i] - n["at_rad"]) - 1))
        plan.joints[i].stiffness /= 1 + n["amount"] * (2 * bump - 1)


class Ripple(Law):
    """Teeth: compliance goes up and down many times a turn, with a sharp and a blunt side."""

    family = "gear-ripple"

    def draw(self, rng: Rng, scene: Scene, place: str) -> dict[str, Any]:
        return {
            "amount": rng.uniform(0.08, 0.3),
            "teeth": int(rng.integers(12, 45)),
            "phase": rng.uniform(0, 2 * np.pi),
            "lean": rng.uniform(-0.4, 0.4),
        }

    def change(self, e: Effect, plan: Plan, moment: Moment) -> None:
        i, n = plan.arm.index(e.place), e.numbers
        x = n["teeth"] * plan.turn[i] + n["phase"]
        plan.joints[i].stiffness /= 1 + n["amount"] * np.sin(x + n["lean"] * np.sin(x))


class Compensator(Law):
    """A gas spring from the carousel to the upper arm: a bar pinned at both, with its lever's square."""

    family = "gravity-compensator"
    spot = "j2"

    def draw(self, rng: Rng, scene: Scene, place: str) -> dict[str, Any]:
        return {
            "share": rng.uniform(0.1, 0.4),
            "behind_m": rng.uniform(0.3, 0.45),
            "above_m": rng.uniform(0.18, 0.3),
            "at_rad": rng.uniform(-np.pi, np.pi),
        }

    def change(self, e: Effect, plan: Plan, moment: Moment) -> None:
        n, s = e.numbers, plan.stand
        # At its longest lever it is the shorter arm's length away from the axis.
        stiffness = n["share"] * plan.joints[1].stiffness / n["above_m"] ** 2

        def add(deck: Deck, nodes: Nodes) -> None:
            about, across = s.axes[1], s.across[1]
            beside = np.cross(about, across)
            fixed = np.cos(n["at_rad"]) * across + np.sin(n["at_rad"]) * beside
            moving = s.turned[1] @ np.cross(plan.arm.about[1], [0.31, 0.83, 0.47])
            moving /= np.linalg.norm(moving)
            i = deck.reach(nodes.before[1], s.origins[1] + n["behind_m"] * fixed)
            j = deck.reach(nodes.after[1], s.origins[1] + n["above_m"] * moving)
            deck.bar(i, j, stiffness)

        plan.beside.append(add)


def table(torques: Array, turns: Array) -> Material:
    """An elastic law through points, first and third quadrant each as given; both rising from 0."""
    return ("ElasticMultiLinear", 0.0, "-strain", *map(float, turns), "-stress", *map(float, torques))


class Bent(Law):
    """A law of torque against turn as a table, another one each way."""

    axes = ("load",)

    def curve(self, n: dict[str, Any], x: Array) -> Array:
        """Turn over that of a plain spring's at the torque 1, for torques of x > 0."""
        raise NotImplementedError

    def draw(self, rng: Rng, scene: Scene, place: str) -> dict[str, Any]:
        raise NotImplementedError

    def change(self, e: Effect, plan: Plan, moment: Moment) -> None:
        n = e.numbers
        x = np.geomspace(0.02, 60, 60)

        def law(k: float) -> Material:
            low, high = (n["torque"] * n[way] for way in ("minus", "plus"))
            turns = self.curve(n, x) / k
            return table(
                np.concatenate([-low * x[::-1], [0], high * x]), np.concatenate([-low * turns[::-1], [0], high * turns])
            )

        plan.joints[plan.arm.index(e.place)].law = law


class Hardening(Bent):
    """Teeth come to bear one after the other: turn = t0/k asinh(torque/t0)."""

    family = "hardening"

    def draw(self, rng: Rng, scene: Scene, place: str) -> dict[str, Any]:
        low, high = rng.uniform(0.8, 1.25, 2)
        return {"torque": rng.uniform(0.2, 0.6) * scene.torque(place), "minus": low, "plus": high}

    def curve(self, n: dict[str, Any], x: Array) -> Array:
        return np.arcsinh(x)


class Softening(Bent):
    """Turn grows faster than torque, by a power of its own, and levels off far beyond."""

    family = "softening"

    def draw(self, rng: Rng, scene: Scene, place: str) -> dict[str, Any]:
        low, high = rng.uniform(0.8, 1.25, 2)
        return {
            "torque": scene.torque(place),
            "minus": low,
            "plus": high,
            "amount": rng.uniform(0.2, 0.7),
            "power": rng.uniform(1.3, 2.8),
        }

    def curve(self, n: dict[str, Any], x: Array) -> Array:
        return x * (1 + n["amount"] * x ** n["power"] / (1 + (x / 2.5) ** n["power"]))


class Backlash(Law):
    """Two flanks that do not close at once; where between them the arm hangs is chance."""

    family = "backlash"
    axes = ("load",)

    def draw(self, rng: Rng, scene: Scene, place: str) -> dict[str, Any]:
        return {"gap": rng.uniform(3e-4, 9e-4), "hangs": rng.uniform(0.2, 0.8), "uneven": rng.uniform(0.05, 0.3)}

    def change(self, e: Effect, plan: Plan, moment: Moment) -> None:
        n = e.numbers

        def law(k: float) -> Material:
            flanks: list[Material] = [("Elastic", 0.02 * k)]
            for part in (1 - n["uneven"], 1 + n["uneven"]):
                plus, minus = n["gap"] * (1 - n["hangs"]) * part, n["gap"] * n["hangs"] * part
                flanks += [("ElasticPPGap", 0.49 * k, HUGE, plus), ("ElasticPPGap", 0.49 * k, -HUGE, -minus)]
            return ("Parallel", *flanks)

        plan.joints[plan.arm.index(e.place)].law = law


class Warming(Law):
    """Softer the longer the session lasts: t^p over t^p + T^p."""

    family = "warming"
    axes = ("clock",)
    by_clock = True

    def draw(self, rng: Rng, scene: Scene, place: str) -> dict[str, Any]:
        return {
            "amount": rng.uniform(0.12, 0.45),
            "time_s": rng.uniform(0.15, 0.6) * scene.duration_s,
            "power": rng.uniform(0.9, 1.8),
        }

    def change(self, e: Effect, plan: Plan, moment: Moment) -> None:
        n = e.numbers
        t = (moment.since_s / n["time_s"]) ** n["power"]
        plan.joints[plan.arm.index(e.place)].stiffness /= 1 + n["amount"] * t / (1 + t)


class WristCoupling(Law):
    """A bevel gear: a spring about a line between the fourth and the fifth axis, beside weaker ones about each."""

    family = "wrist-coupling"
    bare = True

    def place(self, rng: Rng, scene: Scene) -> str:
        return scene.arm.joints[-2]

    def draw(self, rng: Rng, scene: Scene, place: str) -> dict[str, Any]:
        return {"share": rng.uniform(0.2, 0.6) * sign(rng)}

    def change(self, e: Effect, plan: Plan, moment: Moment) -> None:
        i = len(plan.joints) - 3
        one, two, s = plan.joints[i], plan.joints[i + 1], plan.stand
        c = np.array([1 / one.stiffness, 1 / two.stiffness])
        cross = e.numbers["share"] * np.sqrt(c[0] * c[1])
        K = np.linalg.inv(np.array([[c[0], cross], [cross, c[1]]]))
        ratio = -np.sign(cross) * np.sqrt(K[1, 1] / K[0, 0])
        line = abs(K[0, 1]) / abs(ratio)
        one.stiffness, two.stiffness = K[0, 0] - line, K[1, 1] - ratio**2 * line

        def add(deck: Deck, nodes: Nodes) -> None:
            way = s.axes[i] + ratio * s.axes[i + 1]
            size = float(np.linalg.norm(way))
            beside = np.cross(s.axes[i], s.axes[i + 1])
            # The turn about a line is way/|way| . (turns), so its spring is |way|^2 as stiff as that of their sum.
            deck.spring(nodes.before[i], nodes.after[i + 1], {4: ("Elastic", line * size**2)}, way / size, beside)

        plan.beside.append(add)


class CablePackage(Law):
    """Cables from the forearm to the flange: the further the wrist is wound up, the more they hold, all ways."""

    family = "cable-package"
    bare = True

    def place(self, rng: Rng, scene: Scene) -> str:
        return scene.arm.joints[-3]

    def draw(self, rng: Rng, scene: Scene, place: str) -> dict[str, Any]:
        return {"share": rng.uniform(0.3, 1.2), "power": rng.uniform(1.2, 2.6)}

    def change(self, e: Effect, plan: Plan, moment: Moment) -> None:
        n, s, i = e.numbers, plan.stand, len(plan.joints) - 3
        wound = abs(plan.turn[i]) + 0.5 * abs(plan.turn[-1])
        k = n["share"] * plan.joints[i].stiffness * (wound / np.pi) ** n["power"]

        def add(deck: Deck, nodes: Nodes) -> None:
            twist: Material = ("Elastic", k + 1.0)
            bend: Material = ("Elastic", 0.4 * k + 1.0)
            materials = {4: twist, 5: bend, 6: bend}
            deck.spring(nodes.before[i], nodes.after[-1], materials, s.axes[i], s.across[i])

        plan.beside.append(add)


JOINT_LAWS = (
    Compliance,
    Tilt,
    ByAngle,
    Ripple,
    Compensator,
    Hardening,
    Softening,
    Backlash,
    Warming,
    WristCoupling,
    CablePackage,
)


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
    axes = ("load",)

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


BODY_LAWS = (BaseTilt, BaseVertical, LooseBase, ToolCompliance, LinkFlexibility, Bar, LoadPath, PartialLoadPath)


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
    axes = ("load history",)

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
    axes = ("load history",)

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
    axes = ("load history",)

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
    axes = ("load history",)

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


HISTORY_LAWS = (Friction, StickSlip, Creep, Slip)
