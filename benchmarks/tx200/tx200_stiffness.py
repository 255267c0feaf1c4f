"""The substitute stiffness model of the TX200 paper on made-up campaigns: recovery, coverage, prediction, comparison.

    python benchmarks/tx200/tx200_stiffness.py [--repeats 200] [--write docs/validation/tx200_stiffness.md] [--json]

No measured data set is public. Every repeat draws a truth and its readings anew; the identification never sees the
truth. ``--write`` also draws the map beside the page.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import tx200_words as words

from doe.joint_twists import Identified, LawKind, identify
from doe.joint_twists.checks import bending_ratio, diagonal_tests, loops
from doe.joint_twists.cycles import Branches, carried
from doe.joint_twists.model_file import constant_compliances
from doe.joint_twists.substitute import (
    ORIENTATIONS,
    Errors,
    compliances_of,
    errors_of,
    predict,
    reachable_poses,
    stiffness_window,
    stiffness_with,
    usual_models,
)
from doe.joint_twists.synthetic import Campaign, Truth, draw_poses, draw_truth, make_readings
from fem import ArmModel, build_model
from fem.statics.ports import ROWS
from robots import load_description
from robots.arrays import Array
from robots.constants import NORMAL_95

CAMPAIGN = Campaign()
# Poses of the campaign are drawn once: truth, scatter and noise differ from repeat to repeat.
POSES_SEED = 1
UNSEEN = 300
# Poses that models are compared at.
COMPARED = 2000
# Upper arm upright, forearm level, flange down: flange Y bends joint 2 about X, flange Z about its gear axis.
BENT_DEG = (0.0, 0.0, 90.0, 0.0, 90.0, 0.0)
PAPER = (("1", "596.9 Z", 1187.95, 1148.79), ("2", "601.8 XY", 506.19, 436.68), ("3", "610.0 Z", 1135.99, 1170.07))


@dataclass(frozen=True)
class Case:
    """A way of identifying, and of the campaign."""

    name: str
    words: str
    law: LawKind | None = None
    branches: Branches = "mean"
    campaign: Campaign = CAMPAIGN
    second: float = 0.0


CASES = (
    Case("as `identify` does it", "the fullest law that seven angles can tell, mean of loading and unloading"),
    Case(
        "two harmonics in the truth",
        "as `identify` does it, stiffnesses that vary twice a turn by 12 % as well",
        second=0.12,
    ),
    Case("order one, two harmonics", "order one asked for where the truth has two harmonics", "fourier-1", second=0.12),
    Case("order one asked for", "every stiffness with a Fourier series of order one, as the truth has", "fourier-1"),
    Case("constants asked for", "every stiffness constant over the angle, which the truth is not", "constant"),
    Case("loading alone", "the way up alone: friction stays in the gears' stiffnesses", None, "loading"),
)


@dataclass
class Tally:
    """Intervals that held the truth, by joint and row, over repeats."""

    held: Array = field(default_factory=lambda: np.zeros((6, 6)))
    asked: Array = field(default_factory=lambda: np.zeros((6, 6)))
    off: list[float] = field(default_factory=list)
    unseen: list[Array] = field(default_factory=list)
    unseen_held: list[float] = field(default_factory=list)
    status: dict[str, int] = field(default_factory=dict)
    per_repeat: list[float] = field(default_factory=list)

    @property
    def coverage(self) -> float:
        """Share of the intervals that hold the truth."""
        return float(self.held.sum() / self.asked.sum())

    @property
    def standard_error(self) -> float:
        """Of the coverage, from its scatter over repeats: intervals of one repeat share its noise."""
        return float(np.std(self.per_repeat, ddof=1) / np.sqrt(len(self.per_repeat)))

    def row(self) -> dict[str, float]:
        """What the page's table shows."""
        size = np.abs(np.concatenate(self.unseen))
        return {
            "coverage": self.coverage,
            "standard_error": self.standard_error,
            "intervals": float(self.asked.sum()),
            "gear_bias": float(np.mean(self.off)),
            "unseen_mean": float(size.mean()),
            "unseen_p95": float(np.percentile(size, 95.0)),
            "unseen_worst": float(size.max()),
            "unseen_within_3": float((size < 0.03).mean()),
            "unseen_coverage": float(np.mean(self.unseen_held)),
        }


def arm() -> ArmModel:
    """The TX200 with rigid links."""
    return build_model(load_description("tx200"), "rigid")


def campaigns(model: ArmModel, case: Case, repeats: int) -> Iterator[tuple[Truth, Identified]]:
    """Truth and what is identified without it, repeat by repeat."""
    poses = draw_poses(model, case.campaign, np.random.default_rng(POSES_SEED))
    for seed in range(repeats):
        rng = np.random.default_rng(seed)
        truth = draw_truth(model, rng, second=case.second)
        data = make_readings(model, truth, case.campaign, rng, poses=poses)
        yield truth, identify(model, data, law=case.law, branches=case.branches)


