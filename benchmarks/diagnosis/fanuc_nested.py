"""How well the diagnosed model of the bundled FANUC campaign predicts poses that nothing of it has seen.

    python benchmarks/diagnosis/fanuc_nested.py [--splits 20] [--folds 5] [--json FILE]

Unchanged defaults; in every fold of every random split effects are chosen and all numbers fitted anew. Gear springs and
gear with tilt are refitted on the same folds. RMS of the components, mm.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import nnls

from doe import bundled_data, read_measurements
from doe.diagnosis.nested import FOLDS, Nested, folds_of, nested, pose_numbers
from doe.diagnosis.setting import setting_of
from doe.estimation.problem import Problem, problem
from doe.tables.loaded import rms_mm
from doe.tables.measurements import Measurements
from fem.effects import build_arm
from fem.free.parameters import parameter
from fem.model import ArmModel
from robots import load_description
from robots.arrays import Array, Integers

ROBOT = "fanuc-r2000ic"


def least_squares(model: ArmModel, rows: tuple[str, ...], data: Measurements) -> Problem:
    """Stiffnesses in these rows of every joint, free."""
    names = [f"{joint}.{row}" for joint in model.robot.joint_names for row in rows]
    return problem(model, data, [parameter(model, name) for name in names])


def unseen(p: Problem, group: Integers | None = None) -> float:
    """RMS (mm) at the readings of each group (m,), fitted on the others by plain least squares, none negative.

    None: all readings, fitted on all of them.
    """
    u = p.free.start
    value, J = p.evaluate(u)
    y, size = p.value - value + J @ u, np.linalg.norm(J, axis=0)
    error = np.zeros(len(p))
    for k in (0,) if group is None else range(int(group.max()) + 1):
        mine = np.ones(len(p), dtype=bool) if group is None else group == k
        seen = mine if group is None else ~mine
        error[mine] = (y - J / size @ nnls(J[seen] / size, y[seen])[0])[mine]
    return rms_mm(error, p.component)


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--splits", type=int, default=20)
    parser.add_argument("--folds", type=int, default=FOLDS)
    parser.add_argument("--json", type=Path)
    a = parser.parse_args()
    description = load_description(ROBOT)
    model = build_arm(description)
    data = read_measurements(bundled_data(ROBOT), model.robot)
    models = {"gear springs": ("rz",), "gear and tilt": ("rx", "ry", "rz")}
    problems = {name: least_squares(model, rows, data) for name, rows in models.items()}
    out: dict[str, Any] = {}
    for name, p in problems.items():
        out[name] = {"fit": unseen(p), "left_out": unseen(p, p.pose), "nested": []}
    out["diagnosed"], found = {"springs": [], "nested": []}, Counter[str]()
    s, pose = setting_of(description, model, data), pose_numbers(data)
    row = np.nonzero(data.used)[0]
    for seed in range(a.splits):
        n: Nested = nested(s, data, folds=a.folds, seed=seed)
        fold: Array = folds_of(pose, a.folds, seed)[row]
        for name, p in problems.items():
            out[name]["nested"].append(unseen(p, fold))
        out["diagnosed"]["springs"].append(n.rms_before_mm)
        out["diagnosed"]["nested"].append(n.rms_after_mm)
        found.update(code for codes in n.found for code in codes)
        better = 1.0 - n.rms_after_mm / n.rms_before_mm
        sys.stderr.write(f"split {seed + 1}: {n.rms_before_mm:.4f} -> {n.rms_after_mm:.4f} mm, {100 * better:.1f} %\n")
        out["found_in_folds"] = dict(found.most_common())
        if a.json:
            a.json.write_text(json.dumps(out, indent=1))
    for name in (*models, "diagnosed"):
        mm = np.array(out[name]["nested"])
        sys.stdout.write(f"{name}: {mm.mean():.4f} mm over unseen poses ({mm.min():.4f} to {mm.max():.4f})\n")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
