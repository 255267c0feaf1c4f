"""Surveyed arms: what every arm is off by, one thing more or none, a tracker, and how much nothing else explains."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from ..shared import csv_text, write_files

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class SurveyArm:
    """An arm as its maker describes it.

    ``dh`` (6, 4): alpha (rad), a, d (m), theta offset (rad), modified; ``limits`` (6, 2) rad; ``kg`` (6,) of the body
    behind each joint, in the middle of its link; ``stiffness`` (6,) N m/rad, 0 where the maker calls the joint rigid;
    ``payload`` kg.
    """

    name: str
    dh: Floats
    limits: Floats
    kg: Floats
    stiffness: Floats
    payload: float


def arms() -> list[SurveyArm]:
    """A heavy arm, a middling one with a skew wrist, a light one."""
    h = np.pi / 2.0
    heavy = SurveyArm(
        "schlepper",
        np.array(
            [[0, 0, 0.75, 0], [-h, 0.35, 0, 0], [0, 1.2, 0, -h], [-h, 0.12, 1.15, 0], [h, 0, 0, 0], [-h, 0, 0.22, 0]]
        ),
        np.radians([[-180, 180], [-120, 20], [-100, 150], [-300, 300], [-120, 120], [-300, 300]]),
        np.array([0.0, 210.0, 200.0, 0.0, 35.0, 0.0]),
        np.array([2.1e6, 2.6e6, 1.7e6, 0.0, 0.0, 0.0]),
        120.0,
    )
    middling = SurveyArm(
        "mittler",
        np.array(
            [[0, 0, 0.42, 0], [-h, 0.16, 0, -h], [0, 0.6, 0, 0], [-h, 0.13, 0.62, 0], [h, 0, 0, 0], [-h, 0, 0.1, 0]]
        ),
        np.radians([[-170, 170], [-90, 130], [-170, 80], [-200, 200], [-120, 120], [-350, 350]]),
        np.array([0.0, 40.0, 42.0, 0.0, 6.0, 0.0]),
        np.array([0.0, 3.2e5, 1.9e5, 0.0, 0.0, 0.0]),
        16.0,
    )
    light = SurveyArm(
        "leicht",
        np.array(
            [[0, 0, 0.15, 0], [h, 0, 0, 0], [0, -0.61, 0, 0], [0, -0.57, 0.16, 0], [h, 0, 0.12, 0], [-h, 0, 0.1, 0]]
        ),
        np.radians([[-180, 180]] * 6),
        np.array([0.0, 10.0, 5.0, 2.2, 2.0, 0.0]),
        np.array([0.0, 9e4, 7e4, 4e4, 0.0, 0.0]),
        8.0,
    )
    return [heavy, middling, light]


def model_toml(arm: SurveyArm) -> str:
    """The model file of an arm."""

    def value(x: float, unit: str) -> str:
        return f'{{ value = {x!r}, unit = "{unit}", source = "maker" }}'

    tube = 'section = {{ kind = "tube", diameter = {}, wall = {} }}'.format(value(200.0, "mm"), value(8.0, "mm"))
    out = [
        f'schema = "stiffarm-model/1"\nname = "{arm.name}"\ntitle = "{arm.name}"',
        f"mass = {value(float(arm.kg.sum()) + 80.0, 'kg')}",
        '[sources]\nmaker = "made up"',
        "[materials.steel]",
        f"youngs_modulus = {value(210.0, 'GPa')}",
        f"poissons_ratio = {value(0.3, '1')}",
        f"density = {value(7850.0, 'kg/m^3')}",
    ]
    for j in range(6):
        alpha, a, d, theta = (float(x) for x in arm.dh[j])
        low, high = (round(float(x), 9) for x in np.degrees(arm.limits[j]))
        out += [
            "[[joint]]",
            f'name = "j{j + 1}"',
            f'coordinate = "q{j + 1}_deg"',
            f'limits = {{ value = [{low}, {high}], unit = "deg", source = "maker" }}',
        ]
        if arm.stiffness[j] > 0.0:
            out.append(f"stiffness = {value(float(arm.stiffness[j]), 'N m/rad')}")
        if theta:
            out.append(f"offset = {value(round(float(np.degrees(theta)), 9), 'deg')}")
        out += [
            "[joint.dh]",
            f"alpha = {value(round(float(np.degrees(alpha)), 9), 'deg')}",
            f"a = {value(1e3 * a, 'mm')}",
            f"d = {value(1e3 * d, 'mm')}",
        ]
    out += ["[flange]", 'xyz = { value = [0, 0, 0], unit = "mm", source = "maker" }']
    for j in range(1, 5):
        if not arm.kg[j]:
            continue
        out += [
            "[[link]]",
            f'name = "link-{j + 1}"',
            f'body = "j{j + 1}"',
            'material = "steel"',
            f"mass = {value(float(arm.kg[j]), 'kg')}",
            tube,
        ]
    return "\n".join(out) + "\n"


# Rounds of "go there and ask again" until springs and weights agree; what is left then is below a nanometre.
ROUNDS = 6
# Of Pinocchio's 20 coordinates: the base's two tilts, then each joint's two tilts and its own turn.
OWN = np.arange(6) * 3 + 4


@dataclass(frozen=True)
class Truth:
    """All that is true of one arm.

    ``frames`` (6, 6): shift (m) and turn (rad) of each joint's frame; ``zeros``, ``ratios`` (6,); ``coupling`` (6, 6):
    how much the row's joint turns with the column's; ``run_out`` (6, 2): size (rad) and where (rad); ``compliance``
    (20,) rad/(N m); ``centres`` (6,): where along its link a mass sits; ``weight``: factor on the payload; ``growth``
    1/K; ``drift``, ``bump`` (6,): shift and turn after an hour, and at once after ``bumped`` s; ``bow`` (2,) m and
    ``sway`` rad of the rail.
    """

    frames: Floats
    zeros: Floats
    compliance: Floats
    centres: Floats
    ratios: Floats = field(default_factory=lambda: np.zeros(6))
    coupling: Floats = field(default_factory=lambda: np.zeros((6, 6)))
    run_out: Floats = field(default_factory=lambda: np.zeros((6, 2)))
    weight: float = 1.0
    growth: float = 0.0
    drift: Floats = field(default_factory=lambda: np.zeros(6))
    bump: Floats = field(default_factory=lambda: np.zeros(6))
    bumped: float = np.inf
    bow: Floats = field(default_factory=lambda: np.zeros(2))
    sway: float = 0.0


@dataclass(frozen=True)
class Visit:
    """n readings: ``q`` (n, 6) rad, ``target`` and ``kg`` of the payload (n,), ``rail`` m, ``time`` s, ``warm`` K."""

    q: Floats
    target: np.ndarray
    kg: Floats
    rail: Floats
    time: Floats
    warm: Floats

    def __len__(self) -> int:
        return len(self.q)


def built(arm: SurveyArm, t: Truth, kg: float, targets: Floats) -> tuple[pin.Model, list[int]]:
    """Pinocchio's model of the arm with a payload at the flange, and its frames at the targets."""
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelRX(), pin.SE3.Identity(), "base.x")
    joint = model.addJoint(joint, pin.JointModelRY(), pin.SE3.Identity(), "base.y")
    grown = 1.0 + t.growth
    places = []
    for j in range(6):
        alpha, a, d, _ = arm.dh[j]
        turn = pin.exp3(np.array([alpha, 0.0, 0.0]))
        place = pin.SE3(turn, grown * (np.array([a, 0.0, 0.0]) + turn @ np.array([0.0, 0.0, d])))
        places.append(place * pin.SE3(pin.exp3(t.frames[j, 3:]), t.frames[j, :3]))
    for j in range(6):
        joint = model.addJoint(joint, pin.JointModelRX(), places[j], f"j{j}.x")
        joint = model.addJoint(joint, pin.JointModelRY(), pin.SE3.Identity(), f"j{j}.y")
        joint = model.addJoint(joint, pin.JointModelRZ(), pin.SE3.Identity(), f"j{j}.z")
        along = places[j + 1].translation if j < 5 else np.zeros(3)
        ball = pin.Inertia(float(arm.kg[j]), t.centres[j] * along, 1e-3 * np.eye(3))
        model.appendBodyToJoint(joint, ball, pin.SE3.Identity())
    model.appendBodyToJoint(
        joint, pin.Inertia(kg * t.weight, np.array([0.0, 0.0, 0.1]), 1e-3 * np.eye(3)), pin.SE3.Identity()
    )
    frames = [
        model.addFrame(pin.Frame(f"target.{k}", joint, 0, pin.SE3(np.eye(3), grown * at), pin.FrameType.OP_FRAME))
        for k, at in enumerate(targets)
    ]
    return model, frames


