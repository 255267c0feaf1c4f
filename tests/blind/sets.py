"""Make one set, measure more of it, and lay out the sets of a study."""

from __future__ import annotations

import dataclasses
import json
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from rehearsal import nuisance
from rehearsal.design import between
from rehearsal.evaluate import Truth, exact
from rehearsal.excess import excess_chi2
from rehearsal.kinematics import allowed
from rehearsal.noise import Noise
from rehearsal.readings import Readings
from rehearsal.scoring import DETECTABLE
from rehearsal.world import Sizes, drawn, spring_factors, stream, torques
from robots.arrays import Array

from . import outside
from .design import campaign
from .imitation import best_imitation
from .model_files import LOADS, UPRIGHT, arm, free_joints, model_parallelogram, model_toml
from .spec import SetSpec
from .table import fill, from_sheet, to_csv


@dataclass(frozen=True)
class MadeUp:
    """A set: the table and the model the workflow may see, and the key it may not."""

    name: str
    csv_text: str
    model_toml: str
    links: str
    key: dict[str, Any]

    def write(self, folder: Path, unseen: str) -> None:
        """The set for `benchmarks.diagnosis.study`: a folder of its name with set.json, model, tables and key."""
        here = folder / self.name
        here.mkdir(parents=True, exist_ok=True)
        told = {"schema": "stiffarm-study-set/1", "model": "model.toml", "links": self.links}
        (here / "set.json").write_text(json.dumps(told, indent=1) + "\n", encoding="utf-8")
        (here / "model.toml").write_text(self.model_toml, encoding="utf-8")
        (here / "readings.csv").write_text(self.csv_text, encoding="utf-8")
        (here / "unseen.csv").write_text(unseen, encoding="utf-8")
        (here / "key.json").write_text(json.dumps(self.study_key(), indent=1) + "\n", encoding="utf-8")

    def study_key(self) -> dict[str, Any]:
        """The key in the words of a study, with all of the truth behind them."""
        key, spec = self.key, self.key["spec"]
        each = key.get("excess_chi2_each", {})
        effects = [
            {"code": e["code"], "excess_chi2": each.get(e["code"], key["excess_chi2"]), "parameters": e}
            | dict(zip(("axis", "place"), outside.WHERE.get(e["kind"], ([], e["code"].partition(":")[2])), strict=True))
            for e in key["truth"]
        ]
        tags = {name: spec[name] for name in ("robot", "reads", "poses", "links", "order", "repeats")}
        tags |= {"noise": "share-of-component", "scatter": spec["setup_scatter"]}
        rest = {name: key[name] for name in ("springs_Nm_per_rad", "noise", "nuisance", "seed", "spec")}
        return {
            "schema": "stiffarm-study-key/1",
            "world": "rehearsal",
            "effects": effects,
            "excess_chi2": key["excess_chi2"],
            "tags": tags,
            **rest,
        }


@lru_cache(maxsize=16)
def hidden(spec: SetSpec, seed: int) -> tuple[Truth, Readings, Noise]:
    """Truth, campaign and noise of a set; the same for the same spec and seed."""
    nominal = arm(spec.robot)
    readings = campaign(nominal, spec, stream(seed, 1))
    if spec.model_path == "other" and "load-path" not in spec.effects:
        raise ValueError("a model with the other load path hides load-path: name it among the effects")
    springs = np.array([np.inf if k is None else k for k in nominal.stiffness]) * spring_factors(6, seed)
    top = np.array([0, 0, -LOADS[spec.robot][-1], 0, 0, 0])
    sizes = Sizes(torques(nominal, np.unique(readings.q, axis=0), top), UPRIGHT[spec.robot])
    # A joint that the XR701's model lacks has any spring: none was published.
    own = spec.robot != "xr701"
    effects = drawn(nominal, spec.effects, springs, sizes, seed, laws=spec.laws, more=outside.KINDS, own=own)
    for effect in effects:
        if effect["kind"] == "load-path" and spec.model_path == "other":
            # The model is given the other path; the truth stays with the robot's own.
            effect["law"] = "parallelogram" if nominal.parallelogram else "serial"
    errors = nuisance.draw(nominal, stream(seed, 3), spec.weight_error) if spec.nuisance else nuisance.nothing(nominal)
    floor = stream(seed, 4).uniform(2, 5) if spec.floor_um is None else spec.floor_um
    noise = Noise(spec.noise_share, floor * 1e-6, spec.resolution_um * 1e-6, spec.setup_scatter)
    truth = Truth(nominal, 1 / springs, spec.links, errors, tuple(effects), seed, outside.STRANGERS)
    return truth, readings, noise


def judged(spec: SetSpec, truth: Truth, r: Readings, noise: Noise) -> dict[str, Any]:
    """Chi-square excesses of the effect alone, with the nuisance, and of the nuisance alone; Z and XYZ."""
    model = dataclasses.replace(arm(spec.robot), parallelogram=model_parallelogram(spec))
    free = free_joints(spec)
    clean = dataclasses.replace(truth, nuisance=nuisance.nothing(truth.arm))
    # Nothing hidden: the joint the model lacks is rigid, and the path is the model's.
    base = truth.compliance.copy()
    base[[j for j in range(6) if j not in free]] = 0
    plain = dataclasses.replace(truth, effects=(), compliance=base, arm=model)
    cases = {"excess_chi2": clean, "excess_chi2_with_nuisance": truth, "excess_chi2_nuisance_alone": plain}
    out: dict[str, Any] = {}
    for name, case in cases.items():
        d = exact(case, r)
        for label, axes in (("z", [2]), ("xyz", [0, 1, 2])):
            out[f"{name}_{label}"] = round(excess_chi2(model, free, spec.links, r, d, noise, axes)[0], 2)
    if len(truth.effects) > 1:
        out["excess_chi2_each"] = {e["code"]: round(alone(spec, clean, e, r, noise), 2) for e in truth.effects}
    read = spec.reads
    if any(e["kind"] in outside.KINDS for e in truth.effects):
        axes = ["xyz".index(axis) for axis in read]
        code, left = best_imitation(model, free, spec.links, r, exact(clean, r), noise, axes)
        out["best_imitation"] = {"code": code, "excess_chi2_left": round(left, 2)}
    out["excess_chi2"] = out[f"excess_chi2_{read}"]
    out["detectable"] = out["excess_chi2"] >= DETECTABLE
    out["detectable_z"] = out["excess_chi2_z"] >= DETECTABLE
    out["detectable_xyz"] = out["excess_chi2_xyz"] >= DETECTABLE
    return out


