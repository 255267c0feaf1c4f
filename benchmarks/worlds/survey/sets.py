"""Sets: an arm, what every arm is off by, one thing more or none, a tracker, and how much nothing else explains."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from .arms import Floats, SurveyArm, arms, model_toml
from .mechanics import Truth, Visit, positions

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
    text = io.StringIO()
    writer = csv.writer(text)
    rail = ["rail_mm"] if s.rail else []
    writer.writerow(
        [
            *(f"q{j}_deg" for j in range(1, 7)),
            "x_mm",
            "y_mm",
            "z_mm",
            "session",
            "target",
            "payload_kg",
            "payload_x_mm",
            "payload_y_mm",
            "payload_z_mm",
            *rail,
            "time_s",
            "temperature_C",
        ]
    )
    for k in range(len(v)):
        way = [f"{1e3 * v.rail[k]:.2f}"] if s.rail else []
        writer.writerow(
            [
                *(f"{x:.6f}" for x in np.degrees(v.q[k])),
                *(f"{1e3 * x:.4f}" for x in y[k]),
                "stay",
                f"ball{v.target[k]}",
                f"{v.kg[k]:g}",
                0,
                0,
                100,
                *way,
                f"{v.time[k]:.0f}",
                f"{20.0 + v.warm[k]:.1f}",
            ]
        )
    return text.getvalue()


def make(out: Path, seed: int, single: int, none: int) -> None:
    """Write the sets; sizes are drawn before anything is diagnosed, and kept whatever comes of it."""
    kinds = list(SIZES)
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
        folder = out / name
        folder.mkdir(parents=True)
        (folder / "model.toml").write_text(model_toml(s.arm), encoding="utf-8")
        (folder / "positions.csv").write_text(table(s, s.visit, y + tracker.noise(y, rng)), encoding="utf-8")
        # Another day: what drifts or was moved is no part of it.
        later = replace(t, drift=np.zeros(6), bump=np.zeros(6))
        (folder / "unseen.csv").write_text(table(s, s.unseen, s.read(later, s.unseen)), encoding="utf-8")
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
        (folder / "key.json").write_text(json.dumps(key, indent=1) + "\n", encoding="utf-8")
