"""Laws of joints that go by the pose, the load or the clock, but not by what came before."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .deck import Deck, Material
from .laws import Law, Moment, Scene, log_uniform, sign
from .plan import Nodes, Plan
from .spec import Effect

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

    axis = ("load",)

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
    axis = ("load",)

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
    axis = ("clock",)
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


LAWS = (
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
