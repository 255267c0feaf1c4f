"""Tables of joint twists and of reflectors: read back the same, every fault named, nothing guessed."""

from __future__ import annotations

import csv
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from joint_twist_campaigns import EXACT, poses, readings, truth, tx200
from numpy.testing import assert_allclose
from refusals import refuses

from doe.joint_twists import TwistReadings, identify, joined, read_twists, write_twists
from doe.joint_twists.reflectors import motion, relative
from robots import InputError, forward_kinematics

ROBOT = tx200().robot
HEADER = "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,joint,fx_N,fy_N,fz_N,phase,dx_mm,rz_mrad"
GOOD = "0,10,80,0,30,0,j2,0,150,0,loading,0.01,0.02"


def table(folder: Path, *rows: str, header: str = HEADER) -> Path:
    path = folder / "twists.csv"
    path.write_text("\n".join([header, *rows]) + "\n")
    return path


def faults(path: Path) -> str:
    with pytest.raises(InputError) as caught:
        read_twists(path, ROBOT)
    return str(caught.value)


@pytest.fixture
def small() -> TwistReadings:
    data = readings(truth(friction=1.0))
    return data.select(np.isin(data.joint, [1, 5]))


def test_a_written_table_is_read_back_the_same(small: TwistReadings, tmp_path: Path) -> None:
    write_twists(small, tmp_path / "synthetic.csv", ROBOT)
    back = read_twists(tmp_path / "synthetic.csv", ROBOT)
    # 15 significant digits.
    for name in ("q", "wrench", "point", "twist"):
        assert_allclose(getattr(back, name), getattr(small, name), rtol=1e-14, atol=1e-18)
    assert (back.joint == small.joint).all()
    assert (back.phase, back.setup) == (small.phase, small.setup)
    assert back.synthetic
    assert "synthetic readings: made up" in back.notes[0]
    assert all(row["origin"] == "synthetic" for row in csv.DictReader((tmp_path / "synthetic.csv").open()))


def test_a_workbook_is_read_like_a_csv(small: TwistReadings, tmp_path: Path) -> None:
    small = small.select(np.arange(small.n) < 60)
    write_twists(small, tmp_path / "a.csv", ROBOT)
    pd.read_csv(tmp_path / "a.csv").to_excel(tmp_path / "a.xlsx", index=False)
    back = read_twists(tmp_path / "a.xlsx", ROBOT)
    assert_allclose(back.twist, small.twist, rtol=1e-12, atol=1e-18)


def test_loads_in_base_axes_are_turned(tmp_path: Path) -> None:
    row = "0,10,80,0,30,0,2,100,-50,20,loading,0.01,0.02"
    flange = read_twists(table(tmp_path, row), ROBOT)
    base = read_twists(table(tmp_path, row + ",base", header=HEADER + ",axes"), ROBOT)
    R = forward_kinematics(ROBOT, base.q).R_flange[0]
    assert_allclose(R @ base.wrench[0, :3], flange.wrench[0, :3], rtol=1e-12)
    assert base.joint[0] == 1


def test_sigmas_labels_and_loads_of_zero(tmp_path: Path) -> None:
    header = HEADER + ",pose,repeat,sigma_mm,sigma_twist_mrad"
    rows = [GOOD + ",A,1,0.005,0.01", GOOD.replace("150", "0").replace("loading", "unloading") + ",A,1,,"]
    data = read_twists(table(tmp_path, *rows, header=header), ROBOT)
    assert data.setup == ("A/2/1", "A/2/1")
    assert_allclose(data.sigma[0], [5e-6] * 3 + [1e-5] * 3)
    assert np.isnan(data.sigma[1]).all()
    assert_allclose(data.load, [150.0, 0.0])


