"""Forces of an end mill: closed forms of the book, slices by hand, what must not change, bad input."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from cutting_cases import CHIP, MILL, wall_force, wall_task
from refusals import refuses

from machining import Task, tool_path
from machining.cutting import (
    ConstantForce,
    EndMill,
    Engagement,
    MillingForce,
    down_milling,
    published,
    read_milling,
    slotting,
    up_milling,
)
from machining.cutting.coefficients import PUBLISHED, CuttingCoefficients, shop_coefficients
from machining.cutting.end_mill import (
    generating_matrix,
    immersion,
    instant_matrix,
    mean_matrix,
    mean_torque,
    peak_forces,
)
from machining.cutting.plunging import Thrust, with_thrust
from machining.programs.compensation import milling_force
from machining.toolpaths import read_given_path
from robots import InputError, InputErrors
from robots.arrays import Array

K = published("al7075-t6").values
ONE = np.array([CHIP])
MILLS = [EndMill(0.012, 3, np.radians(h)) for h in (0.0, 1e-3, 30.0, 45.0)]


def mean_of(mill: EndMill, cut: Engagement, values: Array = K) -> Array:
    P = mean_matrix(mill, cut.axial_depth, np.array([cut.entry]), np.array([cut.exit]), ONE)
    return np.asarray((P @ values)[0])


def instants(mill: EndMill, cut: Engagement, rotation: Array) -> Array:
    P = instant_matrix(mill, cut.axial_depth, np.array([cut.entry]), np.array([cut.exit]), ONE, rotation)
    return np.asarray(P[0])


def by_slices(mill: EndMill, cut: Engagement, rotation: float, count: int = 20000) -> tuple[Array, float]:
    """Force on the tool and torque, by thin discs and the vectors of tooth position and velocity."""
    z = (np.arange(count) + 0.5) / count * cut.axial_depth
    force, torque = np.zeros(3), 0.0
    for j in range(mill.teeth):
        phi = np.mod(
            rotation + j * 2.0 * np.pi / mill.teeth - 2.0 * z * np.tan(mill.helix) / mill.diameter, 2.0 * np.pi
        )
        phi = phi[(phi >= cut.entry) & (phi <= cut.exit)]
        h, dz = CHIP * np.sin(phi), cut.axial_depth / count
        out = np.stack([np.sin(phi), np.cos(phi), 0.0 * phi], axis=1)  # from the axis to the tooth
        forward = np.stack([np.cos(phi), -np.sin(phi), 0.0 * phi], axis=1)  # its velocity, clockwise
        t, r, a = ((K[2 * i] * h + K[2 * i + 1]) * dz for i in range(3))
        force += (-t[:, None] * forward - r[:, None] * out).sum(axis=0) - np.array([0.0, 0.0, a.sum()])
        torque += 0.5 * mill.diameter * t.sum()
    return force, torque


@pytest.mark.parametrize("mill", MILLS)
def test_slotting_is_the_closed_form(mill: EndMill) -> None:
    """Mean forces of full immersion: the linear fit by which coefficients are identified."""
    a, n = 0.004, mill.teeth
    tc, te, rc, re, ac, ae = K
    expected = [
        -n * a * (CHIP * rc / 4.0 + re / np.pi),
        n * a * (CHIP * tc / 4.0 + te / np.pi),
        -n * a * (CHIP * ac / np.pi + ae / 2.0),
    ]
    np.testing.assert_allclose(mean_of(mill, slotting(mill, a)), expected, rtol=1e-13)


@pytest.mark.parametrize("mill", MILLS)
@pytest.mark.parametrize("radial", [0.0005, 0.006, 0.0119])
@pytest.mark.parametrize("way", [up_milling, down_milling])
def test_the_mean_is_that_of_all_rotations_and_the_helix_does_not_matter(mill: EndMill, radial: float, way) -> None:  # type: ignore[no-untyped-def]
    cut = way(mill, 0.007, radial)
    turns = (np.arange(3600) + 0.5) / 3600 * 2.0 * np.pi
    # Straight teeth enter in one step: the grid of rotations sees it to 1/3600 of a turn times the force.
    np.testing.assert_allclose(instants(mill, cut, turns).mean(axis=0) @ K, mean_of(mill, cut), rtol=3e-2, atol=0.2)
    straight = replace(mill, helix=0.0)
    np.testing.assert_allclose(mean_of(mill, cut), mean_of(straight, cut), rtol=1e-14)
    if mill.helix > 0.1:
        # With a helix the force is continuous, and the rule converges with the square.
        np.testing.assert_allclose(
            instants(mill, cut, turns).mean(axis=0) @ K, mean_of(mill, cut), rtol=1e-4, atol=1e-3
        )


@pytest.mark.parametrize("mill", [*MILLS[2:], EndMill(0.006, 2, np.radians(55.0)), EndMill(0.02, 1, np.radians(20.0))])
@pytest.mark.parametrize("depth", [0.001, 0.01, 0.05])
def test_an_instant_is_the_sum_of_thin_slices(mill: EndMill, depth: float) -> None:
    for cut in (up_milling(mill, depth, 0.3 * mill.diameter), Engagement(depth, 0.6, 2.0)):
        rotation = np.array([0.0, 0.4, 1.7, 3.0, 5.9])
        exact = instants(mill, cut, rotation) @ K
        slices = np.array([by_slices(mill, cut, r)[0] for r in rotation])
        # 20000 discs: each end of the engaged part is known to one of them.
        np.testing.assert_allclose(exact, slices, rtol=0, atol=3e-4 * np.abs(slices).max())


def test_a_small_helix_tends_to_straight_teeth() -> None:
    rotation = np.array([0.3, 1.0, 2.9, 4.0])  # off the ends of the cut, where straight teeth jump
    cut = slotting(MILLS[0], 0.005)
    straight = instants(MILLS[0], cut, rotation)
    for helix in (1e-3, 1e-6, 1e-9, 1e-13):
        # The force changes in proportion to the lag over the depth; round-off stays below 1e-8 of it.
        lag = instants(replace(MILLS[0], helix=helix), cut, rotation)
        np.testing.assert_allclose(lag, straight, rtol=0, atol=np.abs(straight).max() * (2.0 * helix + 1e-8))


def test_a_depth_of_a_whole_axial_pitch_gives_a_steady_force() -> None:
    mill = EndMill(0.010, 4, np.radians(45.0))
    cut = up_milling(mill, mill.pitch / mill.lag, 0.003)
    forces = instants(mill, cut, np.linspace(0.0, 2.0 * np.pi, 41)) @ K
    np.testing.assert_allclose(forces, np.tile(mean_of(mill, cut), (41, 1)), rtol=1e-12)


def test_one_straight_tooth_at_the_front() -> None:
    """At 90 deg the tooth moves against the cross-feed axis: it pushes the tool back along it, and out of the chip."""
    mill, cut = EndMill(0.01, 1), Engagement(0.002, 0.1, 3.0)
    t, r, a = (0.002 * (K[2 * i] * CHIP + K[2 * i + 1]) for i in range(3))
    np.testing.assert_allclose(instants(mill, cut, np.array([0.5 * np.pi]))[0] @ K, [-r, t, -a], rtol=1e-13)


def test_down_milling_mirrors_up_milling() -> None:
    up, down = mean_of(MILL, up_milling(MILL, 0.005, 0.002)), mean_of(MILL, down_milling(MILL, 0.005, 0.002))
    tangential, radial = K * [1, 1, 0, 0, 0, 0], K * [0, 0, 1, 1, 0, 0]
    cuts = up_milling(MILL, 0.005, 0.002), down_milling(MILL, 0.005, 0.002)
    # Mirrored in the plane across the feed axis' normal: tangential forces swap the sign of F_feed, radial of F_cross.
    for part, sign in ((tangential, [-1, 1, 1]), (radial, [1, -1, 1])):
        np.testing.assert_allclose(mean_of(MILL, cuts[1], part), mean_of(MILL, cuts[0], part) * sign, atol=1e-12)
    # Up milling holds the feed back; down milling pushes off its wall on the right.
    assert up[0] < 0.0 < down[1]


def test_power_is_mean_torque_times_speed() -> None:
    for cut in (slotting(MILL, 0.003), down_milling(MILL, 0.004, 0.0015)):
        turns = (np.arange(60) + 0.5) / 60 * MILL.pitch
        power = np.mean([by_slices(MILL, cut, r, 2000)[1] for r in turns]) * 900.0
        # 60 rotations and 2000 discs.
        assert mean_torque(MILL, cut, ONE, K)[0] * 900.0 == pytest.approx(power, rel=2e-3)


def test_energy_per_volume_is_the_specific_force() -> None:
    """Without edge forces each volume of chip takes K_tc, whatever the engagement."""
    values = np.array([7e8, 0.0, 2e8, 0.0, 0.0, 0.0])
    for radial in (0.0005, 0.004, 0.01):
        cut = up_milling(MILL, 0.003, radial)
        volume = 0.003 * radial * MILL.teeth * CHIP  # a revolution
        energy = mean_torque(MILL, cut, ONE, values)[0] * 2.0 * np.pi
        assert energy == pytest.approx(7e8 * volume, rel=1e-12)


def test_the_wall_is_made_where_the_tooth_stands_at_it() -> None:
    cut = up_milling(MILL, 0.006, 0.002)
    ends = np.array([cut.entry]), np.array([cut.exit])
    z = 0.0025
    at = generating_matrix(MILL, cut, *ends, ONE, z, 1)[0] @ K
    np.testing.assert_allclose(at, by_slices(MILL, cut, 2.0 * z * np.tan(MILL.helix) / MILL.diameter)[0], rtol=2e-3)
    mean = generating_matrix(MILL, cut, *ends, ONE, None, 64)[0] @ K
    fine = generating_matrix(MILL, cut, *ends, ONE, None, 4096)[0] @ K
    # What SLICES promises.
    np.testing.assert_allclose(mean, fine, atol=1e-3 * np.abs(fine).max())


def test_down_milling_makes_its_wall_as_the_tooth_leaves() -> None:
    """Straight tooth at 180 deg: no chip is left, its edge alone pushes off the wall and rubs forward."""
    mill = EndMill(0.01, 1)
    cut = down_milling(mill, 0.002, 0.001)
    force = generating_matrix(mill, cut, np.array([cut.entry]), np.array([cut.exit]), ONE, 0.0, 1)[0] @ K
    np.testing.assert_allclose(force, [0.002 * K[1], 0.002 * K[3], -0.002 * K[5]], rtol=1e-9)


def test_the_peak_is_no_less_than_any_rotation() -> None:
    cut = down_milling(MILL, 0.005, 0.001)
    peak = np.linalg.norm(peak_forces(MILL, cut, ONE, K)[0])
    some = np.linalg.norm(instants(MILL, cut, np.linspace(0.0, 7.0, 333)) @ K, axis=1)
    # The grid of a pitch has 720 steps; between two the force changes by less than 1e-3 here.
    assert some.max() <= peak * (1.0 + 1e-3)
    assert peak > np.linalg.norm(mean_of(MILL, cut))
    task = wall_task(4)
    np.testing.assert_allclose(np.linalg.norm(wall_force().peak(task), axis=1), peak, rtol=1e-12)
    np.testing.assert_allclose(wall_force().torque(task), mean_torque(MILL, cut, ONE, K)[0], rtol=1e-12)


def test_feed_per_tooth_comes_from_feed_and_speed() -> None:
    task = wall_task(5, feed=0.02)
    force = wall_force(feed_per_tooth=None, spindle_speed=2.0 * np.pi * 200.0)
    np.testing.assert_allclose(force.chip(task), 0.02 / (200.0 * 4), rtol=1e-14)
    np.testing.assert_allclose(force.along(task).force, wall_force().along(task).force, rtol=1e-12)


def test_published_sets_are_told_apart_by_source() -> None:
    assert published("al7075-t6").values[0] == pytest.approx(767.01e6)
    assert published("al7075-t6").values[1] == pytest.approx(27.7e3)
    assert all(c.source for c in PUBLISHED.values())
    assert "not verified" in published("ti6al4v").source


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: EndMill(-0.01, 4), "diameter"),
        (lambda: EndMill(0.01, 0), "teeth"),
        (lambda: EndMill(0.01, 2.5), "teeth"),  # type: ignore[arg-type]
        (lambda: EndMill(np.nan, 4), "diameter"),
        (lambda: EndMill(0.01, 4, 30.0), "helix"),
        (lambda: EndMill(0.01, 4, np.nan), "helix"),
        (lambda: slotting(MILL, -0.001), "axial depth"),
        (lambda: slotting(MILL, np.nan), "axial depth"),
        (lambda: up_milling(MILL, 0.001, 0.011), "radial depth"),
        (lambda: down_milling(MILL, 0.001, 0.0), "radial depth"),
        (lambda: down_milling(MILL, 0.001, np.nan), "radial depth"),
        (lambda: Engagement(0.001, 1.0, 1.0), "entry and exit"),
        (lambda: Engagement(0.001, 0.0, 4.0), "entry and exit"),
        (lambda: Engagement(0.001, 0.1, 1.0, "left"), "wall"),
        (lambda: Engagement(0.001, 0.0, 1.0, "behind"), "wall"),  # type: ignore[arg-type]
        (lambda: published("cheese"), "al7075-t6"),
        (lambda: CuttingCoefficients(np.ones(5), "x"), "6 finite"),
        (lambda: shop_coefficients(np.nan, 1.0, 1.0, 1.0, source="x"), "6 finite"),
        (lambda: shop_coefficients(0.0, 1.0, 1.0, 1.0, source="x"), "K_tc"),
        (lambda: wall_force(feed_per_tooth=None), "feed per tooth or spindle speed"),
        (lambda: wall_force(spindle_speed=900.0), "one of them"),
        (lambda: wall_force(feed_per_tooth=np.nan), "feed per tooth"),
        (lambda: wall_force(instant="peak"), "instant"),
        (lambda: wall_force(instant="generating", height=0.006), "height"),
        (lambda: wall_force(relative_sd=-0.1), "standard deviation"),
        (lambda: wall_force(covariance=-np.eye(6)), "covariance"),
        (lambda: MillingForce(MILL, slotting(MILL, 0.001), published("al7075"), "generating", CHIP), "wall"),
    ],
)
def test_bad_input_is_named(make, words: str) -> None:  # type: ignore[no-untyped-def]
    refuses("K005", words, make)


def test_a_missing_feed_is_named() -> None:
    force = wall_force(feed_per_tooth=None, spindle_speed=900.0)
    refuses("K007", "feed at path point 0", force.along, wall_task(feed=None))


def test_immersion_of_half_a_mill_is_a_right_angle() -> None:
    assert float(immersion(MILL, 0.005)) == pytest.approx(0.5 * np.pi, rel=1e-14)


# ------------------------------------------------------------
# Plunging and drilling: the force of the end teeth, or none; never a reason to stop

MILLING = """schema = "stiffarm-milling/1"
[mill]
diameter_mm = 16
teeth = 3
[cut]
kind = "down"
axial_depth_mm = 5
radial_depth_mm = 4
spindle_rpm = 6000
[material]
published = "al7075-t6"
"""
PLUNGE = '[plunge]\nchip_N_per_mm2 = 900\nedge_N_per_mm = 20\nsource = "made up"\n'


def force(tmp_path: Path, more: str = PLUNGE) -> MillingForce:
    (tmp_path / "milling.toml").write_text(MILLING + more, encoding="utf-8")
    found = read_milling(tmp_path / "milling.toml").force
    assert isinstance(found, MillingForce)
    return found


def down_and_along() -> Task:
    """A plunge at 0.01 m/s, then a cut at 0.03 m/s."""
    points = np.array([[0.0, 0.0, 0.01], [0.0, 0.0, 0.0], [0.02, 0.0, 0.0], [0.04, 0.0, 0.0]])
    feed = np.array([np.nan, 0.01, 0.03, 0.03])
    return Task(tool_path(points, [0.0, 0.0, 1.0], feed=feed), np.eye(4), np.eye(4))


def test_the_force_of_a_plunge_is_that_of_the_end_teeth(tmp_path: Path) -> None:
    """By hand: c = 10 mm/s / (100 /s x 3) = 1/30 mm; 3 teeth x 8 mm x (900 / 30 + 20) N/mm = 1200 N, up the tool."""
    task, cutting = down_and_along(), np.array([False, True, True, True])
    found = milling_force(force(tmp_path), task, cutting)
    np.testing.assert_allclose(found.force[1], [0.0, 0.0, 1200.0], rtol=1e-12)
    without = milling_force(force(tmp_path, ""), task, cutting)
    np.testing.assert_array_equal(without.force[1], 0.0)
    # The cut beside it is the same, and so is its uncertainty.
    np.testing.assert_allclose(found.force[2:], without.force[2:], rtol=1e-12)
    assert found.names[-2:] == ("K_pc", "K_pe")
    np.testing.assert_allclose(found.covariance[:6, :6], without.covariance)
    np.testing.assert_allclose(np.diag(found.covariance)[6:], [(90.0e6) ** 2, (2.0e3) ** 2])


def test_a_constant_force_does_not_act_where_nothing_is_milled() -> None:
    found = milling_force(ConstantForce([10.0, 0.0, 0.0], "process"), down_and_along(), np.array([0, 1, 1, 1]) > 0)
    np.testing.assert_allclose(found.force[:, 0], [0.0, 0.0, 10.0, 10.0])


def test_a_program_that_only_drills(tmp_path: Path) -> None:
    task, down = down_and_along(), np.array([False, True, False, False])
    found = milling_force(force(tmp_path), task, down)
    np.testing.assert_allclose(found.force[:, 2], [0.0, 1200.0, 0.0, 0.0])
    refuses("K004", "no move mills sideways", milling_force, force(tmp_path, ""), task, down)
    assert with_thrust(None, force(tmp_path, ""), task, down) is None


def test_a_path_of_holes_takes_the_force_of_the_end_teeth_or_says_what_is_missing(tmp_path: Path) -> None:
    path = tmp_path / "hole.nc"
    path.write_text("G21 G90\nG0 X0 Y0 Z10\nG1 Z-5 F600\nG0 Z10\nM30\n", encoding="utf-8")
    given = read_given_path(path)
    task = Task(given.path, np.eye(4), np.eye(4))
    refuses("K007", r"\[plunge\]", given.acting, force(tmp_path, ""))
    acting = given.acting(force(tmp_path))
    assert isinstance(acting, Thrust)
    np.testing.assert_allclose(acting.along(task).force[1], [0.0, 0.0, 1200.0])
    np.testing.assert_allclose(given.acting(ConstantForce([0.0, 0.0, 5.0])).along(task).force[:, 2], 5.0)


def test_a_cut_with_plunges_in_a_file_has_a_force_everywhere(tmp_path: Path) -> None:
    path = tmp_path / "part.nc"
    path.write_text(
        "G21 G90\nG0 X0 Y0 Z10\nG1 Z0 F600\nG1 X20\nG1 Z10\nG0 X0 Y5\nG1 Z0\nG1 X20\nG1 Y9\nG0 Z10\nM30\n",
        encoding="utf-8",
    )
    given = read_given_path(path)
    task = Task(given.path, np.eye(4), np.eye(4))
    found = given.acting(ConstantForce([10.0, 0.0, 0.0], "process")).along(task).force
    np.testing.assert_allclose(np.linalg.norm(found, axis=1), 10.0)
    np.testing.assert_allclose(found[:, 0], [10.0, 10.0, 10.0, 10.0, 0.0], atol=1e-12)


@pytest.mark.parametrize(
    "bad",
    [
        PLUNGE.replace("900", "0"),
        PLUNGE.replace("20", "-1"),
        PLUNGE.replace('source = "made up"\n', ""),
        PLUNGE + "thrust = 3\n",
        PLUNGE + "relative_sd = -1\n",
    ],
)
def test_tables_of_plunges_that_are_not_right(tmp_path: Path, bad: str) -> None:
    with pytest.raises((InputError, InputErrors), match="plunge"):
        force(tmp_path, bad)
