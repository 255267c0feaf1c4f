"""The bundled FANUC campaign by its name alone, against figures found by a numpy program that shares no code."""

from __future__ import annotations

import pytest
from cli_runs import Command

JOINTS = tuple(f"j{k}" for k in range(1, 7))


def test_gear_springs_by_the_name_alone(cli: Command) -> None:
    found = cli("calibrate", "fanuc-r2000ic", "--json").json
    assert found["readings"] == 129
    # Plain least squares gives 0.215; what gives outliers less weight is a little above.
    assert 0.2145 <= found["rms_mm"] <= 0.2185
    assert found["left_one_pose_out_rms_mm"] == pytest.approx(0.234, rel=0.02)
    plain = cli("calibrate", "fanuc-r2000ic", "--no-robust", "--json").json
    assert plain["rms_mm"] == pytest.approx(0.215, rel=0.02)
    assert plain["left_one_pose_out_rms_mm"] == pytest.approx(0.234, rel=0.02)


def test_gear_and_tilt_at_every_joint(cli: Command) -> None:
    free = ",".join(f"{joint}.{row}" for joint in JOINTS for row in ("rx", "ry", "stiffness"))
    found = cli("calibrate", "fanuc-r2000ic", "--free", free, "--no-robust", "--json").json
    assert found["rms_mm"] == pytest.approx(0.160, rel=0.02)
    assert found["left_one_pose_out_rms_mm"] == pytest.approx(0.176, rel=0.02)


def test_intervals_cover_readings_at_poses_left_out_and_held_out(cli: Command) -> None:
    found = cli("calibrate", "fanuc-r2000ic", "--json").json
    covered = found["left_out_in_interval95"]
    assert covered["readings"] == 129
    assert 0.90 <= covered["share"] <= 0.98
    rows = [r for r in found["poses"] if abs(r["left_out_error"]) <= r["left_out_half_width95"]]
    assert len(rows) == covered["inside"]