def test_all_bad_rows_are_reported_at_once(tmp_path: Path) -> None:
    text = faults(
        table(
            tmp_path,
            GOOD,
            GOOD.replace("j2", "j7"),
            GOOD.replace("j2", "0"),
            GOOD.replace("150", "nan"),
            GOOD.replace("loading", "up"),
            GOOD.replace("0.02", "").replace("0.01", ""),
            GOOD.replace("0,10", '0,"10,5"', 1),
            GOOD + ",1",
            GOOD.replace("0,10", "0,500", 1),
        )
    )
    for piece in (
        "row 3, column joint: got 'j7'; allowed: j1, j2, j3, j4, j5, j6, or 1 to 6",
        "row 4, column joint: got '0'",
        "row 5, column fy_N: got 'nan'",
        "row 6, column phase: got 'up'; allowed: loading, unloading",
        "row 7, nothing was read",
        "row 8, column q2_deg: got '10,5'",
        "decimal comma: write 10.5",
        "row 9, the row does not fit the header",
        "cannot be taken: q2_deg = 500",
        "row 10, pose set-up",
    ):
        assert piece in text, piece
    assert "row 2," not in text


@pytest.mark.parametrize(
    ("header", "piece"),
    [
        (HEADER.replace("q3_deg", "q3real_deg"), "column q3real_deg is not a joint coordinate of tx200"),
        (HEADER.replace("dx_mm", "dx_um"), "column dx_um has a wrong or missing unit"),
        (HEADER.replace("rz_mrad", "rz_deg"), "column rz_deg has a wrong or missing unit"),
        (HEADER.replace("phase", "way"), "the header has no column phase"),
        (HEADER.replace("joint", "which"), "the header has no column joint"),
        (HEADER.replace("fz_N", "fy_N"), "column fy_N stands there twice"),
        (HEADER.replace("fz_N", "px_mm"), "no column py_mm, pz_mm"),
    ],
)
def test_headers_that_mean_something_else(tmp_path: Path, header: str, piece: str) -> None:
    assert piece in faults(table(tmp_path, GOOD, header=header))


def test_loads_that_are_all_zero(tmp_path: Path) -> None:
    assert "row 2, the load is zero in every component, here and in every row" in faults(
        table(tmp_path, GOOD.replace("150", "0"))
    )


def test_missing_joint_columns_are_said(tmp_path: Path) -> None:
    header = HEADER.replace("q6_deg,", "")
    data = read_twists(table(tmp_path, "0,10,80,0,30,j2,0,150,0,loading,0.01,0.02", header=header), ROBOT)
    assert "joint columns missing, taken as 0: q6_deg" in data.notes


def test_tables_are_joined_and_set_ups_kept_apart(small: TwistReadings) -> None:
    other = replace(small, sha256="1" * 64, source="other.csv", twist=1.1 * small.twist)
    both = joined([small, other])
    assert both.n == 2 * small.n
    assert len(set(both.setup)) == 2 * len(set(small.setup))
    refuses("J003", "the same file twice", joined, [small, small])
    refuses("J003", "synthetic and measured ones together", joined, [small, replace(other, synthetic=False)])


# --- reflectors -------------------------------------------------------------------------------------------------------

SPOTS = np.array([[0.2, 0.0, 0.1], [-0.1, 0.25, 0.0], [0.0, -0.2, 0.2], [0.1, 0.1, -0.2]])


def turned(points: np.ndarray, t: np.ndarray, r: np.ndarray, origin: np.ndarray) -> np.ndarray:
    """Points moved by t and turned by the rotation vector r about the origin."""
    angle = np.linalg.norm(r)
    k = r / angle
    a = points - origin
    return origin + t + a * np.cos(angle) + np.cross(k, a) * np.sin(angle) + np.outer(a @ k, k) * (1.0 - np.cos(angle))


