"""How often intervals of the compliance at other poses hold the truth: calibrated springs, propagated.

``python benchmarks/calibration/compliance_coverage.py --repeats 600``. Made-up readings of the XR701 (beam links, eight
set-ups of dx, dy and dz under one load, white noise), four constant springs fitted to all of them, the covariance
written into a model description and read from there, 95 % intervals of the vertical compliance at 50 poses that were
not read. ``--write`` writes benchmarks/calibration/results/compliance_coverage.csv, which docs/concepts/uncertainty.md
has its figures from.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import fem
from benchmarks.asked import asked
from doe import Measurements
from doe.calibration.run import run_campaign
from doe.calibration.written import with_origin
from doe.certainty.propagation import parameter_uncertainty, propagate
from doe.estimation.campaign import campaign_of
from robots import ModelDescription, load_description
from robots.arrays import Array, Bools
from robots.constants import NORMAL_95

RESULTS = Path(__file__).parent / "results" / "compliance_coverage.csv"
SET_UPS, HELD_OUT = 8, 50
LOAD = np.array([150.0, 250.0, -600.0, 0.0, 0.0, 0.0])
SOFT = {"j2": 1.45e6, "j3": 8e5, "j4": 4e5, "j5": 2.5e5}
CASES = (
    ("all springs identified", SOFT, 2e-5),
    ("one spring almost rigid", SOFT | {"j5": 2e7}, 4e-5),
    ("much noise", SOFT, 1e-4),
)


@dataclass(frozen=True)
class Study:
    """(r, n) over data sets and poses: whether the interval holds the truth, and the flags; median deviation."""

    holds: Bools
    lower_bound: Bools
    rough: Bools
    relative_sd: float
    status: Counter[str]


HEADS = (
    "case",
    "noise_um",
    "relative_sd_percent",
    "coverage_percent",
    "not_flagged_percent",
    "flagged_percent",
    "share_flagged_percent",
)


def main() -> None:
    """Print one line for each case."""
    given = asked(__doc__, repeats=100, seed=1, write=False)
    description = load_description("xr701")
    arm = fem.build_model(description)
    lines = [
        f"# python benchmarks/calibration/compliance_coverage.py --repeats {given.repeats} --seed {given.seed} --write"
    ]
    lines.append(",".join(HEADS))
    print(lines[-1])
    for number, (name, truth, noise) in enumerate(CASES):
        s = study(description, arm, truth, noise, given.repeats, np.random.default_rng([given.seed, number]))
        flagged = s.lower_bound | s.rough
        shares = [
            s.relative_sd,
            s.holds.mean(),
            *(_share(s.holds[mask]) for mask in (~flagged, flagged)),
            flagged.mean(),
        ]
        cells = ("-" if np.isnan(v) else f"{100.0 * v:.2f}" for v in shares)
        lines.append(f"{name},{noise * 1e6:g},{','.join(cells)}")
        print(lines[-1])
        print(f"# springs: {', '.join(f'{n} {what}' for what, n in s.status.most_common())}")
    if given.write:
        RESULTS.write_text("\n".join(lines) + "\n", encoding="utf-8")


def study(
    description: ModelDescription,
    arm: fem.ArmModel,
    truth: Mapping[str, float],
    noise_m: float,
    times: int,
    rng: np.random.Generator,
) -> Study:
    """Calibrate ``times`` made-up data sets, poses drawn anew for each."""
    true = arm.with_springs(truth)
    springs = campaign_of(description.name, tuple(f"{joint}.stiffness" for joint in truth))
    holds, lower, rough = (np.zeros((times, HELD_OUT), dtype=np.bool_) for _ in range(3))
    widths, status = [], Counter[str]()
    for k in range(times):
        q, others = _poses(arm, SET_UPS, rng), _poses(arm, HELD_OUT, rng)
        data = _readings(true, q, noise_m * rng.normal(size=(SET_UPS, 6)))
        fit = run_campaign(description, lambda _: arm, data, springs)
        status.update(e.status for e in fit.stages[0].certainty.estimates)
        u = parameter_uncertainty(with_origin(fit, data))
        assert u is not None
        model = fit.model
        found = propagate(model, u, others)
        error = 1.0 / (fem.directional_stiffness(true, others) * found.compliance) - 1.0
        holds[k] = np.abs(error) <= NORMAL_95 * found.relative_sd
        lower[k], rough[k] = found.is_lower_bound, found.is_rough
        widths.append(found.relative_sd)
    return Study(holds, lower, rough, float(np.median(widths)), status)


def _poses(arm: fem.ArmModel, n: int, rng: np.random.Generator) -> Array:
    low, high = arm.robot.limits.T
    q = rng.uniform(low, high, (40 * n, arm.robot.dof))
    return q[arm.robot.reachable(q)][:n]


def _readings(true: fem.ArmModel, q: Array, noise_m: Array) -> Measurements:
    n = len(q)
    moved = fem.deflection(true, q, LOAD) + noise_m
    unknown = np.full(n, np.nan)
    return Measurements(
        source="made up",
        sha256="0" * 64,
        q=q,
        wrench=np.tile(LOAD, (n, 1)),
        displacement=np.where(np.arange(6) < 3, moved, np.nan),
        sigma=unknown,
        step=unknown,
        point=np.full((n, 3), np.nan),
        pose=tuple(f"P{i + 1}" for i in range(n)),
        repeat=(None,) * n,
        phase=(None,) * n,
        row_numbers=tuple(range(2, n + 2)),
        extra={},
        notes=(),
    )


def _share(mask: Bools) -> float:
    return float(mask.mean()) if mask.size else float("nan")


if __name__ == "__main__":
    main()
