"""The foreign world that stands on OpenSees: springs as ours, laws that remember, right keys, same seed same bytes."""

from __future__ import annotations

import csv
import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from oracles import load_apart
from scipy.optimize import nnls
from worlds.frame import campaign, make, sets
from worlds.frame.arm import SPRINGS, Deck, Material, Spec, load
from worlds.frame.other_laws import KNOWN, STRANGE
from worlds.frame.plan import Event, Joint, Moment, Plan, X, Y, build, run, solver
from worlds.shared import Effect, description, model_text

ROOT = Path(__file__).resolve().parents[2]


def turn(material: Material, history: list[tuple[float, float]]) -> list[float]:
    """Turn in rad of one hinge at times in s under torques in N m, straight in between."""
    deck = Deck()
    ground = deck.node(np.zeros(3))
    deck.fix(ground)
    node = deck.hinge(ground, {4: material}, X, Y)
    times, values = zip((0.0, 0.0), *history, strict=True)
    patterns = [{"times": times, "values": values, "loads": [[node, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0]]}]
    legs = [[time, 10, True] for time in times[1:]]
    found = solver().run({"deck": deck.commands, "patterns": patterns, "legs": legs, "node": node})
    return [float(x) for x in found[:, 3]]


@pytest.fixture(scope="module", autouse=True)
def opensees() -> None:
    """What is missing on a machine skips."""
    load_apart("openseespy.opensees")


def small(family: str, seed: int = 5, **other: Any) -> Spec:
    """A set of nine poses with one effect, or none with ``family`` empty."""
    wish = sets.wishes(np.random.default_rng(2), "none", 1)[0]
    law = (KNOWN | STRANGE).get(family)
    arm = law.arms[0] if law and law.arms else "kr60-3"
    kind = {"kind": "single", "families": (family,)} if family else {}
    return sets.draw(replace(wish, arm=arm, poses=9, reads="xyz", **kind, **other), seed)


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("frame")
    make(out, 26, single=2, none=1, outside=1, pairs=1)
    return out


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "path"),
    [*(pytest.param(name, "serial", marks=pytest.mark.slow) for name in SPRINGS), ("xr701", "parallelogram")],
)
def test_springs_alone_are_those_of_simulate(name: str, path: str, tmp_path: Path) -> None:
    arm, rng, rows = load(name), np.random.default_rng(3), []
    (tmp_path / "m.toml").write_text(
        model_text(description(name), dict(zip(arm.joints, arm.springs, strict=True))), encoding="utf-8"
    )
    force, point = np.array([60.0, -80.0, -400.0]), np.array([0.05, -0.02, 0.11])
    for q in campaign.draw_poses(rng, arm, 6, False, lambda q: q):
        plan = Plan(arm, arm.stand(q), [Joint(k) for k in arm.springs], np.zeros(6), point, path=path, balance=0.3)
        none, loaded = (Event(t, t + 20, np.append(w * force, np.zeros(3)), True) for t, w in ((0, 0), (20, 1)))
        zero, moved = run(plan, *build(plan), [none, loaded], 10.0)[:, :3]
        line = dict(zip(arm.columns, q, strict=True)) | dict(zip(("fx_N", "fy_N", "fz_N"), force, strict=True))
        line |= dict(zip(("px_mm", "py_mm", "pz_mm"), 1e3 * point, strict=True))
        rows.append(line | dict(zip(("dx_mm", "dy_mm", "dz_mm"), 1e3 * (moved - zero), strict=True)))
    with (tmp_path / "r.csv").open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, rows[0])
        writer.writeheader()
        writer.writerows(rows)
    options = ["--links", "rigid", "--load-path", path, "--json"]
    command = [sys.executable, "-m", "stiffarm", "simulate", "m.toml", "r.csv", *options]
    environment = {"PYTHONPATH": str(ROOT)}
    done = subprocess.run(  # noqa: S603 - ours
        command, cwd=tmp_path, capture_output=True, text=True, check=False, env=environment
    )
    assert done.returncode == 0, done.stderr
    size = max(abs(row[c]) for row in rows for c in ("dx_mm", "dy_mm", "dz_mm"))
    # Stiff beams give 1e-8 of what a joint does, the parallelogram's bar 1e-7.
    assert json.loads(done.stdout)["rms_mm"] < 1e-6 * size


