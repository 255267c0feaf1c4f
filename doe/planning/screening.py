"""Which parameters matter: Morris' elementary effects and Sobol indices (SALib), exact derivative shares beside them.

Any set of parameters, over the ranges given, at any loaded poses; all runs of a study are computed at once. SALib
turns a NaN among the runs into zeros without a word: runs are checked before they reach it. Sources: Morris 1991
(doi:10.1080/00401706.1991.10484804), Campolongo et al. 2007 (doi:10.1016/j.envsoft.2006.10.004), Saltelli et al. 2010
(doi:10.1016/j.cpc.2009.09.018).
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from fem.free.model import FreeModel
from fem.free.parameters import Parameter
from robots import InputError
from robots.arrays import Array

# Runs, or runs times poses, evaluated at once: bounds the memory at some 100 MB.
BATCH = 20_000
LEVELS = 6


@dataclass(frozen=True)
class Screening:
    """Importance of k parameters for o outputs (one displacement component at each loaded pose).

    ``first``, ``total`` (o, k): Sobol indices with their 95 % half-widths ``first_conf``, ``total_conf``; NaN rows
    where an output does not move. ``mean_effect``, ``spread`` (o, k): Morris' mean absolute elementary effect (m or
    rad over the whole range) and its standard deviation. ``derivative`` (o, k): share of each parameter in the sum
    of absolute derivatives by the logarithm (or over the range) at the middle of the ranges, exact.
    """

    parameters: tuple[str, ...]
    first: Array
    first_conf: Array
    total: Array
    total_conf: Array
    mean_effect: Array
    spread: Array
    derivative: Array
    runs: int


def screen(
    free: FreeModel,
    component: int,
    *,
    samples: int = 512,
    trajectories: int = 40,
    seed: int = 0,
    methods: Sequence[str] = ("sobol", "morris"),
) -> Screening:
    """Sobol and Morris studies of displacement ``component`` (0..5) at all loaded poses of ``free``.

    Parameters are varied over their ranges, positive ones in the logarithm. ``samples``: base sample of the Sobol
    study, a power of two; it takes ``samples (k + 2)`` runs. ``trajectories`` of the Morris study: ``(k + 1)`` each.
    What is not among ``methods`` is not run, and NaN.

    Raises
    ------
    InputError
        No parameters, samples that are no power of two, or runs that are not finite.
    """
    parameters = free.parameters
    if not parameters:
        raise InputError("parameters to screen", code="M001", value="none", remedy="name at least one")
    if samples < 8 or samples & (samples - 1):
        raise InputError("samples of a Sobol study", code="M002", value=samples, allowed="a power of two from 8")
    study, shape = _study(parameters), (len(free.at), len(parameters))
    sobol, morris, runs = (np.full(shape, np.nan),) * 4, (np.full(shape, np.nan),) * 2, 0
    if "sobol" in methods:
        from SALib.sample import sobol as sobol_sample  # with pandas, which only screenings need

        base = sobol_sample.sample(study, samples, calc_second_order=False, seed=seed)
        sobol, runs = _sobol(study, evaluate_runs(free, inner(parameters, base), component), seed), len(base)
    if "morris" in methods:
        from SALib.sample import morris as morris_sample  # with pandas, which only screenings need

        paths = morris_sample.sample(study, trajectories, num_levels=LEVELS, seed=seed)
        morris = _morris(study, paths, evaluate_runs(free, inner(parameters, paths), component), seed)
        runs += len(paths)
    names = tuple(p.name for p in parameters)
    return Screening(names, *sobol, *morris, derivative_shares(free, component), runs)


def evaluate_runs(free: FreeModel, u: Array, component: int) -> Array:
    """Displacement component (r, o) at all loaded poses for variables u (r, k), many runs at once.

    Raises
    ------
    InputError
        A run is not finite: the first of them is named with its values.
    """
    if all(p.is_linear for p in free.parameters):
        start = free.start
        value, J = free.evaluate(start)
        f, A = value[:, component], J[:, component]
        out = np.concatenate([f + (u[i : i + BATCH] - start) @ A.T for i in range(0, len(u), BATCH)])
    else:
        batch = max(BATCH // max(len(free.at), 1), 1)
        out = np.concatenate([free.displacements(u[i : i + batch])[:, :, component] for i in range(0, len(u), batch)])
    if not np.isfinite(out).all():
        bad = int(np.flatnonzero(~np.isfinite(out).all(axis=1))[0])
        values = {p.name: p.outer(float(v)) for p, v in zip(free.parameters, u[bad], strict=True)}
        raise InputError(
            f"run {bad} of the study is not finite",
            code="S004",
            value=values,
            remedy="narrow the ranges of the parameters",
        )
    return np.asarray(out)


def inner(parameters: Sequence[Parameter], x: Array) -> Array:
    """Estimator's variables (r, k) from points x (r, k) of the unit cube; positive values in the logarithm."""
    out = np.empty_like(x)
    for k, p in enumerate(parameters):
        if p.scale == "linear":
            out[:, k] = p.lower + x[:, k] * (p.upper - p.lower)
        else:
            value = p.lower * (p.upper / p.lower) ** x[:, k]
            out[:, k] = 1.0 / value if p.scale == "compliance" else np.log(value)
    return out


