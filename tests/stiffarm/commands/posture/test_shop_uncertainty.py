"""The covariance of a calibration reaches posture, place and post: against models drawn from the file's own numbers."""

from __future__ import annotations

import csv
import json
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cli_runs import row_of, run_here
from scipy.stats import t as student

import fem
from machining import read_path, translational
from machining.cell import read_cell
from machining.cutting import ConstantForce, assumed_uncertainty, calibrated_uncertainty, surface_error
from machining.placement.problem import on_axes
from machining.task import Task
from robots import InputError, forward_kinematics, load_description
from robots.arrays import Array
from robots.library.models import to_toml
from robots.schema.quantities import RotationalStiffness
from stiffarm.request import FRAME

pytestmark = pytest.mark.usefixtures("blank")

TRUTH = {"j1": 1.5e6, "j2": 9e5, "j3": 1.1e6, "j4": 2.4e5, "j5": 1.5e5, "j6": 1e5}
FREE = ",".join(f"{joint}.stiffness" for joint in TRUTH)
TOOL, PART = "200,0,80,0,90,0", "1200,200,600"
F = np.array([40.0, 60.0, -20.0])
# A standard deviation from n draws is known to 1/sqrt(2 n): 1.1 % here; four times that is allowed.
DRAWS, WITHIN = 4000, 0.045


def kuka(file: Path) -> Path:
    """KR60-3 with a spring in every joint."""
    given = load_description("kr60-3")
    joints = tuple(
        j.model_copy(update={"stiffness": RotationalStiffness(value=TRUTH[j.name], unit="N m/rad", source="assumed")})
        for j in given.joint
    )
    file.write_text(to_toml(given.model_copy(update={"joint": joints})), encoding="utf-8")
    return file


def readings(model: Path, file: Path, noise: float, aside: float = 0.1) -> Path:
    """Made-up readings, noise in m, at poses where the last axis has a lever of ``aside`` m."""
    arm = fem.build_model(load_description(model), "rigid")
    rng = np.random.default_rng(1)
    q = np.repeat(rng.uniform(*(0.8 * arm.robot.limits.T), (15, 6)), 2, axis=0)
    force = rng.uniform(-400.0, 400.0, (30, 3))
    point = np.tile([aside, 0.0, 0.1], (30, 1))
    d = fem.deflection(arm, q, np.hstack([force, np.zeros((30, 3))]), point)[:, :3]
    d = d + noise * rng.standard_normal(d.shape)
    head = [*arm.robot.coordinates, "fx_N", "fy_N", "fz_N", "px_mm", "py_mm", "pz_mm", "dx_mm", "dy_mm", "dz_mm"]
    table = np.hstack([np.degrees(q), force, 1e3 * point, 1e3 * d])
    file.write_text("\n".join([",".join(head), *(",".join(f"{v:.9g}" for v in row) for row in table)]) + "\n")
    return file


@pytest.fixture(scope="module")
def model_of(tmp_path_factory: pytest.TempPathFactory) -> Callable[[float], Path]:
    """Model files that `calibrate` wrote from readings with a noise in um, each made once."""
    folder, made = tmp_path_factory.mktemp("calibrated"), dict[float, Path]()

    def at(noise_um: float) -> Path:
        if noise_um not in made:
            model, out = kuka(folder / f"kuka{noise_um:g}.toml"), folder / f"out{noise_um:g}"
            table = readings(model, folder / f"readings{noise_um:g}.csv", 1e-6 * noise_um)
            outcome = run_here("calibrate", model, table, "--links", "rigid", "--free", FREE, "--out", out)
            assert outcome.code == 0, outcome.err
            made[noise_um] = out / "model.toml"
        return made[noise_um]

    return at


@pytest.fixture
def wall(tmp_path: Path) -> Path:
    file = tmp_path / "wall.csv"
    rows = [f"{x:.6f},0,0,0,1,0,0,0,1,1200" for x in np.linspace(-120.0, 120.0, 9)]
    file.write_text("x_mm,y_mm,z_mm,nx,ny,nz,tx,ty,tz,feed_mm_per_min\n" + "\n".join(rows) + "\n")
    return file