def test_friction_goes_round_a_loop_and_a_spring_does_not() -> None:
    k, rub = 1e6, 120.0
    e = Effect("friction", "j2", {"torque": rub, "stiffer": 4.0, "uneven": 0.0})
    plan = Plan(
        load("kr60-3"), load("kr60-3").stand(np.zeros(6)), [Joint(k) for _ in range(6)], np.zeros(6), np.zeros(3)
    )
    KNOWN["friction"].change(e, plan, Moment(0, 0.0, 0, 0.0, 1.0))
    history = [(float(t), torque) for t, torque in enumerate(np.tile([600.0, 0.0, -600.0, 0.0], 2), 1)]
    for law, energy in ((plan.joints[1].materials()[4], None), (("Elastic", k), 0.0)):
        fine = [
            (a + x, ta + x * (tb - ta))
            for (a, ta), (_, tb) in zip([(0.0, 0.0), *history], history, strict=False)
            for x in np.arange(1, 41) / 40
        ]
        turns, torques = np.array(turn(law, fine)), np.array([t for _, t in fine])
        # The second round is closed.
        lost = np.trapezoid(torques[-161:], turns[-161:])
        if energy is None:
            # A slider that slides all the time loses four times its torque over the amplitude; these start softly.
            assert 0.6 < lost / (4 * rub * np.ptp(turns) / 2) < 1.0
        else:
            assert abs(lost) < 1e-9 * 600**2 / k


def test_creep_comes_and_goes_and_a_servo_brings_a_joint_back() -> None:
    k, arm = 1e6, load("kr60-3")

    def law(family: str, numbers: dict[str, Any]) -> Material:
        plan = Plan(arm, arm.stand(np.zeros(6)), [Joint(k) for _ in range(6)], np.zeros(6), np.zeros(3))
        (KNOWN | STRANGE)[family].change(Effect(family, "j2", numbers), plan, Moment(0, 0.0, 0, 0.0, 1.0))
        return plan.joints[1].materials()[4]

    history = [(0.01, 1000.0), (5e3, 1000.0), (5e3 + 0.01, 0.0), (1e4, 0.0)]
    at_once, late, back, gone = turn(law("creep", {"amount": 0.3, "fast": 0.5, "times_s": [50.0, 300.0]}), history)
    # OpenSees integrates its dashpots to about 1e-4.
    assert (at_once, late, back, gone) == pytest.approx((1e-3, 1.3e-3, 0.3e-3, 0), abs=2e-6)
    at_once, late, *_ = turn(law("servo-recovery", {"amount": 0.25, "time_s": 60.0}), history)
    assert (at_once, late) == pytest.approx((1e-3 / 0.75, 1e-3), abs=2e-6)
    # Two dashpots alike are one, and the turn comes later than the torque would go by the joint's softness.
    way = [(0.01, 1000.0), *((float(t), 1000.0) for t in range(10, 400, 10))]
    found = turn(law("creep", {"amount": 0.3, "fast": 0.5, "times_s": [100.0, 100.0]}), way)
    t = np.array([time for time, _ in way])
    assert found == pytest.approx(1e-3 * (1 + 0.3 * -np.expm1(-t / (1.3 * 100.0))), abs=2e-6)


def test_a_slipped_clamp_stays_where_it_went() -> None:
    """Held up to 300 N and pulled by 400, it goes on by 0.1 mm, of which a sixtieth springs back."""
    spec = replace(small(""), loads=(200.0, 290.0, 400.0), down=True, second=(), moves=False)
    rows = campaign.rows_of(spec, lambda q: q, 9, 1, 0)
    slip = Effect("slip", "tool", {"holds": 300.0, "gives": 1e6})
    up = np.array([0.0, 0.0, 1.0])
    found = []
    for stay in range(9):
        five = rows[5 * stay : 5 * stay + 5]
        # A tool that points along the load slips along it alone; others slip across too, each way for itself.
        stand = spec.of.stand(five[0].angles)
        along = float(np.abs(stand.turned[-1].T @ up).max())
        more = (campaign.readings(spec, five, (slip,)) - campaign.readings(spec, five, ()))[:, 2]
        found.append((along, *(-1e6 * more)))
    for along, at200, at290, _, _, after in found:
        if 400 * along > 300:
            assert at200 == pytest.approx(200 / 60, rel=0.01)
            assert at290 == pytest.approx(290 / 60, rel=0.01)
            assert after > at200 + 0.5 * (400 * along - 300) * along
    assert sum(400 * along > 300 for along, *_ in found) >= 3