def test_a_rigid_motion_is_found_exactly() -> None:
    t, r, origin = np.array([1e-5, -2e-5, 3e-5]), np.array([1e-4, 2e-4, -3e-4]), np.array([0.3, -0.2, 0.5])
    m = motion(SPOTS, turned(SPOTS, t, r, origin), origin, "test")
    # Round-off of coordinates of some 0.5 m: 1e-16 over levers of 0.2 m.
    assert_allclose(m.twist, [*t, *r], atol=2e-15)
    assert_allclose(m.residuals, 0.0, atol=1e-15)


def test_large_turns_and_mirrored_noise_do_not_fool_the_fit() -> None:
    r = np.array([0.5, -0.7, 0.3])
    assert_allclose(
        motion(SPOTS, turned(SPOTS, np.ones(3), r, np.zeros(3)), np.zeros(3), "test").twist[3:], r, atol=1e-14
    )


@pytest.mark.slow
def test_the_covariance_is_that_of_noisy_coordinates() -> None:
    rng, sigma, origin = np.random.default_rng(0), 5e-6, np.array([0.4, 0.1, 0.0])
    noise = sigma * rng.standard_normal((2000, 2, *SPOTS.shape))
    drawn = np.array([motion(SPOTS + a, SPOTS + b, origin, "test").twist for a, b in noise])
    expected = sigma**2 * motion(SPOTS, SPOTS, origin, "test").covariance
    sd = np.sqrt(np.diag(expected))
    # 2000 draws: 1.6 % standard error of a standard deviation, 2.2 % of a correlation; three of them.
    assert_allclose(drawn.std(axis=0), sd, rtol=0.05)
    assert_allclose(np.corrcoef(drawn.T), expected / np.outer(sd, sd), atol=0.07)


def test_relative_motion_is_in_the_joints_axes() -> None:
    origin = np.array([0.1, 0.2, 0.3])
    before = motion(SPOTS, turned(SPOTS, np.array([1e-6, 0, 0]), np.array([0, 0, 1e-5]), origin), origin, "b")
    behind = motion(SPOTS, turned(SPOTS, np.array([3e-6, 0, 0]), np.array([0, 0, 4e-5]), origin), origin, "a")
    R = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    twist, _ = relative(before, behind, R)
    # The joint's Z is the base's X, its Y the base's Z.
    assert_allclose(twist, [0, 0, 2e-6, 0, 3e-5, 0], atol=1e-14)


def reflector_table(folder: Path, data: TwistReadings, *, noise: float = 0.0, line: bool = False) -> Path:
    """The campaign as coordinates: arms before and behind the joint, moved as the truth says."""
    rng = np.random.default_rng(3)
    frames = forward_kinematics(ROBOT, data.q)
    path = folder / "synthetic_reflectors.csv"
    spots = np.outer([-0.2, 0.0, 0.1, 0.3], [1.0, 0.0, 0.0]) if line else SPOTS
    with path.open("w", newline="") as stream:
        w = csv.writer(stream)
        names = "joint fx_N fy_N fz_N px_mm py_mm pz_mm phase pose reading arm reflector"
        names += " x0_mm y0_mm z0_mm x_mm y_mm z_mm origin"
        w.writerow([*ROBOT.coordinates, *names.split()])
        for i in range(data.n):
            j = data.joint[i]
            R, p = frames.R[i, j + 1] @ ROBOT.R_post[j].T, frames.p[i, j + 1]
            common = np.array([2e-5, -1e-5, 3e-5]), np.array([1e-5, 2e-5, 3e-5])
            own = R @ data.twist[i, :3], R @ data.twist[i, 3:]
            for arm in ("before", "behind"):
                still = p + spots + (0.3 if arm == "behind" else -0.3) * R[:, 0]
                moved = turned(still, *common, p)
                if arm == "behind":
                    moved = turned(still, common[0] + own[0], common[1] + own[1], p)
                for k in range(len(spots)):
                    a, b = (1e3 * (x[k] + noise * rng.standard_normal(3)) for x in (still, moved))
                    w.writerow(
                        [
                            *np.degrees(data.q[i]),
                            ROBOT.joint_names[j],
                            *data.wrench[i, :3],
                            *(1e3 * data.point[i]),
                            data.phase[i],
                            data.setup[i].split("/")[0],
                            f"r{i}",
                            arm,
                            f"{arm}{k}",
                            *a,
                            *b,
                            "synthetic",
                        ]
                    )
    return path


