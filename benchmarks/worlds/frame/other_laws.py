"""Laws of the set-up and the gauge, strange laws, and all laws by their families."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..shared import Effect, direction, log_uniform, sign
from .arm import Arm, Deck, Material, Row, rotation
from .joint_laws import BODY_LAWS, HISTORY_LAWS, HUGE, JOINT_LAWS, AtBase, rubbing, table
from .plan import Law, Moment, Nodes, Plan, Scene

Array = NDArray[np.float64]
Rng = np.random.Generator


class AtLoad(Law):
    """Of the load, of which there is one."""

    bare = True
    spot = "load"


class Payload(AtLoad):
    """A hook and a basket that nobody weighed, or a rope that takes some of the weight."""

    family = "payload"
    axes = ("load",)

    def draw(self, rng: Rng, scene: Scene, place: str) -> dict[str, Any]:
        return {"force": rng.uniform(20, 60) * scene.arm.payload / 1300 * sign(rng)}

    def pull(self, e: Effect, row: Row, force: Array, load_at: Array, read_at: Array) -> tuple[Array, Array, Array]:
        size = float(np.linalg.norm(force))
        return force * (1 + e.numbers["force"] / size), load_at, read_at


class LoadPoint(AtLoad):
    """The load hangs beside the point, the gauge stands at it."""

    family = "load-point-offset"

    def draw(self, rng: Rng, scene: Scene, place: str) -> dict[str, Any]:
        return {"by_m": [rng.uniform(0.015, 0.045) * x for x in direction(rng)]}

    def pull(self, e: Effect, row: Row, force: Array, load_at: Array, read_at: Array) -> tuple[Array, Array, Array]:
        return force, load_at + np.array(e.numbers["by_m"]), read_at


class ToolPoint(LoadPoint):
    """Load and gauge are both beside the point."""

    family = "tool-point-offset"
    spot = "tool"

    def draw(self, rng: Rng, scene: Scene, place: str) -> dict[str, Any]:
        return {"by_m": [rng.uniform(0.02, 0.06) * x for x in direction(rng)]}

    def pull(self, e: Effect, row: Row, force: Array, load_at: Array, read_at: Array) -> tuple[Array, Array, Array]:
        by = np.array(e.numbers["by_m"])
        return force, load_at + by, read_at + by


class Misalignment(AtLoad):
    """The rope leans, always to the same side of the hall."""

    family = "load-misalignment"

    def draw(self, rng: Rng, scene: Scene, place: str) -> dict[str, Any]:
        return {"deg": rng.uniform(1.5, 4.5), "about": direction(rng, flat=True)}

    def pull(self, e: Effect, row: Row, force: Array, load_at: Array, read_at: Array) -> tuple[Array, Array, Array]:
        lean = rotation(np.array(e.numbers["about"]), np.radians(e.numbers["deg"]))
        return lean @ force, load_at, read_at


class JointZero(Law):
    """A joint stands elsewhere than its encoder says."""

    family = "joint-zero-offset"

    def draw(self, rng: Rng, scene: Scene, place: str) -> dict[str, Any]:
        return {"deg": log_uniform(rng, 0.1, 3.0) * sign(rng)}

    def true_angles(self, e: Effect, arm: Arm, q: Array) -> Array:
        out = q.copy()
        out[arm.index(e.place)] += e.numbers["deg"]
        return out


class TurnedFrame(Law):
    """The surveyor's axes are turned against the base's."""

    family = "turned-frame"
    axes = ("direction",)
    bare = True
    spot = "gauge"

    def draw(self, rng: Rng, scene: Scene, place: str) -> dict[str, Any]:
        if rng.random() < 0.5:
            return {"deg": rng.uniform(3, 20) * sign(rng), "about": [0.0, 0.0, 1.0]}
        return {"deg": rng.uniform(1.5, 5) * sign(rng), "about": direction(rng, flat=True)}

    def turn(self, e: Effect) -> Array:
        """From stated to true."""
        return rotation(np.array(e.numbers["about"]), np.radians(e.numbers["deg"]))

    def pull(self, e: Effect, row: Row, force: Array, load_at: Array, read_at: Array) -> tuple[Array, Array, Array]:
        return self.turn(e) @ force, load_at, read_at

    def read(self, e: Effect, rows: list[Row], moved: Array) -> Array:
        return moved @ self.turn(e)


class Convention(Law):
    """Another way to count a joint's angle."""

    angles = True

    def place(self, rng: Rng, scene: Scene) -> str:
        return scene.some_joint(rng, scene.arm.joints[1:-1])