def posture(model: Path, wall: Path, out: Path, *more: str) -> tuple[dict[str, Any], Array]:
    outcome = run_here(
        "posture",
        model,
        wall,
        "--tool",
        TOOL,
        "--part",
        PART,
        "--reference",
        "0,1,0",
        "--gamma",
        "-180:180:10",
        "--force",
        ",".join(map(str, F)),
        "--out",
        out,
        *more,
    )
    assert outcome.code == 0, outcome.err
    names = load_description(model).joint
    with (out / "posture.csv").open(encoding="utf-8") as stream:
        q = np.radians([[float(row[j.coordinate]) for j in names] for row in csv.DictReader(stream)])
    return json.loads((out / "posture.json").read_text(encoding="utf-8")), q


def drawn_arms(file: Path, rng: np.random.Generator, q: Array) -> Array:
    """Errors (DRAWS, n) along +y of arms whose springs are drawn by the numbers in the file, read as plain TOML."""
    table = tomllib.loads(file.read_text(encoding="utf-8"))["calibration"]["uncertainty"]
    assert table["variable"] == ["1/value"] * 6
    wider = student.ppf(0.975, table["degrees_of_freedom"]) / 1.959963984540054
    V = np.array(table["covariance"]) * np.outer(wider, wider)
    c = rng.multivariate_normal(table["estimate"], V, DRAWS)
    bare = fem.build_model(load_description("kr60-3"), "rigid")
    joints = [name.removesuffix(".stiffness") for name in table["parameters"]]
    tip = FRAME.of(TOOL, "--tool")[:3, 3]
    # Deflection is linear in compliances: one arm for each spring alone.
    alone = [
        fem.deflection(bare.with_springs({j: 1.0 if j == joint else np.inf for j in joints}), q, np.r_[F, 0, 0, 0], tip)
        for joint in joints
    ]
    return np.asarray(c @ np.stack(alone)[:, :, 1])


@pytest.mark.parametrize("noise_um", [15.0, pytest.param(45.0, marks=pytest.mark.slow)])
def test_the_error_s_interval_is_that_of_arms_drawn_from_the_file(
    model_of: Callable[[float], Path], wall: Path, tmp_path: Path, noise_um: float
) -> None:
    file = model_of(noise_um)
    content, q = posture(file, wall, tmp_path / "out")
    said = content["stiffness_uncertainty"]
    assert said["source"] == "calibration"
    assert said["parameters"] == FREE.split(",")
    drawn = drawn_arms(file, np.random.default_rng(2), q)
    description = load_description(file)
    model = fem.build_model(description, "rigid")
    arm = calibrated_uncertainty(model, description)
    assert arm is not None
    task = Task(read_path(wall), FRAME.of(TOOL, "--tool"), FRAME.of(PART, "--part"), np.array([0.0, 1.0, 0.0]))
    error = surface_error(model, task, q, ConstantForce(F, relative_sd=0.0), stiffness=arm)
    np.testing.assert_allclose(error.sd, drawn.std(axis=0), rtol=WITHIN)
    np.testing.assert_allclose(error.normal, drawn.mean(axis=0), rtol=0, atol=4.0 * error.sd.max() / DRAWS**0.5)
    # What the command says has the force's own 10 % a component in it too; that is known beforehand.
    by_force = [0.1 * F[k] * fem.deflection(model, q, np.eye(6)[k], task.tip)[:, 1] for k in range(3)]
    rows = list(csv.DictReader((tmp_path / "out" / "posture.csv").open(encoding="utf-8")))
    sd = [float(row["error_sd_um"]) * 1e-6 for row in rows]
    np.testing.assert_allclose(sd, np.sqrt(drawn.var(axis=0) + np.square(by_force).sum(axis=0)), rtol=WITHIN)


def test_the_interval_grows_with_the_noise_of_the_readings(model_of: Callable[[float], Path], wall: Path) -> None:
    """Three times the noise, drawn from the same numbers: three times the uncertainty, but for what is estimated."""
    q = np.radians(np.tile([10.0, -70.0, 100.0, 20.0, 50.0, 10.0], (1, 1)))
    model = {noise: fem.build_model(load_description(model_of(noise)), "rigid") for noise in (15.0, 45.0)}
    sd = {}
    for noise, built in model.items():
        arm = calibrated_uncertainty(built, load_description(model_of(noise)))
        assert arm is not None
        D = arm.influence(built, q, None).D[0, :, 2, 2]
        sd[noise] = float(np.sqrt(D @ arm.covariance @ D))
    # The noise itself is estimated from 84 spare readings: 8 % each time.
    assert sd[45.0] / sd[15.0] == pytest.approx(3.0, rel=0.25)
    assumed = assumed_uncertainty(model[15.0])
    D = assumed.influence(model[15.0], q, None).D[0, :, 2, 2]
    assert sd[15.0] < 0.5 * np.sqrt(D @ assumed.covariance @ D)


