"""The foreign world of dual quaternions: springs as ours, laws that vanish with their size, right keys, same bytes."""

from __future__ import annotations

import csv
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.optimize import lsq_linear
from worlds.motors import arm as parts
from worlds.motors import make, readings, sets
from worlds.motors.arm import SPRINGS, load
from worlds.motors.readings import EVERY, HONEST, KNOWN, Off
from worlds.motors.spec import STIFF, Machine, Pull, Spec
from worlds.shared import description, model_text

import stiffarm

ROOT = Path(__file__).resolve().parents[2]
SLOW = pytest.mark.slow
# What each family is asked on: arm and load path; kr60-3 otherwise.
PINNED = {"arm": "xr701", "path": "parallelogram"}


def small(family: str = "", seed: int = 5, **other: Any) -> Spec:
    """A set of nine poses with one effect, or none."""
    wish = sets.wishes(np.random.default_rng(2), "none", 1)[0]
    given: dict[str, Any] = {"arm": "kr60-3", "path": "serial", "poses": 9, "reads": "xyz", "scatter": 0.0}
    if family:
        given |= {"kind": "single", "families": (family,)}
        given |= PINNED if "pins" in EVERY[family].needs else {}
    return sets.draw(replace(wish, **given | other), seed)


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("motors")
    make(out, 146, single=1, none=1, outside=1, pairs=1)
    return out


@pytest.mark.parametrize(
    ("name", "path"),
    [("kr60-3", "serial"), *(pytest.param(*arm, marks=SLOW) for arm in sets.ARMS if arm[0] != "kr60-3")],
)
def test_springs_alone_are_those_of_simulate(name: str, path: str, tmp_path: Path) -> None:
    arm = load(name)
    model, table = tmp_path / "m.toml", tmp_path / "r.csv"
    model.write_text(model_text(description(name), dict(zip(arm.joints, SPRINGS[name], strict=True))), encoding="utf-8")
    q = readings.some_poses(np.random.default_rng(3), arm, 6, False, lambda q: q)
    many = np.ones((6, 1))
    force, point = many * [60.0, -80.0, -400.0], many * [0.05, -0.02, 0.11]
    moved = []
    for bent, scale in ((False, 1.0), (True, 1e-5)):
        m = Machine(arm, q, many * SPRINGS[name], path, 1.0, {}, bent)
        m.close()
        now = parts.Now(*np.zeros((3, 6)), np.zeros(6, dtype=int))
        kept = [part.law.rest(np.zeros(6)) for part in m.parts]
        x, _ = m.rest(np.zeros((6, 6)), Pull(scale * force, 0 * force, point), kept, now)
        first = np.einsum("bnc,bn->bc", m.lever(point), x)
        tips = m.tip(m.shape(x), point) - m.tip(m.shape(0 * x), point)
        moved.append(tips / scale if bent else first)
    # A load a hundred thousand times smaller bends the arm too little to tell its levers from those at rest.
    assert np.abs(moved[1] - moved[0]).max() < 1e-6 * np.abs(moved[0]).max()
    names = [*arm.columns, "fx_N", "fy_N", "fz_N", "px_mm", "py_mm", "pz_mm", *readings.READ]
    with table.open("w", encoding="utf-8", newline="") as file:
        csv.writer(file).writerows([names, *np.hstack([q, force, 1e3 * point, 1e3 * moved[0]]).tolist()])
    ours = stiffarm.load(str(model), links="rigid", load_path=path)
    found = stiffarm.simulate(ours, data=stiffarm.read_readings(str(table), ours)).as_json["rms_mm"]
    assert found < 1e-9 * 1e3 * np.abs(moved[0]).max()


def test_forces_are_slopes_of_a_potential() -> None:
    """Work of weights and load by differences of where they are, and how it changes by differences of that."""
    rng, arm = np.random.default_rng(4), load("xr701")
    q = readings.some_poses(rng, arm, 2, False, lambda q: q)
    m = Machine(arm, q, np.ones((2, 1)) * SPRINGS["xr701"], "parallelogram", 0.0, {}, True)
    m.free(0, np.zeros(3), np.array([1.0, 0, 0]), parts.Spring(1e7))
    m.free(3, np.array([0.1, 0.2, 0.0]), np.array([0.0, 1, 0]), parts.Spring(1e7), slides=True)
    m.close()
    x = 0.01 * rng.normal(size=(2, 8))
    pull = Pull(500 * rng.normal(size=(2, 3)), np.zeros((2, 3)), 0.2 * rng.normal(size=(2, 3)))

    def work(x: np.ndarray) -> np.ndarray:
        s = m.shape(x)
        hung = np.einsum("pc,bpc->b", m.weight, parts.at(s.bodies, m.middles[None]))
        return np.asarray(hung + np.einsum("bc,bc->b", pull.force, m.tip(s, pull.point)))

    h = 1e-5
    steps = h * np.eye(8)
    slope, bend = m.work(x, pull)
    assert np.stack([(work(x + e) - work(x - e)) / (2 * h) for e in steps], axis=1) == pytest.approx(slope, abs=1e-4)
    second = np.stack([(m.work(x + e, pull)[0] - m.work(x - e, pull)[0]) / (2 * h) for e in steps], axis=2)
    assert second == pytest.approx(bend, abs=1e-4)


def loop(law: parts.Law, turns: list[float], step_s: float = 1.0) -> list[float]:
    """Torques at turns one after the other."""
    kept, out = law.rest(np.zeros(1)), []
    now = parts.Now(np.zeros(1), np.zeros(1), np.array([step_s]), np.zeros(1, dtype=int))
    for turn in turns:
        y = np.array([turn])
        out.append(float(law.pull(y, kept, now)[0][0]))
        kept = law.keep(y, kept, now)
    return out


