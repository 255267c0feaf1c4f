"""Do 95 % intervals hold the truth? 200 made-up campaigns each: a serial arm; on a rail; three targets, two payloads.

    python benchmarks/absolute/position_coverage.py run FOLDER [--repeats 200]
    python benchmarks/absolute/position_coverage.py show FOLDER

Truths are drawn anew for each campaign: frames, zeros, ratios, springs, periodic errors to the fourth order.
"""

from __future__ import annotations

import argparse
import json
from collections import defaultdict
from pathlib import Path

import numpy as np
from made_up_positions import Plan, Truth, campaign

from doe.absolute.chain import Nominal
from doe.absolute.fit import fit
from doe.absolute.identified import findings
from doe.absolute.readings import AbsoluteReadings, Labels, Payload
from doe.absolute.start import started
from doe.absolute.structure import twins
from doe.absolute.unknowns import Layout, Unknown, unknowns
from fem import ArmModel, build_model
from robots import load_description
from robots.constants import NORMAL_95

NOTHING = Payload(0.0, np.zeros(3))
HUNG = Payload(60.0, np.array([0.03, -0.02, 0.15]))
USUAL = ("geometry", "ratios", "springs", "periodic4")
CASES = {
    "serial arm": (Plan(150), USUAL),
    "arm on a rail": (Plan(220, rail=4.0), (*USUAL, "rail")),
    "three targets, two payloads, two sessions": (
        Plan(220, sessions=2, targets=3, payloads=(NOTHING, HUNG)),
        (*USUAL, "tilts"),
    ),
}
SIZE = {"zero": 2e-3, "ratio": 1e-3, "coupling": 1e-3, "periodic": 2e-4}


def drawn(one: Unknown, rng: np.random.Generator) -> float:
    """A true value of an unknown."""
    if one.kind == "frame":
        return float(rng.normal() * (5e-4 if one.index[1] < 3 else 1e-3))
    if one.kind == "spring":
        return float(1.0 / np.exp(rng.uniform(np.log(2e5), np.log(2e6)))) if one.index[1] == 5 else 0.0
    if one.kind == "target":
        return float(rng.uniform(-0.15, 0.15))
    if one.kind == "rail":
        if one.index[:2] == (0, 1):
            return float((one.index[2] == 0) + 2e-3 * rng.normal())
        return float(rng.normal() * (3e-4 if one.index[0] == 0 else 2e-4) / one.index[1])
    return float(rng.normal() * SIZE[one.kind])


def outlined(model: ArmModel, plan: Plan) -> AbsoluteReadings:
    """A campaign without positions, of which the unknowns are asked before its truth is drawn."""
    names, n = tuple("abc"[: plan.targets]), 60
    turns = np.arange(n)
    return AbsoluteReadings(
        "",
        "",
        np.zeros((n, model.robot.dof)),
        np.zeros((n, 3)),
        Labels(("s0",), np.zeros(n, dtype=np.int64)),
        Labels(names, turns % plan.targets),
        turns % len(plan.payloads),
        plan.payloads,
        np.linspace(0.0, plan.rail, n),
        np.full(n, np.nan),
        turns,
    )


def once(model: ArmModel, case: str, seed: int) -> dict[str, object]:
    """One campaign: by parameter, whether its interval holds the truth; None where it has none."""
    plan, names = CASES[case]
    rng = np.random.default_rng(seed)
    outline = outlined(model, plan)
    layout = Layout(unknowns(model.robot, outline, names))
    same = twins(model, outline, layout, Nominal(np.full((plan.targets, 3), 0.1), (0.0, plan.rail)))
    layout = layout.without([one.name for one in same])
    truth = Truth({one.name: drawn(one, rng) for one in layout.unknowns})
    data = campaign(model, truth, plan, rng)
    found = fit(model, data, layout, started(model.robot, data))
    held: dict[str, bool | None] = {}
    for f in findings(found):
        value = truth.get(f.name)
        one = next(u for u in layout.unknowns if u.name == f.name)
        outer = (1.0 / value if value > 0.0 else np.inf) if one.kind == "spring" else one.factor * value
        low, high = f.interval95
        held[f.name] = None if np.isnan(low) else bool(low <= outer <= high)
    for k, one in enumerate(layout.unknowns):
        if one.law:
            held[one.name] = bool(abs(found.u[k] - truth.get(one.name)) <= NORMAL_95 * found.sd[k])
    return {"case": case, "seed": seed, "held": held, "sigma": found.variances.sigma, "settled": found.settled}


def run(folder: Path, repeats: int) -> None:
    """All campaigns, one line each; those that are there are kept."""
    folder.mkdir(parents=True, exist_ok=True)
    file = folder / "campaigns.jsonl"
    lines = file.read_text(encoding="utf-8").splitlines() if file.exists() else []
    done = {(one["case"], one["seed"]) for one in map(json.loads, lines)}
    model = build_model(load_description("kr60-3"), "rigid")
    with file.open("a", encoding="utf-8") as out:
        for seed in range(repeats):
            for k, case in enumerate(CASES):
                if (case, 1000 * k + seed) not in done:
                    out.write(json.dumps(once(model, case, 1000 * k + seed)) + "\n")
                    out.flush()


def show(folder: Path) -> dict[str, object]:
    """Coverage by case, pooled and of the worst parameter."""
    by: dict[str, dict[str, list[bool]]] = defaultdict(lambda: defaultdict(list))
    blind: dict[str, int] = defaultdict(int)
    repeats: dict[str, int] = defaultdict(int)
    for one in map(json.loads, (folder / "campaigns.jsonl").read_text(encoding="utf-8").splitlines()):
        repeats[one["case"]] += 1
        for name, inside in one["held"].items():
            if inside is None:
                blind[one["case"]] += 1
            else:
                by[one["case"]][name].append(inside)
    out: dict[str, object] = {}
    for case, held in by.items():
        enough = {name: v for name, v in held.items() if len(v) >= repeats[case] // 2}
        worst = min(enough, key=lambda name: np.mean(enough[name]))
        every = [x for v in held.values() for x in v]
        out[case] = {
            "campaigns": repeats[case],
            "intervals": len(every),
            "coverage": float(np.mean(every)),
            "worst_parameter": worst,
            "worst_coverage": float(np.mean(enough[worst])),
            "without_interval": blind[case],
        }
    whole = [x for held in by.values() for v in held.values() for x in v]
    out["pooled"] = {"intervals": len(whole), "coverage": float(np.mean(whole))}
    return out


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("run", "show"))
    parser.add_argument("folder", type=Path)
    parser.add_argument("--repeats", type=int, default=200)
    given = parser.parse_args()
    if given.what == "run":
        run(given.folder, given.repeats)
    print(json.dumps(show(given.folder), indent=1))


if __name__ == "__main__":
    main()
