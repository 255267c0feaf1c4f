"""Two measured campaigns of positions, UR10 and UR5: how well readings are predicted that took no part.

    python benchmarks/absolute/measured_positions.py run DATA FOLDER    DATA: holds ur10_ipa/ and ur5/
    python benchmarks/absolute/measured_positions.py few DATA FOLDER    the same from 15 to 200 poses drawn at random
    python benchmarks/absolute/measured_positions.py page FOLDER        writes docs/validation/positions.md

Ten-fold: the whole estimate, variances among it, once for each tenth of the poses without it. Carried over: the arm as
found, with nothing but the other session's frame (and target, where it is another one) fitted.
"""

from __future__ import annotations

import argparse
import csv
import json
import time
from pathlib import Path

import numpy as np

from doe.absolute.calibrate import Positions, calibrate_positions
from doe.absolute.fit import fit
from doe.absolute.prediction import Predicted, carried_over, folds, left_out
from doe.absolute.readings import AbsoluteReadings, Labels, Payload
from doe.absolute.start import started
from fem import ArmModel, build_model
from robots import load_description
from robots.arrays import Array

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
EXAMPLES = ROOT / "docs" / "examples"
PAGE = ROOT / "docs" / "validation" / "positions.md"
UR10_JOINTS = ("shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3")
STEPS = {
    "frames and target": (),
    "+ geometry": ("geometry",),
    "+ joint springs under the arm's weight": ("geometry", "springs"),
    "+ periodic errors, orders 1 to 4": ("geometry", "springs", "periodic4"),
    "+ error curves, orders 1 to 48 (the default)": ("geometry", "springs", "periodic"),
}
FOLDS = 10
FEW, DRAWS = (15, 25, 50, 100, 200), 3


def columns(path: Path) -> dict[str, Array]:
    """A file's columns by name."""
    with path.open(encoding="utf-8-sig", newline="") as file:
        rows = list(csv.DictReader(file))
    return {name: np.array([float(row[name]) for row in rows]) for name in rows[0]}


def readings(q: Array, y: Array, session: str) -> AbsoluteReadings:
    """Positions of one target in one session."""
    n = np.zeros(len(q), dtype=np.int64)
    return AbsoluteReadings(
        session,
        "",
        q,
        y,
        Labels((session,), n),
        Labels((session,), n),
        n,
        (Payload(0.0, np.zeros(3)),),
        np.zeros(len(q)),
        np.full(len(q), np.nan),
        np.arange(len(q)) + 2,
    )


def ur10(data: Path, series: str) -> AbsoluteReadings:
    """Series B or C."""
    c = columns(data / "ur10_ipa" / f"ur10_{series}.csv")
    q = np.column_stack([c[f"{name}_joint"] for name in UR10_JOINTS])
    return readings(q, 1e-3 * np.column_stack([c[f"measurement_{a}"] for a in "xyz"]), f"UR10 {series}")


def ur5(data: Path, which: str) -> AbsoluteReadings:
    """The grid or the random poses: both in one frame."""
    c = columns(data / "ur5" / "UR5" / f"3D_UR5_uncalibrated_{which}_cleaned.csv")
    q = np.radians(np.column_stack([c[f"joint_{k}"] for k in range(1, 7)]))
    return readings(q, 1e-3 * np.column_stack([c[f"{a}_t"] - c[f"{a}_dif"] for a in "xyz"]), "UR5")


def ten_fold(model: ArmModel, c: Positions, *, again: bool) -> Predicted:
    """Ten-fold, with all estimated anew for each tenth, or from the whole's variances."""
    data, part = c.found.data, folds(c.found.data, FOLDS)
    if not again:
        return left_out(c.found, part)
    error, half = np.zeros((2, len(data), 3))
    for k in range(FOLDS):
        rest = data.take(part != k)
        found = fit(model, rest, c.found.layout, started(model.robot, rest))
        one = carried_over(found, data.take(part == k))[0]
        error[part == k], half[part == k] = one.error, one.half95
    return Predicted(error, half)


def figures(p: Predicted) -> dict[str, float]:
    """RMS and largest distance in mm, and the share of coordinates in their intervals."""
    return {"rms_mm": 1e3 * p.rms_m, "largest_mm": 1e3 * float(p.distance.max()), "in_interval": p.coverage.share}


def run(data: Path, folder: Path) -> None:
    """All figures, into results.json."""
    folder.mkdir(parents=True, exist_ok=True)
    arms = {name: EXAMPLES / name.lower() / f"{name.lower()}.toml" for name in ("UR10", "UR5")}
    models = {name: build_model(load_description(path), "rigid") for name, path in arms.items()}
    b, c, grid, random = ur10(data, "B"), ur10(data, "C"), ur5(data, "grid"), ur5(data, "random")
    out: dict[str, dict[str, object]] = {}
    for name, arm, table, other in (
        ("UR10 B", "UR10", b, c),
        ("UR10 C", "UR10", c, None),
        ("UR5", "UR5", grid, random),
    ):
        out[name] = {}
        for words, free in STEPS.items():
            began = time.perf_counter()
            found = calibrate_positions(models[arm], table, free, parts=FOLDS)
            one: dict[str, object] = {"seconds": time.perf_counter() - began, "fit_rms_mm": 1e3 * found.found.rms_m}
            one["ten_fold"] = figures(ten_fold(models[arm], found, again=words == list(STEPS)[-1]))
            if other is not None:
                one["carried_over"] = figures(carried_over(found.found, other)[0])
            if words == list(STEPS)[-1]:
                one |= {"wrong": [g.words for g in found.gross], "remarks": list(found.remarks)}
                one["springs"] = {
                    f.name: [f.value, *f.interval95, f.status] for f in found.findings if "stiffness" in f.name
                }
                one["scatter_mm"], one["tail"] = 1e3 * found.found.variances.sigma, found.found.tail
                one["curve"] = found.found.variances.laws["periodic"]
            out[name][words] = one
            print(name, words, one["ten_fold"], one.get("carried_over"), flush=True)
            (folder / "results.json").write_text(json.dumps(out, indent=1) + "\n", encoding="utf-8")


def few(data: Path, folder: Path) -> None:
    """Readings that took no part, predicted from few poses drawn at random, into few.json."""
    model = build_model(load_description(EXAMPLES / "ur10" / "ur10.toml"), "rigid")
    table, rows = ur10(data, "B"), []
    for n in FEW:
        for draw in range(DRAWS):
            order = np.random.default_rng(100 * n + draw).permutation(len(table))
            for free in (None, ("geometry", "springs")):
                found = calibrate_positions(model, table.take(order[:n]), free)
                other = carried_over(found.found, table.take(order[n : n + 400]))[0]
                rows.append({"poses": n, "draw": draw, "curves": free is None, **figures(other)})
                print(rows[-1], flush=True)
    (folder / "few.json").write_text(json.dumps(rows, indent=1) + "\n", encoding="utf-8")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("run", "few", "page"))
    parser.add_argument("folders", type=Path, nargs="+")
    given = parser.parse_args()
    if given.what == "run":
        run(given.folders[0], given.folders[1])
    elif given.what == "few":
        few(given.folders[0], given.folders[1])
    else:
        from measured_positions_page import page

        results = json.loads((given.folders[0] / "results.json").read_text(encoding="utf-8"))
        PAGE.write_text(page(results, given.folders[0]), encoding="utf-8")


if __name__ == "__main__":
    main()
