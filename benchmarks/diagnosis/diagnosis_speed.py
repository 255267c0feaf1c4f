"""One diagnosis with the full catalogue, against refitting every candidate with numerical derivatives.

    python benchmarks/diagnosis/diagnosis_speed.py [--candidates 12] [--json]

The plain way fits springs and an effect's numbers by ``scipy.optimize.least_squares`` from each point of the shapes'
grid's middle, one candidate after the other, on the same model; it is timed on some candidates and scaled up.
"""

from __future__ import annotations

import argparse
import json
import statistics
import sys
import tempfile
import time
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares

# The root, not its folder of tests: that has folders with the names of packages.
sys.path.insert(0, str(Path(__file__).parents[2]))

from benchmarks.diagnosis.study.sets import study_sets
from doe.diagnosis.diagnose import diagnose
from doe.diagnosis.ranking import rank
from doe.diagnosis.setting import Setting, setting_of, with_compliances
from doe.diagnosis.signatures import prior, shape_count
from doe.tables.measurements import Measurements
from fem.arm import Arm
from fem.effects.base import Effect, PlacedEffect
from robots.arrays import Array
from stiffarm.session.inputs import read_model
from stiffarm.session.readings import read_data
from tests.blind.sets import make, unseen
from tests.blind.spec import SetSpec

SPEC, SEED = SetSpec(robot="kr60-3", effects=("payload",)), 4
REPEATS = 3


@dataclass(frozen=True)
class Result:
    """Seconds for the whole, and the ratio."""

    readings: int
    candidates: int
    shapes: int
    diagnosis_s: float
    one_ranking_s: float
    plain_s: float

    @property
    def ratio(self) -> float:
        """How many times as long refitting takes as one ranking of all candidates."""
        return self.plain_s / self.one_ranking_s

    @property
    def ratio_of_all_shapes(self) -> float:
        """The same if every shape that the ranking weighs is refitted, as a law that bends may need."""
        return self.ratio * self.shapes / self.candidates


def drawn() -> tuple[Arm, Measurements]:
    """Arm and readings of one set of our second world."""
    with tempfile.TemporaryDirectory() as folder:
        make(SPEC, SEED).write(Path(folder), unseen(SPEC, SEED))
        (one,) = study_sets(Path(folder))
        given = read_model(one.model, one.file.links, one.file.load_path)
        return given, read_data(given.robot, one.readings)


def refitted(s: Setting, effect: Effect) -> float:
    """Least sum of squares with springs and the effect's numbers free, by numerical derivatives."""
    f0 = s.prediction
    sd = np.sqrt((0.03 * f0) ** 2 + 1e-12)
    start = [0.5 * sum(p.size) if p.role == "amplitude" else p.grid[len(p.grid) // 2] for p in effect.parameters]
    scale = np.concatenate(
        [
            s.typical,
            [
                prior(p)[1] if p.role == "amplitude" else abs(v) + 1e-9
                for p, v in zip(effect.parameters, start, strict=True)
            ],
        ]
    )

    def residual(x: Array) -> Array:
        v = x * scale
        springs = np.maximum(v[: len(s.free)], 0.0)
        model = with_compliances(s.model, s.free, springs)
        values = v[len(s.free) :].copy()
        for k, p in enumerate(effect.parameters):
            if p.role == "shape":
                values[k] = np.clip(values[k], min(p.grid), max(p.grid))
        f = s.read(model, [PlacedEffect(effect, values)])
        return np.asarray((s.data.value - f) / sd)

    x0 = np.concatenate([s.springs, start]) / scale
    return float(least_squares(residual, x0, xtol=1e-6, ftol=1e-6, max_nfev=60).cost)


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--candidates", type=int, default=12, help="how many to time the plain way on")
    parser.add_argument("--json", action="store_true", help="one JSON object on stdout")
    a = parser.parse_args()
    given, data = drawn()
    s = setting_of(given.description, given.model, data)
    weight = np.ones(len(s.data))
    seconds: dict[str, list[float]] = {"ranking": [], "diagnosis": []}
    for _ in range(REPEATS):
        start = time.perf_counter()
        ranking = rank(setting_of(given.description, given.model, data), weight)
        seconds["ranking"].append(time.perf_counter() - start)
        start = time.perf_counter()
        diagnose(setting_of(given.description, given.model, data))
        seconds["diagnosis"].append(time.perf_counter() - start)
    codes = [h.code for h in ranking.hypotheses if h.code in s.known]
    some = [codes[i] for i in np.linspace(0, len(codes) - 1, a.candidates).astype(int)]
    start = time.perf_counter()
    for code in some:
        refitted(s, s.known[code])
    plain = (time.perf_counter() - start) * len(codes) / len(some)
    shapes = sum(shape_count(s.known[code]) for code in codes)
    result = Result(
        len(s.data),
        len(codes),
        shapes,
        statistics.median(seconds["diagnosis"]),
        statistics.median(seconds["ranking"]),
        plain,
    )
    if a.json:
        json.dump(
            {**asdict(result), "ratio": result.ratio, "ratio_of_all_shapes": result.ratio_of_all_shapes},
            sys.stdout,
            indent=2,
        )
        sys.stdout.write("\n")
        return 0
    sys.stdout.write(
        f"{result.readings} readings, {result.candidates} candidates: one ranking {result.one_ranking_s:.2f} s, whole "
        f"diagnosis {result.diagnosis_s:.2f} s; refitting each candidate once with numerical derivatives "
        f"{result.plain_s:.0f} s (timed on {len(some)}): ratio {result.ratio:.1f}; from each of the {result.shapes} "
        f"shapes that the ranking weighs: {result.ratio_of_all_shapes:.0f}\n"
    )
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