class AngleSign(Convention):
    """The table counts a joint backwards."""

    family = "angle-sign"

    def place(self, rng: Rng, scene: Scene) -> str:
        arm = scene.arm
        both = tuple(j for j, a, b in zip(arm.joints, arm.low, arm.high, strict=True) if min(-a, b) > 30)
        return scene.some_joint(rng, tuple(j for j in both if j not in (arm.joints[0], arm.joints[-1])))

    def draw(self, rng: Rng, scene: Scene, place: str) -> dict[str, Any]:
        return {}

    def true_angles(self, e: Effect, arm: Arm, q: Array) -> Array:
        out = q.copy()
        out[arm.index(e.place)] *= -1
        return out


class AngleOffset(Convention):
    """The table's zero is a part of a turn away."""

    family = "angle-offset"

    def draw(self, rng: Rng, scene: Scene, place: str) -> dict[str, Any]:
        i = scene.arm.index(place)
        fits = [o for o in (45, 90, 180) if o < 0.6 * (scene.arm.high[i] - scene.arm.low[i])]
        return {"deg": float(rng.choice(fits)) * sign(rng)}

    def true_angles(self, e: Effect, arm: Arm, q: Array) -> Array:
        out = q.copy()
        out[arm.index(e.place)] += e.numbers["deg"]
        return out


class AngleCoupling(Convention):
    """The table counts a joint from where the one before it stands."""

    family = "angle-coupling"

    def draw(self, rng: Rng, scene: Scene, place: str) -> dict[str, Any]:
        return {"of_last": sign(rng)}

    def true_angles(self, e: Effect, arm: Arm, q: Array) -> Array:
        i, out = arm.index(e.place), q.copy()
        out[i] += e.numbers["of_last"] * q[i - 1]
        return out


class AtGauge(Law):
    """Of the gauge, of which there is one."""

    bare = True
    spot = "gauge"
    axes = ("load",)


class GaugeZero(AtGauge):
    """Set to zero with a finger on it."""

    family = "gauge-zero"

    def draw(self, rng: Rng, scene: Scene, place: str) -> dict[str, Any]:
        return {"by_m": [rng.uniform(15e-6, 45e-6) * sign(rng) for _ in range(3)]}

    def read(self, e: Effect, rows: list[Row], moved: Array) -> Array:
        return moved + np.array(e.numbers["by_m"])


class GaugeScale(AtGauge):
    """An amplifier's knob."""

    family = "gauge-scale"

    def draw(self, rng: Rng, scene: Scene, place: str) -> dict[str, Any]:
        return {"by": rng.uniform(0.03, 0.1) * sign(rng)}

    def read(self, e: Effect, rows: list[Row], moved: Array) -> Array:
        return moved * (1 + e.numbers["by"])


class Drift(AtGauge):
    """The gauge's stand grows with the day's warmth, by a power of the time in each session."""

    family = "drift"
    axes = ("clock",)
    by_clock = True

    def draw(self, rng: Rng, scene: Scene, place: str) -> dict[str, Any]:
        size = log_uniform(rng, 25e-6, 120e-6)
        return {
            "by_m": [size * rng.uniform(0.4, 1.2) * sign(rng) for _ in range(3)],
            "power": rng.uniform(0.5, 1.5),
            "in_s": scene.duration_s,
        }

    def read(self, e: Effect, rows: list[Row], moved: Array) -> Array:
        n = e.numbers
        t = np.array([r.since_s for r in rows]) / n["in_s"]
        return moved + np.maximum(t, 0)[:, None] ** n["power"] * np.array(n["by_m"])


SETUP_LAWS = (
    Payload,
    LoadPoint,
    ToolPoint,
    Misalignment,
    JointZero,
    TurnedFrame,
    AngleSign,
    AngleOffset,
    AngleCoupling,
    GaugeZero,
    GaugeScale,
    Drift,
)


def tilting(scene: Scene, rng: Rng) -> float:
    """A base's stiffness against tilting that readings show."""
    return log_uniform(rng, 2e6, 1.2e7) * min(scene.arm.size, 1.2)


class Strange(Law):
    """Its code is a word of its own."""

    bare = True


