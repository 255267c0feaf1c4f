"""How long positions take: 100,000 poses with 60 free parameters, beside scipy's least squares without derivatives.

python benchmarks/absolute/position_speed.py [--poses 100000] [--scipy-poses 10000] [--json FILE]
"""

from __future__ import annotations

import json
import resource
import time
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares

from benchmarks.asked import asked
from doe.absolute.chain import Nominal, evaluate, samples
from doe.absolute.fit import Fit, fit
from doe.absolute.readings import AbsoluteReadings, Labels, Payload
from doe.absolute.reduced import Frame
from doe.absolute.start import started
from doe.absolute.structure import twins
from doe.absolute.turns import rotation
from doe.absolute.unknowns import Layout, unknowns
from fem import ArmModel, build_model
from robots import load_description
from robots.arrays import Array

NOISE = 5e-5
FREE = ("geometry", "springs", "periodic3")
SIZE = {"frame": 5e-4, "zero": 2e-3, "periodic": 1e-4, "spring": 1e-6, "target": 0.1}


def campaign(model: ArmModel, n: int, rng: np.random.Generator) -> tuple[AbsoluteReadings, Layout]:
    """Positions of one target at n random poses, with errors of what is free."""
    low, high = np.clip(model.robot.limits, -np.pi, np.pi).T
    nobody = np.zeros(n, dtype=np.int64)
    data = AbsoluteReadings(
        "made-up",
        "",
        rng.uniform(low, high, (n, model.robot.dof)),
        np.zeros((n, 3)),
        Labels(("s",), nobody),
        Labels(("a",), nobody),
        nobody,
        (Payload(0.0, np.zeros(3)),),
        np.zeros(n),
        np.full(n, np.nan),
        nobody,
    )
    layout, nominal = Layout(unknowns(model.robot, data, FREE)), Nominal(np.full((1, 3), 0.1), (0.0, 0.0))
    layout = layout.without([one.name for one in twins(model, data, layout, nominal)])
    u = np.array([SIZE[one.kind] * abs(rng.normal()) for one in layout.unknowns])
    P = np.concatenate(
        [evaluate(model, layout, s, u, slopes=False)[0] for s in samples(model, data, layout, nominal, u)], axis=1
    )
    frame = Frame(rotation(rng.normal(size=3)), rng.normal(size=3))
    data.position[:] = P.T @ frame.R.T + frame.t + NOISE * rng.normal(size=(n, 3))
    return data, layout


def ours(model: ArmModel, data: AbsoluteReadings, layout: Layout) -> tuple[Fit, float]:
    """The estimate with everything that belongs to it, and its time in s."""
    began = time.perf_counter()
    found = fit(model, data, layout, started(model.robot, data))
    return found, time.perf_counter() - began


def theirs(model: ArmModel, data: AbsoluteReadings, layout: Layout) -> tuple[float, float]:
    """Plain least squares by scipy with numerical derivatives, from the same start: its RMS in m, and its time in s."""
    began = time.perf_counter()
    begin = started(model.robot, data)
    u = np.zeros(len(layout))
    for k, (t, a) in layout.of("target"):
        u[k] = begin.targets[t, a]
    blocks, R, t = samples(model, data, layout, begin.nominal), begin.frames[0].R, begin.frames[0].t
    scale = np.array([*(min(one.sd, 0.1) for one in layout.unknowns), *[1e-3] * 6])

    def residual(x: Array) -> Array:
        v = x * scale
        P = np.concatenate([evaluate(model, layout, s, u + v[:-6], slopes=False)[0] for s in blocks], axis=1)
        return np.asarray((data.position - P.T @ (R @ rotation(v[-6:-3])).T - t - v[-3:]).reshape(-1) / NOISE)

    found = least_squares(residual, np.zeros(len(scale)), method="trf", x_scale="jac")
    return float(np.sqrt(np.mean(found.fun**2) * 3.0)) * NOISE, time.perf_counter() - began


def main() -> None:
    given = asked(__doc__, poses=100000, scipy_poses=10000, json=Path)
    model = build_model(load_description("kr60-3"), "rigid")
    out: dict[str, object] = {}
    for n in (given.scipy_poses, given.poses):
        data, layout = campaign(model, n, np.random.default_rng(0))
        before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        found, seconds = ours(model, data, layout)
        after = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        out[f"{n} poses"] = {
            "parameters": len(layout) + 6,
            "seconds": seconds,
            "rounds": found.rounds,
            "rms_mm": 1e3 * found.rms_m,
            "peak_MB": after / 1024.0,
            "grew_by_MB": (after - before) / 1024.0,
        }
        if n == given.scipy_poses:
            rms, slow = theirs(model, data, layout)
            out["scipy.optimize.least_squares"] = {"poses": n, "seconds": slow, "rms_mm": 1e3 * rms}
            out["ratio"] = slow / seconds
    text = json.dumps(out, indent=1)
    print(text)
    if given.json is not None:
        given.json.write_text(text + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