def study(model: ArmModel, case: Case, repeats: int) -> Tally:
    """Coverage of the 36 stiffnesses at the angles measured, and errors in poses that nothing was identified from."""
    tally = Tally()
    q = reachable_poses(model, UNSEEN, np.random.default_rng(POSES_SEED + 1))
    for truth, found in campaigns(model, case, repeats):
        held = asked = 0.0
        for k, d in enumerate(found.directions.values()):
            j, r = divmod(k, 6)
            tally.status[d.status] = tally.status.get(d.status, 0) + 1
            at = np.zeros((len(d.angle), 6))
            at[:, j] = d.angle
            true = 1.0 / truth.springs[j, r].compliance(at)
            value, low, high = d.stiffness(d.angle)
            inside = float(np.sum((low <= true) & (true <= high)))
            tally.held[j, r] += inside
            tally.asked[j, r] += len(at)
            held, asked = held + inside, asked + len(at)
            if r == 5:
                tally.off.append(float(np.mean(value / true - 1.0)))
        tally.per_repeat.append(held / asked)
        reference = stiffness_with(model, truth.compliances(q), q)
        p = predict(model, found, q)
        tally.unseen.append((p.value / reference - 1.0).ravel())
        tally.unseen_held.append(float(np.mean((p.low <= reference) & (reference <= p.high))))
    return tally


@dataclass(frozen=True)
class Bent:
    """Twists of joint 2 under 600 N in two flange directions (deg), and the moments (N m) about X and Z."""

    moment_x: float
    twist_x_deg: float
    moment_z: float
    twist_z_deg: float


def bent(model: ArmModel, found: Identified, force_N: float = 600.0) -> Bent:
    """Joint 2 under a force in flange Y and one in flange Z, with the same lever (:data:`BENT_DEG`)."""
    q = np.tile(np.radians(BENT_DEG), (2, 1))
    w = np.zeros((2, 6))
    w[0, 1] = w[1, 2] = force_N
    s = np.abs(carried(model, q, w, np.zeros((2, 3)))[:, 1])
    c = found.compliances(q)[0][0, 1]
    return Bent(float(s[0, 3]), float(np.degrees(c[3] * s[0, 3])), float(s[1, 5]), float(np.degrees(c[5] * s[1, 5])))


def first(model: ArmModel) -> Identified:
    """The first repeat's identification, which comparison and map are made of."""
    return next(campaigns(model, CASES[0], 1))[1]


def with_coupling(model: ArmModel, share: float) -> tuple[bool, float]:
    """Whether a cross term rx-rz at joint 2 of this share of the diagonal is found, and its estimate."""
    rng = np.random.default_rng(0)
    truth = draw_truth(model, rng)
    c = truth.compliances(np.zeros((1, 6)))[0, 1]
    truth = replace(truth, couplings={(1, 3, 5): share * float(np.sqrt(c[3] * c[5]))})
    found = identify(model, make_readings(model, truth, CAMPAIGN, rng))
    test = next(t for t in diagonal_tests(found) if t.joint == "j2")
    one = next(c for c in test.couplings if c.rows == ("rx", "rz"))
    return not test.suffices, one.share


def page(model: ArmModel, tallies: list[tuple[Case, Tally]], repeats: int) -> str:
    """The page as Markdown."""
    found = first(model)
    out = [
        words.HEADING.format(
            repeats=repeats,
            c=CAMPAIGN,
            um=1e6 * CAMPAIGN.noise_m,
            urad=1e6 * CAMPAIGN.noise_rad,
            percent=100.0 * CAMPAIGN.scatter,
            **_lead(tallies),
        )
    ]
    out += _coverage_part(tallies)
    out += _finding_part(model, found)
    out += _usual_part(model, found)
    out += _map_part(model, found)
    return "".join(out)


def _lead(tallies: list[tuple[Case, Tally]]) -> dict[str, str]:
    """The figures of the page's first paragraph: those of its table."""
    row = {case.name: t.row() for case, t in tallies}
    usual = row[CASES[0].name]
    percent = {"within": usual["unseen_within_3"], "worst": usual["unseen_worst"]}
    percent |= {"constants": row["constants asked for"]["coverage"], "loading": row["loading alone"]["coverage"]}
    coverage = f"{100.0 * usual['coverage']:.1f} +- {100.0 * usual['standard_error']:.1f}"
    return {"coverage": coverage, **{name: f"{100.0 * value:.1f}" for name, value in percent.items()}}


def _coverage_part(tallies: list[tuple[Case, Tally]]) -> list[str]:
    out = [words.COVERAGE]
    for case, t in tallies:
        r = t.row()
        out.append(
            f"| {case.name} | {100.0 * r['coverage']:.1f} +- {100.0 * r['standard_error']:.1f} | "
            f"{100.0 * r['gear_bias']:+.1f} | {100.0 * r['unseen_mean']:.2f} | {100.0 * r['unseen_p95']:.2f} | "
            f"{100.0 * r['unseen_worst']:.1f} | {100.0 * r['unseen_within_3']:.1f} | "
            f"{100.0 * r['unseen_coverage']:.1f} |\n"
        )
    out.append("\n" + "".join(f"- **{case.name}**: {case.words}.\n" for case, _ in tallies))
    t = tallies[0][1]
    out.append(words.BY_ROW + "| joint | " + " | ".join(ROWS) + " |\n|---|" + "---|" * 6 + "\n")
    for j, row in enumerate(t.held / t.asked):
        out.append(f"| j{j + 1} | " + " | ".join(f"{100.0 * s:.1f}" for s in row) + " |\n")
    shares = 100.0 * t.held / t.asked
    out.append(f"\nThey lie between {shares.min():.1f} and {shares.max():.1f} %.\n")
    r = t.row()
    paper = "".join(f"| {n} | {f} | {m:.2f} | {k:.2f} | {100.0 * (k / m - 1.0):+.2f} |\n" for n, f, m, k in PAPER)
    out.append(
        words.PREDICTION.format(
            n=UNSEEN, within=100.0 * r["unseen_within_3"], p95=100.0 * r["unseen_p95"], worst=100.0 * r["unseen_worst"]
        )
        + paper
    )
    return out