def turned(arm: SurveyArm, t: Truth, q: Floats) -> Floats:
    """What the joints really turn (6,) before they give way."""
    out = q + t.zeros + t.ratios * q + t.coupling @ q + arm.dh[:, 3]
    for j in range(6):
        size, where = t.run_out[j]
        if size:
            # A wheel off its centre by half its radius: the angle seen from the centre that it should have.
            x = q[j] - where
            out[j] += size * np.arctan2(0.5 * np.sin(x), 1.0 + 0.5 * np.cos(x)) / 0.5
    return np.asarray(out)


def positions(arm: SurveyArm, t: Truth, v: Visit, targets: Floats, rail: float) -> Floats:
    """Positions (n, 3) m in the frame of the floor; ``rail`` m: its length."""
    out = np.empty((len(v), 3))
    models = {}
    for k in range(len(v)):
        key = float(v.kg[k]), float(v.warm[k])
        if key not in models:
            model, frames = built(arm, replace(t, growth=t.growth * v.warm[k]), v.kg[k], targets)
            models[key] = model, model.createData(), frames
        model, data, frames = models[key]
        given = np.zeros(20)
        given[OWN] = turned(arm, t, v.q[k])
        there = given
        for _ in range(ROUNDS):
            there = given - t.compliance * pin.computeGeneralizedGravity(model, data, there)
        pin.framesForwardKinematics(model, data, there)
        p = data.oMf[frames[int(v.target[k])]].translation
        out[k] = _on_rail(t, p, v.rail[k], rail)
        hours = v.time[k] / 3600.0
        move = t.drift * np.sqrt(max(hours, 0.0)) + t.bump * (v.time[k] >= t.bumped)
        out[k] = pin.exp3(move[3:]) @ out[k] + move[:3]
    return out


