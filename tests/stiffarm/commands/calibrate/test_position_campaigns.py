"""Campaigns of positions that real cells bring: a lift, several targets a pose, few joints that move, no masses.

Arms are products of 4 x 4 matrices from DH tables, written here; the program sees tables alone.
"""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pytest
from cli_runs import ROOT, Outcome, run_here

from doe.absolute import calibrate as calibrating
from doe.absolute.fit import Fit
from robots.arrays import Array

UR5 = ROOT / "docs" / "examples" / "ur5"
# Modified DH: alpha (deg), a, d (mm), theta (deg) of each joint and the flange.
SIX = (
    (0, 0, 700, 0),
    (-90, 300, 0, 0),
    (0, 900, 0, 0),
    (-90, 100, 1000, 0),
    (90, 0, 0, 0),
    (-90, 0, 0, 0),
    (0, 0, 180, 0),
)
SEVEN = (
    (0, 0, 340, 0),
    (-90, 0, 0, 0),
    (90, 0, 400, 0),
    (90, 0, 0, 0),
    (-90, 0, 400, 0),
    (-90, 0, 0, 0),
    (90, 0, 126, 0),
    (0, 0, 0, 0),
)
TARGETS: Mapping[str, Sequence[float]] = {"a": (100, 30, 60), "b": (-80, 60, 40), "c": (10, -110, 90)}
NOISE_mm = 0.03
# Three directions of it.
SCATTER_mm = float(np.sqrt(3.0)) * NOISE_mm


def step(alpha: float, a: float, d: float, theta: float) -> Array:
    """One row of modified DH parameters as a frame (4, 4); rad and mm."""
    ca, sa, ct, st = np.cos(alpha), np.sin(alpha), np.cos(theta), np.sin(theta)
    return np.array(
        [[ct, -st, 0, a], [ca * st, ca * ct, -sa, -sa * d], [sa * st, sa * ct, ca, ca * d], [0.0, 0.0, 0.0, 1.0]]
    )


class World:
    """An arm with errors of its geometry, and of its joints over their angles, seen by a tracker."""

    def __init__(self, rows: Sequence[Sequence[float]], rng: np.random.Generator, curves: float = 0.0) -> None:
        self.rows, self.rng, n = rows, rng, len(rows) - 1
        self.error = np.column_stack([rng.normal(0, s, n) for s in (5e-4, 0.8, 0.8, 1e-3)])
        self.wave, self.phase = curves * rng.normal(size=(n, 3)), rng.uniform(0, 6, (n, 3))
        Q = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        self.R, self.t = Q * np.linalg.det(Q), rng.uniform(-3000, 3000, 3)

    def read(self, q: Array, target: Sequence[float], shift: Array) -> Array:
        """A target (3,) mm in the tracker's frame at joint angles q (n,) rad, the base moved by ``shift`` (3,) mm."""
        real = q + np.sum(self.wave * np.sin(np.array([3.0, 5.0, 8.0]) * q[:, None] + self.phase), axis=1)
        T = np.eye(4)
        for j, (alpha, a, d, theta) in enumerate(self.rows):
            e, angle = (self.error[j], real[j]) if j < len(q) else (np.zeros(4), 0.0)
            T = T @ step(np.radians(alpha) + e[0], a + e[1], d + e[2], np.radians(theta) + angle + e[3])
        p = T[:3, :3] @ np.array(target, dtype=float) + T[:3, 3] + shift
        return np.asarray(self.R @ p + self.t + self.rng.normal(0, NOISE_mm, 3))