def test_mean_stiffness_and_gain_have_intervals_of_drawn_arms(
    model_of: Callable[[float], Path], wall: Path, tmp_path: Path
) -> None:
    file = model_of(45.0)
    content, q = posture(file, wall, tmp_path / "out", "--quantity", "directional")
    description = load_description(file)
    table = description.calibration.uncertainty  # type: ignore[union-attr]
    assert table is not None
    wider = student.ppf(0.975, table.degrees_of_freedom) / 1.959963984540054
    V = np.array(table.covariance) * np.outer(wider, wider)
    c = np.maximum(np.random.default_rng(3).multivariate_normal(table.estimate, V, DRAWS), 0.0)
    bare, joints = fem.build_model(description, "rigid"), list(TRUTH)
    tip = FRAME.of(TOOL, "--tool")[:3, 3]
    push = np.array([0.0, 1.0, 0.0, 0.0, 0.0, 0.0])
    alone = [
        fem.deflection(bare.with_springs({j: 1.0 if j == joint else np.inf for j in joints}), q, push, tip)[:, 1]
        for joint in joints
    ]
    mean = (1.0 / (c @ np.stack(alone))).mean(axis=1) * 1e-3
    low, high = np.quantile(mean, [0.025, 0.975])
    best, *others = content["courses"]
    # Ends by 1000 and 4000 draws: some 8 % of the half-width.
    assert best["mean_directional_interval95_N_per_mm"] == pytest.approx([low, high], abs=0.12 * (high - low))
    for other in others:
        low, high = other["gain_interval95"]
        assert low <= other["gain"] <= high


def test_what_the_calibration_left_open_is_said(wall: Path, tmp_path: Path) -> None:
    """Readings on the last axis do not turn joint 6; the wall's force does, with a lever of 200 mm."""
    model = kuka(tmp_path / "kuka.toml")
    table = readings(model, tmp_path / "readings.csv", 2e-5, aside=0.0)
    outcome = run_here("calibrate", model, table, "--links", "rigid", "--free", FREE, "--out", tmp_path / "calibration")
    assert outcome.code == 0, outcome.err
    content, q = posture(tmp_path / "calibration" / "model.toml", wall, tmp_path / "out")
    assert content["stiffness_uncertainty"]["left_open"] == ["j6.stiffness"]
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "j6.stiffness was left open by the calibration: it may change the surface error by up to" in page
    # Unseen, it may be any stiffness: as far as rigid the error changes by what joint 6 alone gives way.
    description = load_description(tmp_path / "calibration" / "model.toml")
    arm = fem.build_model(description, "rigid")
    task = Task(read_path(wall), FRAME.of(TOOL, "--tool"), FRAME.of(PART, "--part"), np.array([0.0, 1.0, 0.0]))
    error = surface_error(arm, task, q, ConstantForce(F), stiffness=calibrated_uncertainty(arm, description))
    rigid = arm.with_springs({"j6": np.inf})
    by_j6 = [(fem.deflection(m, q, np.r_[F, 0, 0, 0], task.tip)[:, 1]) for m in (arm, rigid)]
    assert error.left_open["j6.stiffness"] == pytest.approx(np.abs(by_j6[0] - by_j6[1]).max(), rel=1e-9)


def test_without_a_calibration_15_percent_are_assumed_and_said(wall: Path, tmp_path: Path) -> None:
    content, _ = posture(kuka(tmp_path / "kuka.toml"), wall, tmp_path / "out", "--links", "rigid")
    said = content["stiffness_uncertainty"]
    assert (said["source"], said["parameters"], said["left_open"]) == ("assumed", [], [])
    assert "15 %" in said["rests_on"]
    assert "not calibrated" in said["rests_on"]


def test_a_model_with_other_links_than_the_calibrated_one_has_no_covariance(
    model_of: Callable[[float], Path], wall: Path, tmp_path: Path
) -> None:
    content, _ = posture(model_of(15.0), wall, tmp_path / "out", "--links", "beam")
    said = content["stiffness_uncertainty"]
    assert said["source"] == "assumed"
    assert "rigid links" in said["rests_on"]
    description = load_description(model_of(15.0))
    with pytest.raises(InputError, match="rigid links"):
        calibrated_uncertainty(fem.build_model(description, "beam"), description)