def _on_rail(t: Truth, p: Floats, at: float, length: float) -> Floats:
    if not length:
        return p
    s = np.pi * at / length
    turn = pin.exp3(np.array([0.0, t.sway * np.cos(s), t.sway * np.sin(2.0 * s)]))
    return np.asarray(turn @ p + np.array([at, t.bow[0] * np.sin(s), t.bow[1] * np.sin(2.0 * s)]))


# What is drawn; each with the words that the program's catalogue has for it.
SIZES: dict[str, tuple[float, float]] = {
    "joint-compliance": (1.0, 6.0),
    "joint-tilt": (1.0, 6.0),
    "base-tilt": (0.3, 2.0),
    "gear-ratio": (1e-4, 1e-3),
    "joint-coupling": (1e-4, 1e-3),
    "joint-error": (5e-5, 5e-4),
    "payload": (0.06, 0.3),
    "rail-bow": (1e-4, 1e-3),
    "arm-growth": (8e-6, 2.4e-5),
    "drift": (5e-5, 4e-4),
    "bump": (8e-5, 8e-4),
}
DETECTABLE = 30.0
# Compliances of joints that the maker calls rigid go by what the arm's softest declared joint has.
TRIES = 60


@dataclass(frozen=True)
class Tracker:
    """Noise: ``along`` the beam m, ``across`` by the metre, ``tail`` of Student's t, one wrong reading in ``wrong``."""

    along: float
    across: float
    tail: float
    wrong: int

    def noise(self, y: Floats, rng: np.random.Generator) -> Floats:
        """Errors (n, 3) m of positions (n, 3) m."""
        far = np.linalg.norm(y, axis=1, keepdims=True)
        beam = y / far
        size = np.sqrt(rng.chisquare(self.tail, (len(y), 1)) / self.tail) if np.isfinite(self.tail) else 1.0
        error = (self.across * far * rng.normal(size=y.shape) + self.along * rng.normal(size=(len(y), 1)) * beam) / size
        if self.wrong:
            error[rng.random(len(y)) < 1.0 / self.wrong] += rng.choice([-1.0, 1.0]) * np.array([0.002, 0.001, -0.003])
        return np.asarray(error)

    def sd(self, y: Floats) -> Floats:
        """Standard deviations (n, 3) m, about."""
        far = np.linalg.norm(y, axis=1, keepdims=True)
        return np.broadcast_to(np.hypot(self.across * far, 0.6 * self.along), y.shape)