class GroutCreep(AtBase):
    """Grout under the base gives way with time, and comes back."""

    family = "grout-creep"
    axes = ("load history",)

    def draw(self, rng: Rng, scene: Scene, place: str) -> dict[str, Any]:
        return {"stiffness": tilting(scene, rng), "time_s": log_uniform(rng, 40, 600), "at_once": rng.uniform(4, 15)}

    def change(self, e: Effect, plan: Plan, moment: Moment) -> None:
        k, first = e.numbers["stiffness"], e.numbers["at_once"]
        slow: Material = ("Maxwell", first * k, first * k * e.numbers["time_s"], 1.0, 1.0)
        grout: Material = ("Parallel", ("Elastic", k), slow)
        plan.base.append({4: grout, 5: grout})


class PadCreep(Strange):
    """A rubber pad under the hook settles."""

    family = "pad-creep"
    axes = ("load history",)
    spot = "tool"

    def draw(self, rng: Rng, scene: Scene, place: str) -> dict[str, Any]:
        k = scene.force / rng.uniform(1e-4, 4e-4)
        return {"stiffness": k, "time_s": log_uniform(rng, 40, 400), "at_once": rng.uniform(3, 12)}

    def change(self, e: Effect, plan: Plan, moment: Moment) -> None:
        k, first = e.numbers["stiffness"], e.numbers["at_once"]
        slow: Material = ("Maxwell", first * k, first * k * e.numbers["time_s"], 1.0, 1.0)
        pad: Material = ("Parallel", ("Elastic", k), slow)
        plan.tool.append({1: pad, 2: pad, 3: pad})


class BaseRub(AtBase):
    """The base shifts on its plate: it tilts, and rubs."""

    family = "base-rub"
    axes = ("load history",)

    def draw(self, rng: Rng, scene: Scene, place: str) -> dict[str, Any]:
        return {
            "stiffness": tilting(scene, rng),
            "moment": rng.uniform(0.08, 0.25) * scene.force * 0.5 * scene.arm.reach,
            "stiffer": rng.uniform(3, 12),
        }

    def change(self, e: Effect, plan: Plan, moment: Moment) -> None:
        n = e.numbers
        plate: Material = (
            "Parallel",
            ("Elastic", n["stiffness"]),
            *rubbing(n["moment"], n["stiffer"] * n["stiffness"], 0.0),
        )
        plan.base.append({4: plate, 5: plate})


class StylusPlay(AtGauge):
    """The stylus hangs back until the spindle has taken up its play."""

    family = "stylus-play"
    axes = ("load history",)

    def draw(self, rng: Rng, scene: Scene, place: str) -> dict[str, Any]:
        return {"half_m": rng.uniform(12e-6, 40e-6)}

    def read(self, e: Effect, rows: list[Row], moved: Array) -> Array:
        half, said, out = e.numbers["half_m"], np.zeros(3), []
        for d in moved:
            said = np.clip(said, d - half, d + half)
            out.append(said)
        return np.array(out)


class ServoRecovery(Strange):
    """The drive's integrator brings a joint back: it gives way at once, and less and less while the load hangs."""

    family = "servo-recovery"
    axes = ("load history",)

    def draw(self, rng: Rng, scene: Scene, place: str) -> dict[str, Any]:
        return {"amount": rng.uniform(0.12, 0.35), "time_s": log_uniform(rng, 30, 300)}

    def change(self, e: Effect, plan: Plan, moment: Moment) -> None:
        def law(k: float) -> Material:
            less = -e.numbers["amount"] * k
            return ("Parallel", ("Elastic", k), ("Maxwell", less, less * e.numbers["time_s"], 1.0, 1.0))

        plan.joints[plan.arm.index(e.place)].law = law


class FadingBase(AtBase):
    """An anchor works loose around one moment, and stays so."""

    family = "fading-base"
    axes = ("clock",)
    by_clock = True

    def draw(self, rng: Rng, scene: Scene, place: str) -> dict[str, Any]:
        return {
            "stiffness": tilting(scene, rng),
            "at_s": float(np.quantile(scene.times_s, rng.uniform(0.3, 0.7))),
            "within_s": rng.uniform(0.02, 0.08) * scene.duration_s,
        }

    def change(self, e: Effect, plan: Plan, moment: Moment) -> None:
        n = e.numbers
        gone = 0.5 * (1 + np.tanh((moment.time_s - n["at_s"]) / n["within_s"]))
        k = n["stiffness"] / (0.02 + gone)
        plan.base.append({4: ("Elastic", k), 5: ("Elastic", k)})