@pytest.mark.slow
def test_a_key_is_right(made: Path) -> None:
    """Counted anew from the files: springs one by one through OpenSees, and one dense covariance."""
    for folder in sorted(made.glob("[so]*")):
        said = json.loads((folder / "key.json").read_text(encoding="utf-8"))
        spec = Spec.of_key(said["frame"])
        rows, axes = sets.campaign(spec), spec.axes
        lines = list(csv.DictReader((folder / "readings.csv").open(encoding="utf-8")))
        assert [[float(line[c]) for c in spec.of.columns] for line in lines] == [list(r.angles) for r in rows]
        assert [float(line["fz_N"]) for line in lines] == pytest.approx([r.force[2] for r in rows], abs=1e-4)
        whole = campaign.readings(spec, rows)[:, axes]
        stiff = 1e15
        columns = []
        for i in [i for i, k in enumerate(spec.stated) if k]:
            soft = replace(spec, springs=tuple(1e6 if j == i else stiff for j in range(len(spec.springs))))
            columns.append(campaign.readings(soft, rows, ())[:, axes].ravel())
        sd = campaign.sds(spec, rows, campaign.readings(spec, rows))[:, axes].ravel()
        V = np.diag(sd**2)
        for visit in {r.visit for r in rows}:
            of = np.repeat([r.visit == visit for r in rows], len(axes))
            V += spec.scatter**2 * np.outer(of * whole.ravel(), of * whole.ravel())
        if "session" in spec.columns:
            label = [(r.session, k) for r in rows for k in axes]
            V += 20e-6**2 * np.array([[a == b for a in label] for b in label])
        L = np.linalg.inv(np.linalg.cholesky(V))
        A = L @ np.array(columns).T
        # A joint without a lever moves nothing, but for 1e-9 of the others.
        scale = np.linalg.norm(A, axis=0)
        A, scale = A[:, scale > 1e-6 * scale.max()], scale[scale > 1e-6 * scale.max()]
        left = nnls(A / scale, L @ whole.ravel())[1] ** 2
        # The key is rounded to 0.01; stiff springs give 1e-7 of the readings, whose chi-square is 1e6 and less.
        assert said["excess_chi2"] == pytest.approx(left, rel=1e-3, abs=0.02), folder.name


def test_what_common_scatter_explains_is_no_excess() -> None:
    """Of readings with everything three per cent larger in one set-up, nearly all is set-up scatter."""
    spec = replace(small(""), scatter=0.015, noise={"kind": "white", "level": 2e-6})
    rows = sets.campaign(spec)
    bare = campaign.readings(spec, rows)
    of = np.array([r.visit == 3 for r in rows])[:, None]
    larger = bare * (1 + 0.03 * of)
    known = campaign.excess(spec, rows, larger, bare)
    assert campaign.excess(spec, rows, bare, bare) < 1e-3
    assert known <= 4.0 * 1.01  # two standard deviations
    assert campaign.excess(replace(spec, scatter=0.0), rows, larger, bare) > 20 * known


@pytest.mark.slow
@pytest.mark.parametrize("family", [*KNOWN, *STRANGE])
def test_every_family_moves_the_readings(family: str) -> None:
    spec = small(family)
    rows = sets.campaign(spec)
    change = campaign.readings(spec, rows) - campaign.readings(spec, rows, ())
    # A tenth of a micrometre; frames without anything hidden repeat to a millionth of that.
    assert np.abs(change).max() > 1e-7, spec.effects


@pytest.mark.slow
def test_wishes_are_dealt_evenly() -> None:
    found = sets.wishes(np.random.default_rng(1), "single", 2 * len(KNOWN))
    assert {sum(f == w.families[0] for w in found) for f in KNOWN} == {2}
    assert sum(w.reads == "z" for w in found) == sum(w.outliers for w in found) == len(KNOWN)
    assert [sum(w.poses == n for w in found) for n in (9, 27, 81)] == [14, 35, 21]
    for number, wish in enumerate(sets.wishes(np.random.default_rng(1), "pair", 20)):
        one, two = sets.draw(replace(wish, poses=9), number).effects
        assert (one.family != two.family, one.place != two.place) == (True, True)