def model_of(folder: Path, name: str, rows: Sequence[Sequence[float]]) -> Path:
    """A model file made by `new` from the described rows."""
    lines = ["joint,alpha_deg,a_mm,d_mm,theta_deg,lower_deg,upper_deg,sign"]
    lines += [",".join(map(str, (f"j{j}", *row, -170, 170, 1))) for j, row in enumerate(rows[:-1], start=1)]
    lines += [",".join(map(str, ("flange", *rows[-1], "", "", "")))]
    (folder / f"{name}.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    made = run_here("new", name, "--mdh", folder / f"{name}.csv", "--out", folder / name)
    assert made.code == 0, made.err
    return folder / name / f"{name}.toml"


def table(path: Path, head: Sequence[str], rows: Sequence[Sequence[object]]) -> Path:
    """A CSV of joint angles, a position and more."""
    with path.open("w", newline="", encoding="utf-8") as file:
        csv.writer(file).writerows([head, *rows])
    return path


def joints(n: int) -> list[str]:
    return [f"q{j}_deg" for j in range(1, n + 1)]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("campaigns")


@pytest.fixture(scope="module")
def six(folder: Path) -> Path:
    return model_of(folder, "six", SIX)


def campaign(
    path: Path, world: World, poses: int, way: Sequence[float] = (0.0, 0.0, 0.0), heights: Sequence[float] = (0.0,)
) -> Path:
    """Three targets at each of some poses over all angles."""
    rows = []
    for _ in range(poses):
        q, h = world.rng.uniform(-2.5, 2.5, 6), float(world.rng.choice(heights))
        for name, target in TARGETS.items():
            y = world.read(q, target, h * np.array(way))
            rows.append([*np.degrees(q).round(5), *y.round(4), name, h])
    return table(path, [*joints(6), "x_mm", "y_mm", "z_mm", "target", "rail_mm"], rows)


@pytest.fixture(scope="module")
def lift(folder: Path) -> Path:
    """The base on a column that lifts it along its own z, about."""
    world = World(SIX, np.random.default_rng(2))
    return campaign(folder / "lift.csv", world, 40, (0.003, -0.002, 1.0002), (0.0, 400.0, 800.0, 1200.0))


@pytest.mark.parametrize("free", ["geometry,rail.x,rail.y,rail.z", "geometry"])
def test_an_arm_on_a_lift_is_calibrated(six: Path, lift: Path, free: str) -> None:
    found = run_here("calibrate", six, lift, "--free", free, "--json")
    assert found.code == 0, found.err
    c = found.json
    assert 1.0 < c["before"]["rms_mm"] < 10.0
    # Readings of forty poses leave 120 * 3 less some thirty numbers' share of the scatter.
    assert c["after"]["rms_mm"] == pytest.approx(SCATTER_mm, rel=0.15)
    assert c["left_out"]["rms_mm"] < 1.4 * SCATTER_mm
    by_name = {one["name"]: one["value"] for one in c["parameters"]}
    assert by_name["rail.z"] == pytest.approx(1.0002, abs=2e-4)
    held = {one["name"] for one in c["not_told_apart_by_any_readings"]}
    assert {"rail.x", "rail.y"} <= held


@pytest.mark.slow
def test_an_arm_on_a_lift_is_diagnosed(six: Path, lift: Path) -> None:
    found = run_here("diagnose", six, lift, "--json")
    assert found.code == 0, found.err
    assert found.json["unseen_rms_before_mm"] < 1.4 * SCATTER_mm


def test_a_fit_that_ends_worse_than_it_began_is_not_written(
    six: Path, lift: Path, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whatever makes an estimate worse: here each one of more than frames ends 20 mm beside its readings."""
    right = calibrating.fitted

    def beside(*given: object, **more: object) -> Fit:
        found = right(*given, **more)  # type: ignore[arg-type]
        if any(one.kind == "zero" for one in found.moving.unknowns):
            found.residual[:, 0] += 0.02
        return found

    monkeypatch.setattr(calibrating, "fitted", beside)
    outcome = run_here("calibrate", six, lift, "--free", "geometry", "--out", folder / "worse")
    assert outcome.code == 2
    assert "RMS of the readings" in outcome.err
    assert not (folder / "worse" / "model.toml").exists()


def test_few_joints_that_move_are_enough_for_frames(folder: Path) -> None:
    """Seven axes, of which two move: nine free numbers in place of a rotation would fit anything."""
    rng = np.random.default_rng(1)
    world, model, rows = World(SEVEN, rng), model_of(folder, "seven", SEVEN), []
    for k in range(198):
        q = np.zeros(7)
        q[:2] = rng.uniform(-1.7, 1.7), rng.uniform(-1.0, 1.0)
        y = world.read(q, (0, 30, 50), np.zeros(3)) + (300.0 if k % 20 == 7 else 0.0)
        rows.append([*np.degrees(q).round(5), *y.round(4)])
    read = table(folder / "straight.csv", [*joints(7), "x_mm", "y_mm", "z_mm"], rows)
    found = run_here("calibrate", model, read, "--free", "zeros", "--json")
    assert found.code == 0, found.err
    c = found.json
    # Errors of zeros and lengths of a millimetre an axis, of which frames and the target take the most.
    assert c["before"]["rms_mm"] < 2.0
    assert [one["line"] for one in sorted(c["wrong_readings"], key=lambda one: one["line"])] == list(range(9, 200, 20))
    assert not any("misses half" in remark for remark in c["remarks"])


@pytest.fixture(scope="module")
def wavy(folder: Path, six: Path) -> tuple[Outcome, Path]:
    """Joints with errors over their angles that geometry cannot follow; three targets at each pose."""
    world = World(SIX, np.random.default_rng(5), curves=3e-4)
    read, fresh = campaign(folder / "wavy.csv", world, 50), campaign(folder / "fresh.csv", world, 150)
    return run_here("calibrate", six, read, "--free", "geometry", "--holdout", fresh, "--json"), read


def test_poses_left_out_are_as_wrong_as_poses_not_read(wavy: tuple[Outcome, Path]) -> None:
    assert wavy[0].code == 0, wavy[0].err
    c = wavy[0].json
    # Fifty poses tell their own RMS to a tenth.
    assert c["left_out"]["rms_mm"] == pytest.approx(c["holdout"]["rms_mm"], rel=0.2)
    assert c["left_out_sessions"] is None


def test_springs_are_not_left_out_in_silence(six: Path, lift: Path, wavy: tuple[Outcome, Path]) -> None:
    asked = wavy[0].json["remarks"]
    assert not any("springs are left out" in one for one in asked)
    usual = run_here("calibrate", six, wavy[1], "--json").json["remarks"]
    assert sum("springs are left out" in one for one in usual) == 1
    assert not any("gravity" in one for one in usual)


def test_springs_come_with_what_they_assume(folder: Path) -> None:
    rows = (UR5 / "grid.csv").read_text(encoding="utf-8").splitlines()
    (folder / "part.csv").write_text("\n".join([rows[0], *rows[1::5]]) + "\n", encoding="utf-8")

    def remarks(free: str) -> str:
        found = run_here("calibrate", UR5 / "ur5.toml", folder / "part.csv", "--free", free, "--json")
        assert found.code == 0, found.err
        return "\n".join(found.json.get("remarks", []))

    bare, one, without = remarks("geometry,springs"), remarks("zeros,springs,j2.periodic"), remarks("zeros")
    assert "-z of the arm's base" in bare
    assert "error curves of j1, j2, j3" in bare
    assert "error curves of j1, j3" in one
    assert "gravity" not in without
    assert "error curves of" not in without


def test_a_joint_out_of_range_is_named_once_a_pose(folder: Path, six: Path, lift: Path) -> None:
    head, *rows = list(csv.reader(lift.open(encoding="utf-8")))
    bad = [[*row[:5], "358.3", *row[6:]] if k < 6 else row for k, row in enumerate(rows)]
    outcome = run_here("calibrate", six, table(folder / "far.csv", head, bad))
    assert outcome.code == 2
    assert outcome.err.count("358.3") == 2
    assert "row 2, pose line 2, and 2 more" in outcome.err
