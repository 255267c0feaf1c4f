"""Tables of a calibration: its parameters, readings, outliers, and springs at single poses."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, Final

import numpy as np

from doe.calibration.prediction import Holdout
from doe.certainty.lack_of_fit import outliers
from doe.certainty.uncertainty import ParameterEstimate
from doe.estimation.estimate import Estimate
from doe.tables.columns import DISPLACEMENTS
from doe.tables.joined import files_of
from doe.tables.loaded import rms_mm
from robots.arrays import Array
from robots.quantities import Quantity, length, rounded
from stiffarm.commands.calibrate import words
from stiffarm.commands.calibrate.step import Calibrated, StageFindings
from stiffarm.result import Number, Table

VALUE, BEFORE = Quantity("value", label="value", digits=3), Quantity("before", label="the model had", digits=3)
SPRING: Final = Quantity("stiffness", "N m/rad", digits=3)
ERROR: Final = length("error")
LOAD: Final = Quantity("load", "N")
# Of translations in mm, of rotations in mrad.
MEASURED, PREDICTED, LEFT_OUT, HALF = (
    Quantity(key, "", 1e3, label, 3)
    for key, label in (
        ("measured", "measured, mm or mrad"),
        ("simulated", "simulated"),
        ("left_out_error", "error where its pose is left out"),
        ("left_out_half_width95", "half width of its 95 % interval"),
    )
)
QUANTILES: Final = {Quantity("low95"): 0.025, Quantity("median"): 0.5, Quantity("high95"): 0.975}
AT_BOUND: Final = Quantity("share_at_bound", "", 1.0, "share at a bound", 3, 3)
RMS, EXPECTED = length("rms", "RMS"), length("noise", "the scatter alone")
POSES_OUT: Final = length("left_one_pose_out_rms", "RMS at poses left out")
RESIDUAL: Final = length("residual_sd", "standard deviation of a residual")
# A value this close to an end of its range (relative) stands there.
_AT_END: Final = 1e-3


def tables_of(c: Calibrated) -> tuple[Table, ...]:
    """All of them, those that are not empty."""
    return (
        *([parameters(c)] if c.found.stages else []),
        *([springs_at_poses(c)] if c.found.studies else []),
        *(bootstrap(s) for s in c.stages if s.drawn is not None),
        *outlier_tables(c),
        *([held_out(c.holdout)] if c.holdout is not None else []),
        readings(c),
    )


def numbers_of(c: Calibrated) -> dict[Quantity, Number]:
    """Its single numbers."""
    out = {RMS: Number(1e-3 * c.found.rms_mm), POSES_OUT: Number(1e-3 * c.left_out_rms_mm)}
    return out | ({RESIDUAL: Number(c.found.stages[-1].estimate.noise.white[0])} if c.found.stages else {})


def parameters(c: Calibrated) -> Table:
    """Every parameter with its interval; no value where it stands at a bound or is not identified."""
    every = [(s.stage.name, e) for s in c.found.stages for e in s.certainty.estimates]
    some = [e for _, e in every]
    ends = np.array([e.interval for e in some]).reshape(-1, 2)
    return Table(
        "parameters",
        f"{len(some)} parameters on {len(c.found.overall)} readings",
        {
            **({"stage": [name for name, _ in every]} if len(c.found.stages) > 1 else {}),
            "name": [e.parameter.name for e in some],
            "unit": [e.parameter.unit for e in some],
            "status": [e.status for e in some],
            "bound": [words.bound_of(e) or "" for e in some],
        },
        {VALUE: np.array([e.value if words.known(e) else np.nan for e in some])},
        {VALUE: (ends[:, 0], ends[:, 1])},
        {BEFORE: np.array([e.parameter.value for e in some])},
        {key: [extra[key] for extra in map(_extra, some)] for key in _extra(some[0])} if some else {},
    )


def _extra(e: ParameterEstimate) -> dict[str, Any]:
    p = e.parameter
    return {
        "variable": {"compliance": "1/value", "log": "ln value", "linear": "value"}[p.scale],
        "sd_of_variable": rounded(e.sd),
        "degrees_of_freedom": rounded(e.degrees_of_freedom),
        "range": [rounded(p.lower), rounded(p.upper)],
        "prior": None if p.prior is None else {"mean": rounded(p.prior[0]), "sd": rounded(p.prior[1])},
    }


def springs_at_poses(c: Calibrated) -> Table:
    """Springs that were found pose by pose, and what would match the readings as well."""
    every = [
        (s.stage.name, fit, joint, k, ends)
        for s in c.found.studies
        for fit in s.fits
        for joint, k, ends in zip(fit.joints, fit.stiffness, fit.equivalent, strict=True)
    ]
    ends = np.array([one[4] for one in every])
    fits = [one[1] for one in every]
    return Table(
        "studies",
        "Springs at single poses; in brackets what would match the readings as well",
        {
            "stage": [one[0] for one in every],
            "pose": [fit.pose for fit in fits],
            "joint": [one[2] for one in every],
            "matched": [fit.matched for fit in fits],
        },
        {
            SPRING: np.array([one[3] for one in every]),
            ERROR: 1e-3 * np.array([fit.error_mm for fit in fits]),
        },
        {SPRING: (ends[:, 0], ends[:, 1])},
        {Quantity(what): np.array([getattr(fit, what) for fit in fits], dtype=float) for what in ("runs", "rounds")},
    )


def _where(c: Calibrated, s: StageFindings | None, rows: Sequence[int]) -> dict[str, list[str | bool]]:
    """Stage, file, line, pose and component of components read."""
    read = c.data if s is None else s.read
    p, files = (c.found.overall if s is None else s.result.estimate.problem), files_of(read)
    stage = {"stage": [s.result.stage.name] * len(rows)} if s is not None and len(c.stages) > 1 else {}
    file = {} if files is None else {"file": [files[p.row[k]] for k in rows]}
    return {
        **stage,
        **file,
        "line": [str(read.row_numbers[p.row[k]]) for k in rows],
        "pose": [p.poses[p.pose[k]] for k in rows],
        "component": [DISPLACEMENTS[p.component[k]] for k in rows],
    }


def readings(c: Calibrated) -> Table:
    """Every component read, as simulated, and by a calibration that has not seen its pose."""
    p = c.found.overall
    return Table(
        "poses",
        "Every reading",
        _where(c, None, range(len(p))),
        {
            MEASURED: p.value,
            PREDICTED: p.value - c.found.residual,
            # Simulated minus measured, as in the staged scheme.
            LEFT_OUT: -c.left_out,
            HALF: c.left_out_half95,
        },
        folded=True,
    )


def outlier_tables(c: Calibrated) -> list[Table]:
    """Readings that stand out in each stage, farthest first; none or one table."""
    several = [(s, s.result.estimate, outliers(s.result.estimate)) for s in c.stages]
    several = [one for one in several if len(one[2])]
    if not several:
        return []
    labels = [_where(c, s, list(rows)) for s, _, rows in several]

    def joined(of: Callable[[StageFindings, Estimate], Array]) -> Array:
        return np.concatenate([of(s, e)[rows] for s, e, rows in several])

    return [
        Table(
            "outliers",
            "Readings that stand out; look at them at the robot",
            {key: [text for one in labels for text in one[key]] for key in labels[0]},
            {
                LOAD: joined(lambda s, _: s.loads_N),
                MEASURED: joined(lambda _, e: e.problem.value),
                Quantity("predicted", "", 1e3, "predicted", 3): joined(lambda _, e: e.prediction),
                Quantity("own_standard_deviations", label="standard deviations off", digits=3, stored=3): joined(
                    lambda _, e: e.own
                ),
                Quantity("weight", digits=2, stored=3): joined(lambda _, e: e.weight),
            },
        )
    ]


def bootstrap(s: StageFindings) -> Table:
    """Quantiles over poses drawn with replacement; none where they stand at an end of the range."""
    assert s.drawn is not None  # noqa: S101 - only called with draws
    known = ~np.isnan(s.drawn).any(axis=1)
    some = s.result.certainty.estimates
    rows = np.array([_quantiles(e, s.drawn[known, k]) for k, e in enumerate(some)])
    return Table(
        "bootstrap",
        f"Quantiles of {int(known.sum())} draws of poses with replacement, of {len(s.drawn)}",
        {"name": [e.parameter.name for e in some], "unit": [e.parameter.unit for e in some]},
        dict(zip((*QUANTILES, AT_BOUND), rows.T, strict=True)),
        folded=True,
    )


def _quantiles(e: ParameterEstimate, values: Array) -> list[float]:
    p = e.parameter
    if not values.size or e.status == "not identified":
        return [math.nan] * (len(QUANTILES) + 1)
    span = p.upper - p.lower if p.scale == "linear" else 0.0
    low, high = p.lower + _AT_END * (span or p.lower), p.upper - _AT_END * (span or p.upper)
    # Nearest draw, not between two: half way to a rigid joint is no stiffness.
    found = np.quantile(values, list(QUANTILES.values()), method="nearest")
    share = float(((values <= low) | (values >= high)).mean())
    return [*np.where((found > low) & (found < high), found, np.nan).tolist(), share]


def held_out(h: Holdout) -> Table:
    """RMS error at each pose held out, and what the scatter found would give by itself."""
    p = h.system
    of = [(p.pose == k) & (p.component < 3) for k in range(len(p.poses))]
    rms = [rms_mm(h.error[m & ~np.isnan(h.error)], p.component[m & ~np.isnan(h.error)]) for m in of]
    expected = [float(np.sqrt(np.mean(h.expected[m] ** 2))) if m.any() else np.nan for m in of]
    values = {RMS: 1e-3 * np.array(rms), EXPECTED: np.array(expected)}
    return Table("held_out", f"Poses held out ({h.data.source})", {"pose": list(p.poses)}, values)
