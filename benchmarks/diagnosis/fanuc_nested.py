"""How well the diagnosed model of the bundled FANUC campaign predicts poses that nothing of it has seen.

    python benchmarks/diagnosis/fanuc_nested.py [--splits 20] [--folds 5] [--json FILE] [--write]

Unchanged defaults; in every fold of every random split effects are chosen and all numbers fitted anew. Gear springs and
gear with tilt are refitted on the same folds. RMS of the components, mm. ``--write`` writes
benchmarks/diagnosis/results/fanuc.json, which docs/validation/fanuc.md has its figures from: a summary of the above,
and what `stiffarm calibrate` and `stiffarm diagnose` say of all readings. It takes some ten minutes.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import nnls

from benchmarks.asked import asked
from doe import bundled_data, read_measurements
from doe.certainty.folds import folds_of, pose_numbers
from doe.diagnosis.nested import FOLDS, Nested, nested
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
RESULTS = Path(__file__).parent / "results" / "fanuc.json"


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


def spread(values: Array) -> dict[str, float]:
    """Mean, ends, and how far single values are from the mean."""
    return {
        "mean": float(values.mean()),
        "least": float(values.min()),
        "most": float(values.max()),
        "deviation_percent": float(100.0 * values.std(ddof=1) / values.mean()),
    }


def said(*words: str) -> dict[str, Any]:
    """The JSON of one of our commands."""
    command = [sys.executable, "-m", "stiffarm", *words, "--json"]
    done = subprocess.run(command, capture_output=True, encoding="utf-8", check=True)  # noqa: S603
    content: dict[str, Any] = json.loads(done.stdout)
    return content


def summary(out: dict[str, Any], splits: int, folds: int) -> dict[str, Any]:
    """What the page states, mm and per cent."""
    before, after = (np.array(out["diagnosed"][key]) for key in ("springs", "nested"))
    all_readings, springs = said("diagnose", ROBOT, "--folds", "0"), said("calibrate", ROBOT)
    gap = all_readings["gap"]["after"]
    names = [*all_readings["effects"], *all_readings["provisional"]]
    return {
        "splits": splits,
        "folds": splits * folds,
        "least_squares_mm": {
            name: {
                "fit": out[name]["fit"],
                "left_out": out[name]["left_out"],
                "nested": spread(np.array(out[name]["nested"])),
            }
            for name in ("gear springs", "gear and tilt")
        },
        "diagnosed_mm": {
            "fit": gap["fit_rms_mm"],
            "left_out": gap["left_one_pose_out_rms_mm"],
            "nested": spread(after),
        },
        "better_percent": spread(100.0 * (1.0 - after / before)),
        "left_out_promises_less_by_percent": 100.0 * (1.0 - gap["left_one_pose_out_rms_mm"] / float(after.mean())),
        "found_in_folds": out["found_in_folds"],
        "verdict": all_readings["verdict"],
        "after_the_checks": all_readings["stated_probability"],
        "turned_deg": {
            name: {key: p[key] for key in ("value", "sd")}
            for e in names
            if e["code"] == "turned-frame"
            for name, p in e["parameters"].items()
            if name[0] == "r"
        },
        "looks": [{c["code"]: c["probability"] for c in look["candidates"][:4]} for look in all_readings["steps"]],
        "calibrate_mm": {key: springs[key] for key in ("rms_mm", "left_one_pose_out_rms_mm")},
    }


def main() -> None:
    a = asked(__doc__, splits=20, folds=FOLDS, json=Path, write=False)
    description = load_description(ROBOT)
    model = build_arm(description)
    data = read_measurements(bundled_data(ROBOT), model.robot)
    models = {"gear springs": ("rz",), "gear and tilt": ("rx", "ry", "rz")}
    problems = {name: least_squares(model, rows, data) for name, rows in models.items()}
    out: dict[str, Any] = {}
    for name, p in problems.items():
        out[name] = {"fit": unseen(p), "left_out": unseen(p, p.pose), "nested": []}
    out["diagnosed"], found = {"springs": [], "nested": []}, Counter[str]()
    s, pose = setting_of(description, model, data), pose_numbers(data.q)
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
    if a.write:
        RESULTS.write_text(json.dumps(summary(out, a.splits, a.folds), indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