@dataclass(frozen=True)
class Scene:
    """Everything about one set but its noise."""

    arm: SurveyArm
    truth: Truth
    visit: Visit
    unseen: Visit
    targets: Floats
    rail: float
    frame: tuple[Floats, Floats]

    def read(self, t: Truth, v: Visit) -> Floats:
        """Positions (n, 3) m in the tracker's frame, without noise."""
        R, p = self.frame
        return np.asarray(positions(self.arm, t, v, self.targets, self.rail) @ R.T + p)


def rotation(rng: np.random.Generator) -> Floats:
    """A rotation drawn evenly."""
    Q, R = np.linalg.qr(rng.normal(size=(3, 3)))
    Q = Q * np.sign(np.diag(R))
    return np.asarray(Q if np.linalg.det(Q) > 0 else Q[:, ::-1])


def scene(rng: np.random.Generator, *, rail: bool) -> Scene:
    """An arm as arms are, with nothing more."""
    arm = arms()[int(rng.integers(3))]
    n = int(rng.choice([40, 80, 160]))
    length = float(rng.uniform(2.0, 4.0)) if rail else 0.0
    loads = np.array([0.0, arm.payload]) if rng.random() < 0.6 else np.array([float(rng.choice([0.0, arm.payload]))])
    declared = arm.stiffness > 0.0
    compliance = np.zeros(20)
    compliance[np.arange(6) * 3 + 4] = np.where(
        declared, np.exp(rng.normal(0.0, 0.25, 6)) / np.maximum(arm.stiffness, 1.0), 0.0
    )
    frames = np.hstack([rng.normal(0.0, 5e-4, (6, 3)), rng.normal(0.0, 5e-4, (6, 3))])
    # Every gear runs out by some micrometres at the tool.
    run_out = np.column_stack([rng.uniform(0.0, 8e-6, 6), rng.uniform(-np.pi, np.pi, 6)])
    truth = Truth(frames, rng.normal(0.0, 2e-3, 6), compliance, 0.5 + 0.03 * rng.normal(size=6), run_out=run_out)
    targets = rng.uniform(-0.12, 0.12, (int(rng.integers(1, 4)), 3)) + np.array([0.0, 0.0, 0.1])

    def visit(count: int, hours: float) -> Visit:
        low, high = arm.limits.T
        time = np.sort(rng.uniform(0.0, 3600.0 * hours, count))
        warm = rng.uniform(2.0, 8.0) * (1.0 - np.exp(-time / 4000.0)) + 0.1 * rng.normal(size=count)
        return Visit(
            rng.uniform(0.8 * low, 0.8 * high, (count, 6)),
            rng.integers(0, len(targets), count),
            loads[rng.integers(0, len(loads), count)],
            rng.uniform(0.0, length, count),
            time,
            np.round(warm, 1),
        )

    frame = rotation(rng), rng.uniform(2.0, 5.0, 3) * rng.choice([-1.0, 1.0], 3)
    return Scene(arm, truth, visit(n, float(rng.uniform(1.0, 6.0))), visit(60, 1.0), targets, length, frame)


