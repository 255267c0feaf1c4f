"""Laws of the set-up and of the gauge: what the table says is not what stood there."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .arms import Arm, rotation
from .laws import Law, Scene, log_uniform, sign, unit
from .spec import Effect, Row

Array = NDArray[np.float64]
Rng = np.random.Generator


class AtLoad(Law):
    """Of the load, of which there is one."""

    bare = True
    spot = "load"


class Payload(AtLoad):
    """A hook and a basket that nobody weighed, or a rope that takes some of the weight."""

    family = "payload"
    axis = ("load",)

    def draw(self, rng: Rng, scene: Scene, place: str) -> dict[str, Any]:
        return {"force": rng.uniform(20, 60) * scene.arm.payload / 1300 * sign(rng)}

    def pull(self, e: Effect, row: Row, force: Array, load_at: Array, read_at: Array) -> tuple[Array, Array, Array]:
        size = float(np.linalg.norm(force))
        return force * (1 + e.numbers["force"] / size), load_at, read_at


class LoadPoint(AtLoad):
    """The load hangs beside the point, the gauge stands at it."""

    family = "load-point-offset"

    def draw(self, rng: Rng, scene: Scene, place: str) -> dict[str, Any]:
        return {"by_m": [rng.uniform(0.015, 0.045) * x for x in unit(rng)]}

    def pull(self, e: Effect, row: Row, force: Array, load_at: Array, read_at: Array) -> tuple[Array, Array, Array]:
        return force, load_at + np.array(e.numbers["by_m"]), read_at


class ToolPoint(LoadPoint):
    """Load and gauge are both beside the point."""

    family = "tool-point-offset"
    spot = "tool"

    def draw(self, rng: Rng, scene: Scene, place: str) -> dict[str, Any]:
        return {"by_m": [rng.uniform(0.02, 0.06) * x for x in unit(rng)]}

    def pull(self, e: Effect, row: Row, force: Array, load_at: Array, read_at: Array) -> tuple[Array, Array, Array]:
        by = np.array(e.numbers["by_m"])
        return force, load_at + by, read_at + by


class Misalignment(AtLoad):
    """The rope leans, always to the same side of the hall."""

    family = "load-misalignment"

    def draw(self, rng: Rng, scene: Scene, place: str) -> dict[str, Any]:
        return {"deg": rng.uniform(1.5, 4.5), "about": unit(rng, flat=True)}

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
    axis = ("direction",)
    bare = True
    spot = "gauge"

    def draw(self, rng: Rng, scene: Scene, place: str) -> dict[str, Any]:
        if rng.random() < 0.5:
            return {"deg": rng.uniform(3, 20) * sign(rng), "about": [0.0, 0.0, 1.0]}
        return {"deg": rng.uniform(1.5, 5) * sign(rng), "about": unit(rng, flat=True)}

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
    axis = ("load",)


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
    axis = ("clock",)
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


LAWS = (
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