class CrackedLink(Strange):
    """A crack half way along a casing opens under tension and closes under pressure."""

    family = "cracked-link"
    axes = ("load", "pose")
    arms = ("xr701", "kr60-3", "tx200", "crane6", "reed7")

    def place(self, rng: Rng, scene: Scene) -> str:
        return str(rng.choice([link.name for link in scene.arm.links if link.body in ("j2", "j3", "j4")]))

    def draw(self, rng: Rng, scene: Scene, place: str) -> dict[str, Any]:
        k = log_uniform(rng, 5e5, 3e6) * min(scene.arm.size, 1.2)
        return {"open": k, "shut": 12 * k, "side": sign(rng)}

    def change(self, e: Effect, plan: Plan, moment: Moment) -> None:
        n = e.numbers
        link = next(link for link in plan.arm.links if link.name == e.place)
        plus, minus = (n["open"], n["shut"]) if n["side"] > 0 else (n["shut"], n["open"])
        # About the joint before it: a crack in the upper or the lower wall.
        plan.split[plan.arm.index(link.body) + 1] = {5: ("Elastic", plus, 0.0, minus)}


class TiltPlay(Strange):
    """A cross-roller bearing with play: a joint tilts freely a little, both ways across its axis."""

    family = "tilt-play"
    axes = ("load",)

    def draw(self, rng: Rng, scene: Scene, place: str) -> dict[str, Any]:
        return {"half": rng.uniform(1e-4, 4e-4), "beyond": log_uniform(rng, 3e6, 1.5e7) * min(scene.arm.size, 1.2)}

    def change(self, e: Effect, plan: Plan, moment: Moment) -> None:
        n = e.numbers
        k, half = n["beyond"], n["half"]
        play: Material = (
            "Parallel",
            ("Elastic", 0.03 * k),
            ("ElasticPPGap", k, HUGE, half),
            ("ElasticPPGap", k, -HUGE, -half),
        )
        plan.joints[plan.arm.index(e.place)].bearing |= {5: play, 6: play}


class ToolRubber(Strange):
    """A rubber coupling that stiffens with the load's cube root."""

    family = "tool-rubber"
    axes = ("load",)
    spot = "tool"

    def draw(self, rng: Rng, scene: Scene, place: str) -> dict[str, Any]:
        return {"force": scene.force, "amount": rng.uniform(1.2e-4, 4e-4), "power": rng.uniform(0.25, 0.5)}

    def change(self, e: Effect, plan: Plan, moment: Moment) -> None:
        n = e.numbers
        x = np.geomspace(0.01, 30, 50)
        forces = n["force"] * x
        ways = n["amount"] * ((x + 0.02) ** n["power"] - 0.02 ** n["power"])
        rubber = table(np.concatenate([-forces[::-1], [0], forces]), np.concatenate([-ways[::-1], [0], ways]))
        plan.tool.append({1: rubber, 2: rubber, 3: rubber})


class GaugeBend(AtGauge):
    """A stylus that swings on an arc says less the further it goes."""

    family = "gauge-bend"

    def draw(self, rng: Rng, scene: Scene, place: str) -> dict[str, Any]:
        return {"arm_m": rng.uniform(0.003, 0.009), "lean": rng.uniform(0.2, 0.8)}

    def read(self, e: Effect, rows: list[Row], moved: Array) -> Array:
        arm, lean = e.numbers["arm_m"], e.numbers["lean"]
        return arm * (np.sin(moved / arm + lean) - np.sin(lean)) / np.cos(lean)


class BaseBySession(AtBase):
    """Bolted down anew for every session, never alike."""

    family = "base-by-session"
    axes = ("session",)
    by_session = True

    def draw(self, rng: Rng, scene: Scene, place: str) -> dict[str, Any]:
        k = tilting(scene, rng)
        order = rng.permutation([1.0, 4.0, 2.0, 9.0]).tolist()
        return {"by_session": [k * x for x in order]}

    def change(self, e: Effect, plan: Plan, moment: Moment) -> None:
        by = e.numbers["by_session"]
        k = by[moment.session % len(by)]
        plan.base.append({4: ("Elastic", k), 5: ("Elastic", 1.3 * k)})


class WeightsMixedUp(AtLoad):
    """Another box of weights on one of the days."""

    family = "weights-mixed-up"
    axes = ("session",)
    by_session = True

    def draw(self, rng: Rng, scene: Scene, place: str) -> dict[str, Any]:
        return {"session": int(rng.integers(scene.spec.sessions)), "by": rng.uniform(0.04, 0.12) * sign(rng)}

    def pull(self, e: Effect, row: Row, force: Array, load_at: Array, read_at: Array) -> tuple[Array, Array, Array]:
        wrong = row.session == e.numbers["session"]
        return force * (1 + e.numbers["by"] * wrong), load_at, read_at