def test_the_covariance_of_another_arm_is_refused(model_of: Callable[[float], Path], wall: Path) -> None:
    description = load_description(model_of(15.0))
    model = fem.build_model(description, "rigid")
    arm = calibrated_uncertainty(model, description)
    assert arm is not None
    q = model.robot.limits.mean(axis=1)[None] + 0.3
    with pytest.raises(InputError, match="another model"):
        arm.influence(model.with_springs({"j2": 5e5}), q, None)
    assert forward_kinematics(model.robot, q).p_flange.shape == (1, 3)


@pytest.mark.slow
def test_a_program_s_stiffness_and_compensation_carry_it(
    model_of: Callable[[float], Path], wall: Path, tmp_path: Path
) -> None:
    found = {}
    for name, model, more in (
        ("calibrated", model_of(15.0), ()),
        ("assumed", kuka(tmp_path / "k.toml"), ("--links", "rigid")),
    ):
        outcome = run_here(
            "post",
            model,
            wall,
            "--tool",
            TOOL,
            "--part",
            PART,
            "--reference",
            "0,1,0",
            "--gamma",
            "-30",
            "--force",
            ",".join(map(str, F)),
            "--compensate",
            "--out",
            tmp_path / name,
            *more,
        )
        assert outcome.code == 0, outcome.err
        assert "95 % intervals rest on" in outcome.err
        found[name] = json.loads((tmp_path / name / "post.json").read_text(encoding="utf-8"))
    sources = {name: content["stiffness_uncertainty"]["source"] for name, content in found.items()}
    assert sources == {"calibrated": "calibration", "assumed": "assumed"}
    sd = {name: content["compensation"]["error_sd_um"] for name, content in found.items()}
    # What is left of the calibrated one is the force's own 10 % a component.
    assert sd["calibrated"] < 0.8 * sd["assumed"]
    width = {name: np.diff(content["mean_k_fs_interval95_N_per_mm"])[0] for name, content in found.items()}
    assert 0.0 < width["calibrated"] < 0.3 * width["assumed"]


@pytest.mark.slow
def test_a_placement_carries_it_on_axes_that_give_way_too(
    model_of: Callable[[float], Path], wall: Path, tmp_path: Path
) -> None:
    """The axes' own compliance counts as exact: same spread of the compliance, another compliance."""
    description = load_description(model_of(45.0))
    model = fem.build_model(description, "rigid")
    arm = calibrated_uncertainty(model, description)
    assert arm is not None
    cell = tmp_path / "cell.toml"
    cell.write_text(CELL, encoding="utf-8")
    on_rail = on_axes(model, read_cell(cell))
    q = model.robot.limits.mean(axis=1)[None] + 0.2
    np.testing.assert_array_equal(arm.influence(on_rail, q, None).D, arm.influence(model, q, None).D)
    assert not np.allclose(translational(on_rail, q), translational(model, q), rtol=1e-3)
    outcome = run_here(
        "place",
        model_of(45.0),
        wall,
        "--cell",
        cell,
        "--force",
        ",".join(map(str, F)),
        "--gamma",
        "-180:180:20",
        "--out",
        tmp_path / "placed",
    )
    assert outcome.code == 0, outcome.err
    content = json.loads((tmp_path / "placed" / "placement.json").read_text(encoding="utf-8"))
    assert content["stiffness_uncertainty"]["source"] == "calibration"
    best = row_of(content["placements"], placement="recommended")
    for key, unit in (
        ("mean_stiffness", "_N_per_mm"),
        ("worst_stiffness", "_N_per_mm"),
        ("rms_error", "_um"),
        ("K_sf", ""),
    ):
        low, high = best[f"{key}_interval95{unit}"]
        assert low < best[f"{key}{unit}"] < high


CELL = """
schema = "stiffarm-cell/1"
name = "rail"

[tool]
position_mm = [200, 0, 80]
rpy_deg = [0, 90, 0]

[[linear_axis]]
name = "rail"
direction = [0, 1, 0]
limits_mm = [-200, 200]
compliance_um_per_N = [0.5, 0.5, 0.5]

[part]
position_mm = [1200, 200, 600]
"""