def hidden(kind: str, s: Scene, rng: np.random.Generator) -> tuple[Truth, str, dict[str, Any]] | None:
    """The truth with one thing more, its code and numbers; None where this scene cannot have it."""
    t, (low, high) = s.truth, SIZES[kind]
    size = float(np.exp(rng.uniform(np.log(low), np.log(high))))
    sign = float(rng.choice([-1.0, 1.0]))
    softest = 1.0 / s.arm.stiffness[s.arm.stiffness > 0.0].min()
    rigid = [j for j in range(1, 5) if s.arm.stiffness[j] == 0.0]
    j = int(rng.integers(1, 5))
    if kind == "joint-compliance":
        j = int(rng.choice(rigid))
        return _softer(t, {3 * j + 4: size * softest}), f"{kind}:j{j + 1}", {"compliance": size * softest}
    if kind == "joint-tilt":
        one = size * softest / 3.0
        return (
            _softer(t, {3 * j + 2: one, 3 * j + 3: one * rng.uniform(0.5, 2.0)}),
            f"{kind}:j{j + 1}",
            {"compliance": one},
        )
    if kind == "base-tilt":
        one = size * softest / 3.0
        return _softer(t, {0: one, 1: one * rng.uniform(0.5, 2.0)}), kind, {"compliance": one}
    if kind == "gear-ratio":
        return _set(t, "ratios", j, sign * size), f"{kind}:j{j + 1}", {"ratio": sign * size}
    if kind == "joint-coupling":
        other = int(rng.choice([k for k in range(6) if k != j]))
        return _set(t, "coupling", (j, other), sign * size), f"{kind}:j{j + 1}.j{other + 1}", {"share": sign * size}
    if kind == "joint-error":
        return _set(t, "run_out", (j, 0), size), f"{kind}:j{j + 1}", {"size_rad": size}
    if kind == "payload" and s.visit.kg.max() > 0.0:
        return replace(t, weight=1.0 + sign * size), kind, {"share": sign * size}
    if kind == "rail-bow" and s.rail:
        return replace(t, bow=np.array([size, 0.5 * size]), sway=0.2 * size), kind, {"bow_m": size}
    if kind == "arm-growth":
        return replace(t, growth=size), kind, {"per_K": size}
    move = size * np.concatenate([rng.normal(size=3), 0.3 * rng.normal(size=3)])
    if kind == "drift":
        return replace(t, drift=move), kind, {"after_an_hour": move.tolist()}
    if kind == "bump":
        when = float(rng.uniform(0.2, 0.8) * s.visit.time[-1])
        return replace(t, bump=move, bumped=when), kind, {"move": move.tolist(), "after_s": when}
    return None


def _softer(t: Truth, more: dict[int, float]) -> Truth:
    compliance = t.compliance.copy()
    for place, value in more.items():
        compliance[place] += value
    return replace(t, compliance=compliance)


def _set(t: Truth, name: str, at: Any, value: float) -> Truth:
    other = getattr(t, name).copy()
    other[at] = value
    return replace(t, **{name: other})


def excess(s: Scene, t: Truth, tracker: Tracker) -> float:
    """Chi-square of what is hidden that frames, targets, geometry and declared springs cannot take up."""
    plain, there = s.read(s.truth, s.visit), s.read(t, s.visit)
    sd = tracker.sd(plain)
    columns = [(x - plain) / sd for x in _moved(s)]
    A = np.stack([c.reshape(-1) for c in columns], axis=1)
    A = A / np.linalg.norm(A, axis=0).clip(1e-300)
    y = ((there - plain) / sd).reshape(-1)
    left = y - A @ np.linalg.lstsq(A, y, rcond=1e-9)[0]
    return float(left @ left)


