"""Which interval for nine readings: coverage over synthetic XR701 campaigns of the nine published poses.

    python benchmarks/calibration/nine_poses.py [--campaigns 500] [--load-path parallelogram]

Springs of joints 2 to 5 are log-normal around 1.4e6, 0.76e6, 1.4e6 and 2e6 N m/rad with a factor e^0.5 to either side,
or some of them rigid; the gauge scatters by 20 to 100 um (log-uniform), one reading in a campaign may be eight of its
standard deviations off. Judged are intervals by the noise of the residual projected out of what the springs can follow
(restricted likelihood: what the commands print), with and without weights of outliers, and by the residual of the
bounded fit over readings less springs, which is larger where a spring stands at its bound: until version 0.1 that was
the interval of `run`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from benchmarks.asked import asked
from doe import bundled_data, read_measurements, select_loads
from doe.certainty.uncertainty import ParameterEstimate, certainty
from doe.estimation.campaign import campaign_of
from doe.estimation.estimate import estimate, estimate_at
from doe.estimation.noise import Noise
from doe.estimation.problem import Problem, problem
from fem import build_model
from robots import LoadPath, load_description

SPRINGS = tuple(f"j{k}.stiffness" for k in range(2, 6))
USUAL = np.array([1.4e6, 0.76e6, 1.4e6, 2.0e6])  # N m/rad
GAUGE = (1e-5, 1e-5)  # m, rad
CASES: dict[str, tuple[tuple[int, ...], bool]] = {
    "realistic springs": ((), False),
    "joint 5 rigid": ((3,), False),
    "joint 4 rigid": ((2,), False),
    "joints 2 and 5 rigid": ((0, 3), False),
    "realistic, an outlier": ((), True),
}


def printed(p: Problem) -> tuple[ParameterEstimate, ...]:
    """What the commands print."""
    return certainty(estimate(p, GAUGE)).estimates


def at_full_weight(p: Problem) -> tuple[ParameterEstimate, ...]:
    """The same with --no-robust."""
    return certainty(estimate(p, GAUGE, robust=False)).estimates


def bounded_residual(p: Problem) -> tuple[ParameterEstimate, ...]:
    """Noise by the residual of the bounded fit over readings less springs, five degrees of freedom."""
    e = estimate(p, GAUGE, robust=False)
    spread = float(np.sqrt(np.sum(e.residual**2) / (len(p) - len(e.u))))
    noise = Noise((max(spread, GAUGE[0]), GAUGE[1]))
    return certainty(estimate_at(p, e.u, noise, np.ones(len(p)), settled=True)).estimates


WAYS: dict[str, Callable[[Problem], tuple[ParameterEstimate, ...]]] = {
    "restricted likelihood, outliers weighted (printed)": printed,
    "restricted likelihood, full weight": at_full_weight,
    "residual of the bounded fit": bounded_residual,
}


@dataclass
class Tally:
    """Intervals that held the truth, and widths (ln of upper over lower end) of closed ones."""

    held: list[bool] = field(default_factory=list)
    width: list[float] = field(default_factory=list)

    def add(self, found: tuple[ParameterEstimate, ...], truth: np.ndarray) -> None:
        """Count a campaign; a parameter that is not identified has no interval."""
        for e, k in zip(found, truth, strict=True):
            low, high = e.interval
            if not math.isnan(low):
                self.held.append(bool(low <= k * 1.001 and k * 0.999 <= high))
                if low > 0.0 and math.isfinite(high):
                    self.width.append(math.log(high / low))


def main() -> None:
    wanted = asked(
        __doc__, campaigns=500, load_path={"choices": ("parallelogram", "serial"), "default": "parallelogram"}
    )
    path: LoadPath = wanted.load_path
    model = build_model(load_description("xr701"), "beam", path)
    nine = select_loads(read_measurements(bundled_data("xr701"), model.robot), (650.0,))
    p = problem(model, nine, campaign_of("xr701", SPRINGS).free(model)[0])
    print(f"{path}, {wanted.campaigns} campaigns: coverage (%) and median width of closed intervals, ln")
    for name, (rigid, outlier) in CASES.items():
        rng = np.random.default_rng(16)
        tallies = {way: Tally() for way in WAYS}
        for _ in range(wanted.campaigns):
            k = USUAL * np.exp(rng.normal(0.0, 0.5, 4))
            k[list(rigid)] = 1e9
            sd = 10.0 ** rng.uniform(math.log10(2e-5), -4.0)
            value = p.predict(1.0 / k) + sd * rng.normal(size=len(p))
            if outlier:
                value[rng.integers(len(value))] += 8.0 * sd * rng.choice([-1.0, 1.0])
            for way, fit in WAYS.items():
                tallies[way].add(fit(replace(p, value=value)), k)
        for way, t in tallies.items():
            print(f"{name:24s} {way:52s} {100.0 * np.mean(t.held):5.1f} {np.median(t.width):6.3f}", flush=True)


if __name__ == "__main__":
    main()