def test_reflectors_give_the_same_stiffnesses(tmp_path: Path) -> None:
    data = readings(truth())
    small = data.select((data.joint == 1) & (np.array(data.phase) == "loading"))
    back = read_twists(reflector_table(tmp_path, small), ROBOT)
    assert back.n == small.n
    # Small turns add up to first order: 1e-4 of a turn of 1e-4, and coordinates have 1e-16 m.
    assert_allclose(back.twist, small.twist, atol=5e-8)
    d, e = (identify(tx200(), x, law="constant", branches="loading").directions["j2", "rz"] for x in (small, back))
    # Turns of 1e-4 rad: products of turns are 1e-4 of them.
    assert_allclose(e.value, d.value, rtol=1e-3)


def test_the_trackers_noise_is_found_from_what_the_fits_leave_over(tmp_path: Path) -> None:
    data = readings(truth(), replace(EXACT, unloading=False))
    small = data.select((data.joint == 1) & (data.load == 600.0))
    back = read_twists(reflector_table(tmp_path, small, noise=5e-6), ROBOT)
    found = float(back.notes[-1].split("noise of ")[1].split(" um")[0])
    # 42 readings with 12 spare coordinates each: 3 % standard error, three of them.
    assert found == pytest.approx(5.0, rel=0.1)
    assert np.isfinite(back.sigma).all()
    off = (back.twist - small.twist) / back.sigma
    assert off.std() == pytest.approx(1.0, rel=0.25)


def test_reflectors_in_line_or_too_few_are_refused(tmp_path: Path) -> None:
    data = readings(truth())
    small = data.select((data.joint == 1) & (data.load == 600.0)).select(np.arange(42) < 2)
    text = faults(reflector_table(tmp_path, small, line=True))
    assert "reading r0, arm before the joint: reflectors nearly in line" in text
    assert "reading r1" in text  # all at once
    path = reflector_table(tmp_path, small)
    rows = path.read_text().splitlines()
    path.write_text("\n".join([rows[0], *rows[3:]]) + "\n")
    assert "reading r0, arm before the joint: reflectors: got 2; allowed: 3 or more" in faults(path)


def test_faults_of_reflector_tables(tmp_path: Path) -> None:
    data = readings(truth())
    small = data.select((data.joint == 1) & (data.load == 600.0)).select(np.arange(42) < 1)
    path = reflector_table(tmp_path, small)
    rows = [line.split(",") for line in path.read_text().splitlines()]
    arm, x, phase = (rows[0].index(name) for name in ("arm", "x_mm", "phase"))
    rows[1][arm], rows[2][x] = "in front", "99999"
    path.write_text("\n".join(",".join(r) for r in rows) + "\n")
    text = faults(path)
    assert "row 2, column arm: got 'in front'; allowed: before, behind" in text
    assert "row 3, columns x_mm y_mm z_mm, the reflector moved by more than 50 mm" in text
    path = reflector_table(tmp_path, small)
    rows = [line.split(",") for line in path.read_text().splitlines()]
    rows[3][phase] = "unloading" if rows[3][phase] == "loading" else "loading"
    path.write_text("\n".join(",".join(r) for r in rows) + "\n")
    assert "reading r0: its rows differ in pose, joint, load or phase" in faults(path)


def test_the_campaign_moves_every_joint() -> None:
    q = poses()
    assert q.shape == (6, 7, 2, 6)
    assert ROBOT.reachable(q.reshape(-1, 6)).all()
    for j in range(6):
        assert len(np.unique(np.round(q[j, :, :, j], 9))) == 7