def _moved(s: Scene) -> list[Floats]:
    """Readings with every number of the nuisance a little else."""
    out: list[Floats] = []

    def at(change: Callable[[Truth], Truth]) -> None:
        out.append(s.read(change(s.truth), s.visit))

    for j in range(6):
        for c in range(6):
            at(lambda t, j=j, c=c: _set(t, "frames", (j, c), t.frames[j, c] + 1e-6))
        at(lambda t, j=j: _set(t, "zeros", j, t.zeros[j] + 1e-6))
        if s.arm.stiffness[j]:
            at(lambda t, j=j: _softer(t, {3 * j + 4: 1e-3 / s.arm.stiffness[j]}))
    R, _ = s.frame
    for k in range(3):
        step = 1e-6 * np.eye(3)[k]
        out.append(s.read(s.truth, s.visit) + step)
        out.append(s.read(s.truth, s.visit) @ (np.eye(3) + _skew(step)).T)
        for target in range(len(s.targets)):
            other = s.targets.copy()
            other[target, k] += 1e-6
            out.append(replace(s, targets=other).read(s.truth, s.visit))
        if s.rail:
            out.append(s.read(s.truth, s.visit) + s.visit.rail[:, None] * (R @ step))
    return out


def _skew(w: Floats) -> Floats:
    return np.array([[0.0, -w[2], w[1]], [w[2], 0.0, -w[0]], [-w[1], w[0], 0.0]])


def table(s: Scene, v: Visit, y: Floats) -> str:
    """The readings as a table of positions."""
    rows = []
    for k in range(len(v)):
        row: dict[str, Any] = {f"q{j}_deg": f"{x:.6f}" for j, x in enumerate(np.degrees(v.q[k]), 1)}
        row |= {f"{axis}_mm": f"{1e3 * x:.4f}" for axis, x in zip("xyz", y[k], strict=True)}
        row |= {"session": "stay", "target": f"ball{v.target[k]}", "payload_kg": f"{v.kg[k]:g}"}
        row |= {"payload_x_mm": 0, "payload_y_mm": 0, "payload_z_mm": 100}
        row |= {"rail_mm": f"{1e3 * v.rail[k]:.2f}"} if s.rail else {}
        rows.append(row | {"time_s": f"{v.time[k]:.0f}", "temperature_C": f"{20.0 + v.warm[k]:.1f}"})
    return csv_text(rows)


def make(out: Path, seed: int, single: int = 100, none: int = 60) -> list[Path]:
    """Write the sets; sizes are drawn before anything is diagnosed, and kept whatever comes of it."""
    kinds, folders = list(SIZES), list[Path]()
    for k in range(single + none):
        name = f"single-{k + 1:03d}" if k < single else f"none-{k - single + 1:03d}"
        rng = np.random.default_rng([seed, k])
        kind = kinds[k % len(kinds)] if k < single else ""
        tracker = Tracker(
            float(rng.uniform(1e-5, 4e-5)),
            float(rng.uniform(3e-6, 1.2e-5)),
            float(rng.choice([3.0, 6.0, np.inf])),
            50 if rng.random() < 0.5 else 0,
        )
        found = None
        for _ in range(TRIES):
            s = scene(rng, rail=kind == "rail-bow" or rng.random() < 0.2)
            found = hidden(kind, s, rng) if kind else (s.truth, "", {})
            if found is not None and (not kind or excess(s, found[0], tracker) >= DETECTABLE):
                break
        else:
            raise RuntimeError(f"{kind}: nothing that can be seen in {TRIES} tries")
        t, code, numbers = found
        y = s.read(t, s.visit)
        # Another day: what drifts or was moved is no part of it.
        later = replace(t, drift=np.zeros(6), bump=np.zeros(6))
        key = {
            "world": "survey",
            "code": code,
            "numbers": numbers,
            "arm": s.arm.name,
            "readings": len(s.visit),
            "excess_chi2": excess(s, t, tracker) if code else 0.0,
            "targets": len(s.targets),
            "rail_m": s.rail,
            "noise": {
                "along_m": tracker.along,
                "across": tracker.across,
                "tail": str(tracker.tail),
                "wrong_one_in": tracker.wrong,
            },
        }
        files = {
            "model.toml": model_toml(s.arm),
            "positions.csv": table(s, s.visit, y + tracker.noise(y, rng)),
            "unseen.csv": table(s, s.unseen, s.read(later, s.unseen)),
            "key.json": key,
        }
        folders.append(write_files(out / name, files))
    return folders