def alone(spec: SetSpec, clean: Truth, effect: dict[str, Any], r: Readings, noise: Noise) -> float:
    """Excess of one effect of several by itself, in the axes read."""
    single = dataclasses.replace(spec, effects=(effect["code"],))
    if effect["kind"] != "load-path":
        single = dataclasses.replace(single, model_path="own")
    model = dataclasses.replace(arm(spec.robot), parallelogram=model_parallelogram(single))
    c = clean.compliance.copy()
    if effect["kind"] != "joint-compliance":
        c[[j for j in range(6) if j not in free_joints(single)]] = 0
    d = exact(dataclasses.replace(clean, effects=(effect,), compliance=c), r)
    axes = ["xyz".index(axis) for axis in spec.reads]
    return excess_chi2(model, free_joints(single), spec.links, r, d, noise, axes)[0]


def make(spec: SetSpec, seed: int) -> MadeUp:
    """One set: table, model to start from, key. The same seed gives the same set, byte for byte."""
    truth, r, noise = hidden(spec, seed)
    clean = exact(truth, r)
    d = noise.read(r, clean, stream(seed, 5))
    name = spec.name or f"set-{seed}"
    reads = [("x", "y", "z").index(axis) for axis in spec.reads]
    key = {
        "schema": "stiffarm-blind-key/1",
        "name": name,
        "group": spec.group,
        "robot": spec.robot,
        "effects": list(spec.effects),
        "truth": [dict(e) for e in truth.effects],
        "springs_Nm_per_rad": [None if c == 0 else float(1 / c) for c in truth.compliance],
        "free_joints": [f"j{j + 1}" for j in free_joints(spec)],
        "links": spec.links,
        "model_load_path": "parallelogram" if model_parallelogram(spec) else "serial",
        "noise": dataclasses.asdict(noise),
        "nuisance": truth.nuisance,
        "deflection_rms_mm": float(1e3 * np.sqrt(np.mean(clean[:, reads] ** 2))),
        **judged(spec, truth, r, noise),
        "spec": spec.as_dict(),
        "seed": seed,
    }
    return MadeUp(name, to_csv(arm(spec.robot), r, d, spec.reads), model_toml(spec), spec.links, key)


def more(spec: SetSpec, seed: int, sheet: str, salt: int = 1, taken: int = 0) -> str:
    """A proposed measurement sheet (CSV text) with readings of the same hidden truth filled in.

    Every pose is set up anew, noise is fresh (``salt`` numbers the visit), and the clock goes on after ``taken``
    extra readings. Joint columns, loads, ``phase``, ``repeat`` and ``step`` are honoured as the sheet has them
    (see ``table.from_sheet``); the axes read are those the sheet has columns for, else the set's.
    """
    truth, r, noise = hidden(spec, seed)
    rows, order, extra = from_sheet(truth.arm, sheet, int(r.setup.max()) + 1, max(LOADS[spec.robot]))
    extra = dataclasses.replace(extra, clock=extra.clock + taken / len(r))
    if not rows:
        raise ValueError("the sheet has no rows")
    d = noise.read(extra, exact(truth, extra), np.random.default_rng([seed, 6, salt]))
    return fill(rows, order, d, spec.reads)


def truth_at(spec: SetSpec, seed: int, sheet: str) -> Array:
    """Exact displacements (n, 3) in m for the rows of a sheet: what held-out errors are compared with."""
    truth, r, _ = hidden(spec, seed)
    _, order, extra = from_sheet(truth.arm, sheet, int(r.setup.max()) + 1, max(LOADS[spec.robot]))
    out = np.zeros((len(order), 3))
    out[order] = exact(truth, extra)
    return out


def unseen(spec: SetSpec, seed: int, poses: int = 40) -> str:
    """Other set-ups within the angles read, at the loads read, without noise: what held-out errors are taken from."""
    truth, r, _ = hidden(spec, seed)
    low, high = r.q.min(axis=0), r.q.max(axis=0)
    q = between(
        truth.arm,
        (low + high) / 2,
        (high - low) / 2,
        poses,
        np.random.default_rng([seed, 77]),
        lambda q: allowed(truth.arm, q),
    )
    loads = np.unique(r.force, axis=0)
    n = len(q) * len(loads)
    count = np.arange(n)
    other = Readings(
        np.repeat(q, len(loads), axis=0),
        np.tile(loads, (len(q), 1)),
        np.repeat(np.arange(len(q)), len(loads)),
        count,
        np.zeros(n, dtype=bool),
        np.ones(n, dtype=np.int64),
        np.full(n, 0.5),
        np.zeros((n, 3)),
    )
    return to_csv(truth.arm, other, exact(truth, other), spec.reads, label="U")