def test_materials_remember_what_they_should() -> None:
    up = loop(parts.Dahl(100.0, 1e6), [1e-4, 1e-2, 1e-2 - 1e-4, 0.0])
    assert up == pytest.approx([100 * (1 - np.exp(-1)), 100, 100 * (2 * np.exp(-1) - 1), -100], rel=1e-6)
    # Held to 100 N m, then 1e-6 rad per N m beside a sixtieth that springs back; put on again, it slips no more.
    there = 100 / 60e6 + 1e-4
    first = 100 + 100 * 60 / 61
    assert loop(parts.Clamp(100.0, 1e-6), [there, there - first / 60e6, there]) == pytest.approx([first, 0, first])
    creep = parts.Kelvin(1e6, np.array([0.5]), np.array([10.0]))
    assert loop(creep, [1e-3], 0.0) == pytest.approx([1000.0])
    assert loop(creep, [1e-3], 1e6) == pytest.approx([1000 / 1.5])


ON_DESK = ("friction", "slip", "drift", "partial-load-path")


@pytest.mark.parametrize("family", [pytest.param(f, marks=() if f in ON_DESK else SLOW) for f in EVERY])
def test_a_law_does_something_and_vanishes_with_its_size(family: str) -> None:
    spec = small(family)
    table = sets.measured_at(spec)
    gone = tuple(replace(e, numbers=e.numbers | {"size": 0.0}) for e in spec.effects)
    none, does, vanished = (readings.readings(spec, table, e) for e in ((), spec.effects, gone))
    assert np.abs(does - none).max() > 1e-6, spec.effects
    assert np.abs(vanished - none).max() < 1e-8


def test_wishes_are_dealt_evenly() -> None:
    found = sets.wishes(np.random.default_rng(1), "single", 3 * 6 * len(KNOWN))
    assert {sum(f == w.families[0] for w in found) for f in KNOWN} == {18}
    assert {sum(w.poses == n for w in found) for n in (9, 27, 81)} == {6 * len(KNOWN)}
    assert {sum(w.noise == kind for w in found) for kind in readings.KINDS} == {3 * len(KNOWN)}
    assert {
        sum(getattr(w, half) == value for w in found)
        for half, value in (("reads", "z"), ("outliers", True), ("scatter", 0.0), ("repeated", False))
    } == {9 * len(KNOWN)}
    pairs = sets.wishes(np.random.default_rng(1), "pair", 40)
    assert all(EVERY[a].spot != EVERY[b].spot or not EVERY[a].spot for a, b in (w.families for w in pairs))


@pytest.mark.parametrize("reset_by", ["pose", "session"])
def test_an_excess_is_right_by_one_dense_covariance(reset_by: str) -> None:
    """Counted anew: springs one by one through the world itself, covariance as a whole."""
    spec = small("turned-frame", scatter=0.015)
    spec = replace(spec, sessions=2, noise=spec.noise | {"reset": 1e-5, "reset_by": reset_by})
    table = sets.measured_at(spec)
    axes, n = spec.axes, spec.noise
    whole = readings.readings(spec, table)
    free = [i for i, k in enumerate(spec.stated) if k]
    columns = []
    for i in free:
        soft = tuple(k if j == i else STIFF for j, k in enumerate(spec.springs))
        columns.append(readings.readings(replace(spec, springs=soft), table, ())[:, axes].ravel())
    A = np.array(columns).T
    visit, session = (np.repeat(x, len(axes)) for x in (table.visit, table.session))
    same = visit[:, None] == visit
    V = np.diag(readings.sds(spec, table, whole)[:, axes].ravel() ** 2) + same * (spec.scatter**2 * A @ A.T)
    reset = same if n["reset_by"] == "pose" else session[:, None] == session
    V += n["reset"] ** 2 * reset * (np.tile(axes, len(table.visit))[:, None] == np.tile(axes, len(table.visit)))
    L = np.linalg.inv(np.linalg.cholesky(V))
    scale = np.linalg.norm(L @ A, axis=0)
    seen = scale > 1e-6 * scale.max()
    left = 2 * lsq_linear((L @ A / scale)[:, seen], L @ whole[:, axes].ravel(), (0, np.inf), tol=1e-14).cost
    assert readings.excess(spec, table, whole, whole) == pytest.approx(left, rel=1e-4, abs=1e-3)
    assert left > 30


def test_springs_alone_leave_no_excess() -> None:
    spec = small(path="parallelogram", arm="xr701")
    table = sets.measured_at(spec)
    bare = readings.readings(spec, table)
    assert readings.excess(spec, table, bare, bare) < 1e-6
    wrong = readings.readings(replace(spec, path="serial"), table)
    assert readings.excess(spec, table, wrong, wrong) > 100


def test_a_real_arm_is_a_little_off() -> None:
    """Large turns, lengths and zeros change readings by parts in a hundred at most; chance comes on top."""
    spec = small(scatter=0.015)
    table = sets.measured_at(spec)
    ideal, arm, all_off = (
        readings.readings(spec, table, off=off) for off in (HONEST, Off(arm=True), readings.SO_IT_IS)
    )
    size = np.abs(ideal).max()
    assert 1e-5 * size < np.abs(arm - ideal).max() < 0.03 * size
    assert np.abs(all_off - arm).max() > 1e-3 * size
