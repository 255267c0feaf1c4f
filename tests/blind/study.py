"""The sets of a whole study, balanced over effects and robots."""

from __future__ import annotations

from dataclasses import replace
from itertools import zip_longest
from typing import Any

import numpy as np

from rehearsal.scoring import DETECTABLE

from . import outside
from .sets import make
from .spec import SetSpec

ROBOTS = ("xr701", "kr60-3")
SCATTER = (0.0, 0.005, 0.015)
# Never in a pair: what can hardly be seen in Z by itself would say nothing about pairs.
WEAK = ("gauge-scale", "joint-compliance:j1", "joint-tilt:j2", "joint-tilt:j3", "joint-tilt:j4", "link-flexibility")
# Two of one group give a joint two laws for the same torque, or a table two zeros.
GROUPS = (("hardening", "softening", "backlash", "friction"), ("gauge-zero", "drift"))


# Kinds that are tried, and where; the study is balanced over these.
PLACES: dict[str, tuple[str, ...]] = {
    "joint-compliance": ("j4", "j5", "j1"),
    "joint-tilt": ("j1", "j2", "j3", "j4"),
    "angle-dependent-stiffness": ("j2", "j3", "j5"),
    "hardening": ("j2", "j3", "j5"),
    "softening": ("j2", "j3", "j5"),
    "backlash": ("j2", "j3", "j5"),
    "friction": ("j2", "j3"),
    "payload": (),
    "gravity-compensator": ("j2",),
    "base-tilt": (),
    "base-vertical": (),
    "parallelogram-bar": (),
    "load-path": (),
    "link-flexibility": ("forearm", "upper-arm", "carousel"),
    "tool-compliance": (),
    "load-point-offset": (),
    "load-misalignment": (),
    "joint-zero-offset": ("j2", "j3", "j5"),
    "gauge-zero": (),
    "gauge-scale": (),
    "drift": (),
    "gear-ripple": ("j2", "j3"),
    "wrist-coupling": (),
}


def codes(robot: str) -> list[str]:
    """Every code tried on a robot."""
    found = []
    for kind, places in PLACES.items():
        if robot != "xr701" and kind in ("parallelogram-bar", "load-path"):
            continue
        found += [f"{kind}:{where}" for where in places] or [kind]
    return found


def settings(robot: str, effects: tuple[str, ...], rng: np.random.Generator) -> dict[str, Any]:
    """What varies from set to set beside the effect; drawn, for in turn it would go with robot or place."""
    values: dict[str, Any] = {
        "robot": robot,
        "effects": effects,
        "setup_scatter": float(rng.choice(SCATTER)),
        "links": "beam" if rng.random() < 0.5 or any(e.startswith("link-") for e in effects) else "rigid",
        "order": "sorted" if rng.random() < 0.25 else "random",
    }
    if "load-path" in effects and rng.random() < 0.5:
        values["model_path"] = "other"
    return values


def none_settings(k: int, rng: np.random.Generator) -> dict[str, Any]:
    """Nothing hidden; robots and set-up scatters in equal shares."""
    return settings(ROBOTS[k % 2], (), rng) | {"setup_scatter": SCATTER[k // 2 % 3]}


def singles(count: int, rng: np.random.Generator) -> list[SetSpec]:
    """Kinds in turn, so that each has the same share; within a kind the robots and places in turn."""
    by_kind: dict[str, list[tuple[str, str]]] = {}
    for robot in ROBOTS:
        for code in codes(robot):
            by_kind.setdefault(code.split(":")[0], []).append((robot, code))
    for kind, places in by_kind.items():
        # Robots alternate, each going through its places.
        where = {robot: [p for p in places if p[0] == robot] for robot in ROBOTS}
        by_kind[kind] = [p for both in zip_longest(*where.values()) for p in both if p is not None]
    kinds, found = list(by_kind), []
    # Kinds begin with either robot, so that a small study has both.
    turn = {kind: i % 2 for i, kind in enumerate(kinds)}
    for k in range(count):
        kind = kinds[k % len(kinds)]
        places = by_kind[kind]
        robot, code = places[turn[kind] % len(places)]
        turn[kind] += 1
        found.append(SetSpec(**settings(robot, (code,), rng), group="single"))
    return found


def partners(robot: str, rng: np.random.Generator) -> tuple[str, str]:
    """Two codes of different kinds that do not speak about the same law."""
    pool = [code for code in codes(robot) if not code.startswith(WEAK)]
    while True:
        a, b = (pool[i] for i in rng.choice(len(pool), 2, replace=False))
        kinds = {a.split(":")[0], b.split(":")[0]}
        if len(kinds) == 2 and not any(kinds <= set(group) for group in GROUPS):
            return a, b


def suite(
    n_single: int = 300, n_none: int = 200, n_out: int = 100, n_pairs: int = 60, seed: int = 0, **changes: Any
) -> list[tuple[SetSpec, int]]:
    """Specs and seeds of a study; ``changes`` go into every spec (as in ``reads="xyz"``, ``poses=9``).

    Pairs are drawn again until each effect by itself is detectable.
    """
    rng = np.random.default_rng([seed, 999])
    specs = singles(n_single, rng)
    for k in range(n_none):
        specs.append(SetSpec(**none_settings(k, rng), group="none"))
    kinds = list(outside.KINDS)
    for k in range(n_out):
        values = settings(ROBOTS[k // len(kinds) % 2], (kinds[k % len(kinds)],), rng)
        specs.append(SetSpec(**values, group="outside"))
    seeds = [int(s) for s in rng.integers(2**31, size=n_single + n_none + n_out)]
    chosen = [(with_changes(spec, changes), s) for spec, s in zip(specs, seeds, strict=True)]
    for k in range(n_pairs):
        chosen.append(pair(k, rng, changes))
    # Names tell nothing: the group stands in the key.
    return [(replace(spec, name=f"set-{s:010d}"), s) for spec, s in chosen]


def with_changes(spec: SetSpec, changes: dict[str, Any]) -> SetSpec:
    values = spec.as_dict() | changes
    if any(e.startswith("link-") for e in spec.effects):
        values["links"] = "beam"
    if values["robot"] != "xr701" and values["design"] == "paper":
        values["design"] = "filling"  # the paper's poses are the xr701's
    return SetSpec.from_dict(values)


def pair(k: int, rng: np.random.Generator, changes: dict[str, Any]) -> tuple[SetSpec, int]:
    """One pair of which each effect is detectable alone, and the two together."""
    robot = ROBOTS[k % 2]
    while True:
        spec = SetSpec(**settings(robot, partners(robot, rng), rng), group="pair")
        spec, seed = with_changes(spec, changes), int(rng.integers(2**31))
        key = make(spec, seed).key
        if key["detectable"] and min(key["excess_chi2_each"].values()) >= DETECTABLE:
            return spec, seed