def derivative_shares(free: FreeModel, component: int) -> Array:
    """Share (o, k) of each parameter in the sum of absolute derivatives over its range, at the ranges' middle."""
    u = inner(free.parameters, np.full((1, len(free.parameters)), 0.5))[0]
    _, J = free.evaluate(u)
    pairs = zip(free.parameters, u, strict=True)
    reach = np.array([_reach(p, float(v)) for p, v in pairs])
    size = np.abs(J[:, component] * reach)
    total = size.sum(axis=1, keepdims=True)
    return np.asarray(np.divide(size, total, out=np.zeros_like(size), where=total > 0.0))


def variance_shares(shares: Array) -> Array:
    """Shares (..., k) of the variance that derivative shares (..., k) give if they hold over the whole ranges.

    For a sum of effects these are the Sobol indices, first order and total, as far as each effect is straight.
    """
    square = shares**2
    total = square.sum(axis=-1, keepdims=True)
    return np.asarray(np.divide(square, total, out=np.zeros_like(square), where=total > 0.0))


def _reach(p: Parameter, u: float) -> float:
    """How far the variable goes over the range, at the slope of its middle."""
    if p.scale == "linear":
        return p.upper - p.lower
    return float(np.log(p.upper / p.lower)) * (u if p.scale == "compliance" else 1.0)


def _study(parameters: Sequence[Parameter]) -> dict[str, Any]:
    names = [p.name for p in parameters]
    return {"num_vars": len(names), "names": names, "bounds": [[0.0, 1.0]] * len(names)}


def _sobol(study: dict[str, Any], outputs: Array, seed: int) -> tuple[Array, Array, Array, Array]:
    k = study["num_vars"]
    parts = {name: np.full((outputs.shape[1], k), np.nan) for name in ("S1", "S1_conf", "ST", "ST_conf")}
    for j, column in enumerate(outputs.T):
        # Without variance there is nothing to share; SALib would divide by zero.
        if np.ptp(column) <= 1e-12 * np.abs(column).max(initial=1e-300):
            continue
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", FutureWarning)
            from SALib.analyze import sobol as sobol_analysis  # with pandas, which only screenings need

            # SALib takes a seed of 0 for none.
            found = sobol_analysis.analyze(study, column, calc_second_order=False, seed=seed + 1)
        for name in parts:
            parts[name][j] = found[name]
    return parts["S1"], parts["S1_conf"], parts["ST"], parts["ST_conf"]


def _morris(study: dict[str, Any], points: Array, outputs: Array, seed: int) -> tuple[Array, Array]:
    mean, spread = (np.zeros((outputs.shape[1], study["num_vars"])) for _ in range(2))
    for j, column in enumerate(outputs.T):
        from SALib.analyze import morris as morris_analysis  # with pandas, which only screenings need

        found = morris_analysis.analyze(study, points, column, num_levels=LEVELS, seed=seed)
        mean[j], spread[j] = found["mu_star"], found["sigma"]
    return mean, spread