def _finding_part(model: ArmModel, found: Identified) -> list[str]:
    b, ratio = bent(model, found), bending_ratio(found.directions, "j2")
    assert ratio is not None
    widths = [x for x in loops(found) if x.row == "rz"]
    rows = "".join(
        f"| {x.joint} | {1e6 * x.width:.1f} +- {1e6 * NORMAL_95 * x.spread:.1f} | {100.0 * x.share:.1f} | "
        f"{100.0 * x.loading_only:+.1f} |\n"
        for x in widths
    )
    seen = [(share, *with_coupling(model, share)) for share in (0.0, 0.05, 0.3)]
    cross = "; ".join(
        f"{s:.2f} of the diagonal entries comes out as {e:+.2f}, and a diagonal matrix is {'not ' * no}taken as enough"
        for s, no, e in seen
    )
    return [
        words.FINDING.format(b=b, r=ratio, q=", ".join(f"{v:g}" for v in BENT_DEG)),
        words.HYSTERESIS,
        rows,
        words.DIAGONAL.format(cross=cross),
    ]


def _usual_part(model: ArmModel, found: Identified) -> list[str]:
    six = compliances_of(found)
    same, refitted, effective = usual_models(model, six, poses=COMPARED, rng=np.random.default_rng(0))
    q = reachable_poses(model, COMPARED, np.random.default_rng(1))
    of_file = errors_of(stiffness_with(model, constant_compliances(found, q), q), stiffness_with(model, six(q), q))
    rows = "".join(
        _error_rows(name, e)
        for name, e in (
            ("gears alone, same torsional stiffness", same),
            ("gears alone, refitted to the flange", refitted),
            ("six stiffnesses as model.toml holds them", of_file),
        )
    )
    springs = ", ".join(
        f"{d.joint} {'not seen' if c == 0.0 else f'{1e-6 / c:.2f}'} (gear {1e-6 / d.mean:.2f})"
        for d, c in zip((d for d in found.directions.values() if d.row == "rz"), effective.tolist(), strict=True)
    )
    return [words.USUAL.format(n=COMPARED), rows, words.EFFECTIVE.format(springs=springs)]


def _error_rows(name: str, e: Errors) -> str:
    return "".join(
        f"| {name} | {axis} | {100.0 * e.bias[k]:+.1f} | {100.0 * e.mean[k]:.1f} | {100.0 * e.p95[k]:.1f} | "
        f"{100.0 * e.worst[k]:.0f} |\n"
        for k, axis in enumerate(("X", "Y", "Z"))
    )


def _map_part(model: ArmModel, found: Identified) -> list[str]:
    rows = []
    for name in ORIENTATIONS:
        w = stiffness_window(model, compliances_of(found), orientation=name)  # type: ignore[arg-type]
        reached = np.isfinite(w.mean)
        rows.append(
            f"| {name} | {w.elbow} | {100.0 * reached.mean():.0f} | {1e-3 * np.nanmin(w.mean):.0f} | "
            f"{1e-3 * np.nanmax(w.mean):.0f} |\n"
        )
    return [words.MAP, *rows, words.NOTES]


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--repeats", type=int, default=200)
    parser.add_argument("--write", type=Path, help="page to write; the map goes beside it")
    parser.add_argument("--json", action="store_true", help="one JSON object on stdout")
    arguments = parser.parse_args()
    model, tallies = arm(), []
    for case in CASES:
        t = study(model, case, arguments.repeats)
        tallies.append((case, t))
        sys.stderr.write(f"{case.name:24} {100.0 * t.coverage:5.1f} +- {100.0 * t.standard_error:.1f} %\n")
    if arguments.json:
        json.dump({"repeats": arguments.repeats, "cases": {c.name: t.row() for c, t in tallies}}, sys.stdout, indent=2)
        sys.stdout.write("\n")
    text = page(model, tallies, arguments.repeats)
    if arguments.write:
        from stiffarm.commands.identify.figures import window_figure
        from stiffarm.pages.style import save_png

        arguments.write.write_text(text, encoding="utf-8")
        w = stiffness_window(model, compliances_of(first(model)))
        save_png(window_figure(w, "tx200 (synthetic data)"), arguments.write.with_name("tx200_map.png"))
    elif not arguments.json:
        sys.stdout.write(text)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
