"""Readings of the bundled KR60-3 with effects of the catalogue's own laws, for tests of the diagnosis."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np

from doe.diagnosis.diagnose import Diagnosis, diagnose
from doe.diagnosis.setting import Setting, setting_of
from doe.tables.loaded import history_of, loaded_points
from doe.tables.measurements import Measurements
from fem import ArmModel, build_model
from fem.effects.base import PlacedEffect
from fem.effects.catalogue import effect_of
from fem.effects.observed import observed
from fem.statics.loads import as_loaded
from robots import ModelDescription, load_description

LOADS = (150.0, 300.0, 450.0)
FRICTION = {"share": 0.9, "friction": 120.0}


@cache
def kr60() -> tuple[ModelDescription, ArmModel]:
    description = load_description("kr60-3")
    return description, build_model(description, "rigid")


def campaign(poses: int = 18, repeats: int = 2, seed: int = 0, components: tuple[int, ...] = (2,)) -> Measurements:
    """Loads up and down in random poses, nothing read yet."""
    robot = kr60()[1].robot
    rng = np.random.default_rng(seed)
    middle, half = robot.limits.mean(axis=1), 0.35 * np.ptp(robot.limits, axis=1)
    q = middle + half * rng.uniform(-1.0, 1.0, (poses, robot.dof))
    rows = [
        (pose, repeat, load, phase)
        for pose in range(poses)
        for repeat in range(repeats)
        for phase, loads in (("loading", LOADS), ("unloading", LOADS[::-1]))
        for load in loads
    ]
    n = len(rows)
    wrench = np.zeros((n, 6))
    wrench[:, 2] = [-row[2] for row in rows]
    displacement = np.full((n, 6), np.nan)
    displacement[:, components] = 0.0
    return Measurements(
        source="made up",
        sha256="",
        q=q[[row[0] for row in rows]],
        wrench=wrench,
        displacement=displacement,
        point=np.full((n, 3), np.nan),
        sigma=np.full(n, np.nan),
        pose=tuple(f"P{row[0]}" for row in rows),
        repeat=tuple(row[1] for row in rows),
        phase=tuple(row[3] for row in rows),
        step=np.arange(n, dtype=float),
        row_numbers=tuple(range(2, n + 2)),
        extra={},
        notes=(),
        time=25.0 * np.arange(n),
    )


def read(
    effects: dict[str, dict[str, float]], *, share: float = 0.02, setup: float = 0.005, seed: int = 0, **layout: object
) -> Measurements:
    """A campaign read with effects, white noise as a share of the reading and scatter between set-ups."""
    description, model = kr60()
    data = campaign(seed=seed, **layout)  # type: ignore[arg-type]
    placed = tuple(effect_of(code, model, description).placed(values) for code, values in effects.items())
    exact = exactly(model, data, placed)
    rng = np.random.default_rng([seed, 1])
    number = {label: k for k, label in enumerate(dict.fromkeys(data.pose))}
    common = setup * rng.normal(size=(len(number), 6))[[number[p] for p in data.pose]]
    noisy = exact * (1.0 + share * rng.normal(size=exact.shape) + common) + 2e-6 * rng.normal(size=exact.shape)
    return replace(data, displacement=np.where(np.isnan(data.displacement), np.nan, noisy))


def exactly(model: ArmModel, data: Measurements, placed: tuple[PlacedEffect, ...]) -> np.ndarray:
    at = as_loaded(model, data.q, data.wrench, loaded_points(model, data))
    return observed(model, at, placed, history_of(data))


def setting(data: Measurements) -> Setting:
    description, model = kr60()
    return setting_of(description, model, data)


def few(s: Setting, *codes: str) -> Setting:
    """One effect of each family instead of all 150 (these codes for theirs): candidates are what takes time."""
    one_each = {s.known[code].family: code for code in [*reversed(s.known), *codes]}
    return replace(s, known={code: effect for code, effect in s.known.items() if code in one_each.values()})


@cache
def found_friction() -> Diagnosis:
    """Friction at joint 2, named, on fourteen poses."""
    s = setting(read({"friction:j2": FRICTION}, poses=14, repeats=1, share=0.01, setup=0.003))
    out = diagnose(few(s, "friction:j2", "softening:j3"))
    assert [f.code for f in out.effects] == ["friction:j2"]
    return out