class OneSided(Strange):
    """A gear whose flanks are not alike: one way it is much stiffer."""

    family = "one-sided"
    axes = ("direction", "pose")

    def place(self, rng: Rng, scene: Scene) -> str:
        return scene.some_joint(rng, scene.arm.joints[3:])

    def draw(self, rng: Rng, scene: Scene, place: str) -> dict[str, Any]:
        return {"by": rng.uniform(1.5, 2.6) ** sign(rng)}

    def change(self, e: Effect, plan: Plan, moment: Moment) -> None:
        by = float(np.sqrt(e.numbers["by"]))
        plan.joints[plan.arm.index(e.place)].law = lambda k: ("Elastic", k * by, 0.0, k / by)


class SlidingHook(AtLoad):
    """A hook slides along its bar as the load pulls it."""

    family = "sliding-hook"
    axes = ("load",)

    def draw(self, rng: Rng, scene: Scene, place: str) -> dict[str, Any]:
        return {"by_m": [rng.uniform(0.03, 0.09) * x for x in direction(rng)], "force": scene.force}

    def pull(self, e: Effect, row: Row, force: Array, load_at: Array, read_at: Array) -> tuple[Array, Array, Array]:
        share = float(np.linalg.norm(force)) / e.numbers["force"]
        return force, load_at + share**1.5 * np.array(e.numbers["by_m"]), read_at


class Hanger(Strange):
    """A hose hangs between the ceiling and the forearm, taut enough to carry."""

    family = "hanger"
    axes = ("pose",)

    def place(self, rng: Rng, scene: Scene) -> str:
        return scene.arm.joints[-4]

    def draw(self, rng: Rng, scene: Scene, place: str) -> dict[str, Any]:
        r = scene.arm.reach
        return {
            "stiffness": log_uniform(rng, 1e5, 6e5) * min(scene.arm.size, 1.2),
            "from_m": [r * rng.uniform(0.1, 0.5), r * rng.uniform(-0.4, 0.4), 1.6 * r],
        }

    def change(self, e: Effect, plan: Plan, moment: Moment) -> None:
        def add(deck: Deck, nodes: Nodes) -> None:
            ceiling = deck.node(np.array(e.numbers["from_m"]))
            deck.fix(ceiling)
            deck.bar(ceiling, nodes.before[-3], e.numbers["stiffness"])

        plan.beside.append(add)


class SoftBearing(Strange):
    """A joint's bearing gives way sideways."""

    family = "soft-bearing"
    axes = ("pose",)

    def place(self, rng: Rng, scene: Scene) -> str:
        return scene.some_joint(rng, scene.arm.joints[1:])

    def draw(self, rng: Rng, scene: Scene, place: str) -> dict[str, Any]:
        k = scene.force / rng.uniform(8e-5, 3e-4)
        return {"stiffness": k, "other_way": k * rng.uniform(0.6, 1.6)}

    def change(self, e: Effect, plan: Plan, moment: Moment) -> None:
        joint = plan.joints[plan.arm.index(e.place)]
        joint.bearing |= {2: ("Elastic", e.numbers["stiffness"]), 3: ("Elastic", e.numbers["other_way"])}


STRANGE_LAWS = (
    GroutCreep,
    PadCreep,
    BaseRub,
    StylusPlay,
    ServoRecovery,
    FadingBase,
    CrackedLink,
    TiltPlay,
    ToolRubber,
    GaugeBend,
    BaseBySession,
    WeightsMixedUp,
    OneSided,
    SlidingHook,
    Hanger,
    SoftBearing,
)


KNOWN: dict[str, Law] = {law.family: law() for law in (*JOINT_LAWS, *HISTORY_LAWS, *BODY_LAWS, *SETUP_LAWS)}
STRANGE: dict[str, Law] = {law.family: law() for law in STRANGE_LAWS}
EVERY = KNOWN | STRANGE
# A whole table in another convention, or all springs at once, leaves nothing to tell two effects apart by.
ALONE = {"gauge-scale", "angle-sign", "angle-offset", "angle-coupling", "load-path"}
PAIRED = tuple(family for family in KNOWN if family not in ALONE)
