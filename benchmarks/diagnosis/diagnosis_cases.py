"""One blind set through the diagnosis, and what came of it; for ``diagnosis_study.py`` and its test."""

from __future__ import annotations

import sys
import tempfile
import time
from dataclasses import asdict, dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from doe.diagnosis.diagnose import Diagnosis, diagnose
from doe.diagnosis.hypotheses import Options
from doe.diagnosis.setting import setting_of
from doe.diagnosis.where import applied
from doe.tables.loaded import rms_mm
from doe.tables.measurements import Measurements
from doe.tables.reading import read_measurements
from fem import ArmModel, build_model
from rehearsal.scoring import DETECTABLE, family
from robots import ModelDescription, load_description

# The root, not its folder of tests: that has folders with the names of packages.
sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from robots.arrays import Array
from tests.blind.sets import make, truth_at
from tests.blind.spec import SetSpec
from tests.blind.study import suite

__all__ = ["ABLATIONS", "DETECTABLE", "Row", "SetSpec", "family", "run_set", "suite"]

# Poses at which the truth is known without noise, to judge the models before and after.
UNSEEN = 40
ABLATIONS = {
    "as it is": Options(),
    "no scatter between set-ups": Options(pose_term=False),
    "no priors": Options(priors=False),
    "BIC in place of evidence": Options(by="bic"),
    "left-out poses in place of evidence": Options(by="left-out"),
}


@dataclass(frozen=True)
class Row:
    """What came of one set.

    ``found``: codes taken up, the ``sure`` ones first; ``probability``: of the first, or of the best hypothesis;
    ``imitation``: chi-square that the best single effect of the catalogue leaves of one that is not in it;
    ``before``, ``after``: error in mm on poses that were not read, against the truth without noise.
    """

    name: str
    group: str
    robot: str
    effects: tuple[str, ...]
    setup: float
    excess: float
    imitation: float
    verdict: str
    found: tuple[str, ...]
    sure: int
    odds: float
    probability: float
    set95: tuple[str, ...]
    not_testable: tuple[str, ...]
    before: float
    after: float
    seconds: float

    def as_dict(self) -> dict[str, Any]:
        """Plain values."""
        return asdict(self)


@cache
def described(text: str) -> ModelDescription:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "model.toml"
        path.write_text(text, encoding="utf-8")
        return load_description(str(path))


@cache
def arm(text: str, links: str) -> ArmModel:
    return build_model(described(text), links)  # type: ignore[arg-type]


def opened(csv_text: str, model: ArmModel) -> Measurements:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "readings.csv"
        path.write_text(csv_text, encoding="utf-8")
        return read_measurements(path, model.robot)


def run_set(spec: SetSpec, seed: int, options: Options) -> Row:
    """Make a set, diagnose it, and compare with the key."""
    made = make(spec, seed)
    model = arm(made.model_toml, made.links)
    data = opened(made.csv_text, model)
    start = time.perf_counter()
    s = setting_of(described(made.model_toml), model, data)
    d = diagnose(s, options)
    seconds = time.perf_counter() - start
    # What drifts with the clock cannot be foretold from the pose.
    before, after = (np.nan, np.nan) if "drift" in spec.effects else unseen_errors(spec, seed, d)
    found = d.found
    top = d.rankings[0].best
    return Row(
        spec.name, spec.group, spec.robot, tuple(spec.effects), spec.setup_scatter, float(made.key["excess_chi2"]),
        float(made.key.get("best_imitation", {}).get("excess_chi2_left", np.nan)), d.verdict,
        tuple(f.code for f in found), len(d.effects), d.odds, found[0].probability if found else top.probability,
        d.rankings[0].credible(), tuple(d.not_testable()), before, after, seconds,
    )  # fmt: skip


def unseen_errors(spec: SetSpec, seed: int, d: Diagnosis) -> tuple[float, float]:
    """RMS error (mm) of the models before and after, on other poses, against the truth without noise."""
    robot = d.start.model.robot
    rng = np.random.default_rng([seed, 77])
    middle, half = robot.limits.mean(axis=1), 0.4 * np.ptp(robot.limits, axis=1)
    q = middle + half * rng.uniform(-1.0, 1.0, (6 * UNSEEN, robot.dof))
    q = q[robot.reachable(q)][:UNSEEN]
    # Within the angles and at the loads that were read.
    loads = np.unique(np.round(d.start.data.free.at.wrench[:, 2], 6))
    loads = loads[np.argsort(np.abs(loads))]
    sheet = sheet_of(robot.coordinates, np.degrees(np.repeat(q, len(loads), axis=0)), np.tile(loads, len(q)))
    truth = truth_at(spec, seed, sheet)
    read = np.full((len(truth), 6), np.nan)
    components = np.unique(d.start.data.component)
    read[:, components] = truth[:, components]
    known = replace(opened(filled(sheet), d.start.model), displacement=read)
    before, after = (applied(state.setting, known) for state in (d.before, d.after))
    return rms_mm(before.residual, before.data.component), rms_mm(after.residual, after.data.component)


def sheet_of(coordinates: tuple[str, ...], q_deg: Array, fz: Array) -> str:
    """A sheet with single loadings."""
    lines = [",".join([*coordinates, "fz_N", "phase", "pose", "repeat", "dz_mm"])]
    number = 0
    for k, (row, load) in enumerate(zip(q_deg, fz, strict=True)):
        if k == 0 or not np.array_equal(row, q_deg[k - 1]):
            number += 1
        lines.append(",".join([*(f"{v:.6f}" for v in row), f"{load:g}", "loading", f"U{number}", "1", ""]))
    return "\n".join(lines) + "\n"


def filled(sheet: str) -> str:
    """The sheet with a number in every cell, for the reader's sake."""
    head, *rows = sheet.strip().split("\n")
    return "\n".join([head, *(f"{row}-0.5" for row in rows)]) + "\n"
