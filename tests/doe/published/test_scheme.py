"""Scheme files: the bundled one is the paper's, and every fault gets one clear message."""

from __future__ import annotations

from importlib import resources
from pathlib import Path

import pytest

from doe import Scheme, bundled_scheme, load_scheme
from doe.published.scheme import parse_scheme
from robots import InputError, InputErrors, Robot

TEXT = resources.files("doe").joinpath("schemes", "xr701.toml").read_text(encoding="utf-8")
Q5_LAW = '[[law]]\njoint = "j5"\ninputs = ["q5_deg", "q2_deg"]\nsymmetric_in = "q5_deg"\n'


def changed(old: str, new: str) -> str:
    assert TEXT.count(old) == 1
    return TEXT.replace(old, new)


def test_the_bundled_scheme_is_the_papers(scheme: Scheme, xr701: Robot) -> None:
    scheme.check_against(xr701)
    assert [(s.joints, s.poses, s.levels) for s in scheme.stage] == [
        (("j2", "j3"), ("5", "41", "77"), 10),
        (("j5",), ("4", "40", "76"), 10),
        (("j4",), ("3", "39", "75"), 10),
    ]
    assert scheme.low_Nm_per_rad == 1e5
    assert scheme.high_Nm_per_rad == 1e6
    assert list(scheme.loads_N) == [650.0]
    assert scheme.regression_degree == 6


def test_a_robot_without_a_scheme_has_none() -> None:
    assert bundled_scheme("kr60-3") is None


def test_a_file_reads_like_the_bundled_scheme(tmp_path: Path, scheme: Scheme) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(TEXT, encoding="utf-8")
    assert load_scheme(path) == scheme


BAD = {
    "missing law": (changed(Q5_LAW, ""), r"no \[\[law\]\] for j5"),
    "bounds reversed": (
        changed("low_Nm_per_rad = 1e5", "low_Nm_per_rad = 1e7"),
        "low_Nm_per_rad must be below high_Nm_per_rad",
    ),
    "negative bound": (
        changed("low_Nm_per_rad = 1e5", "low_Nm_per_rad = -1e5"),
        r"low_Nm_per_rad: .*greater than 0: got -100000\.0",
    ),
    "infinite bound": (changed("high_Nm_per_rad = 1e6", "high_Nm_per_rad = inf"), "high_Nm_per_rad: .*finite"),
    "syntax": (changed("[sensitivity]", "[sensitivity"), r"not valid TOML .*line"),
    "unknown key": (changed("gauge_mm = 0.01", "gauge_mm = 0.01\ngage = 1"), "gage: unknown key"),
    "missing key": (changed("initial_Nm_per_rad = 1e6\n", ""), "initial_Nm_per_rad: this key is missing"),
    "symmetry elsewhere": (
        changed('symmetric_in = "q5_deg"', 'symmetric_in = "q4_deg"'),
        "symmetric_in 'q4_deg' is not one of the inputs",
    ),
    # With three levels the two neighbours of the best one are the whole grid: nothing could be refined.
    "three levels": (TEXT.replace("levels = 10", "levels = 3", 1), "levels: .*greater than or equal to 4: got 3"),
    "two stages for a joint": (
        changed('joints = ["j4"]\n', 'joints = ["j2"]\n'),
        "j2: calibrated in two stages",
    ),
    "two laws": (changed(Q5_LAW, Q5_LAW + Q5_LAW), "j5: given two laws"),
    "levels without input": (
        changed("[-100, 0, 100]]", "[-100, 0, 100], [0]]"),
        "one non-empty list for each input",
    ),
    "adjusts nothing": (
        changed('coordinate = "q3real_deg"', 'coordinate = "q3_deg"'),
        "adjust: coordinate 'q3_deg' is not one of the inputs",
    ),
    "condition that cannot hold": (
        changed('coordinate = "q2_deg", equals', 'coordinate = "q4_deg", equals'),
        "when.coordinate 'q4_deg' is not an input before 'q3real_deg'",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", BAD)
def test_a_bad_scheme_gets_one_message_with_file_and_fault(case: str) -> None:
    text, message = BAD[case]
    with pytest.raises(InputError, match=message) as caught:
        parse_scheme(text, "mine.toml")
    assert not isinstance(caught.value, InputErrors)
    assert str(caught.value).startswith("mine.toml")
    assert "To fix it" in str(caught.value)
    assert "Value error" not in str(caught.value)


def test_several_faults_are_reported_together() -> None:
    text = changed("gauge_mm = 0.01", "gauge_mm = 0").replace("regression_degree = 6", "regression_degree = 60")
    with pytest.raises(InputErrors, match=r"2 problem") as caught:
        parse_scheme(text, "mine.toml")
    assert "gauge_mm" in str(caught.value)
    assert "regression_degree" in str(caught.value)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('joints = ["j2", "j3", "j4", "j5"]\nposes', 'joints = ["j2", "j9"]\nposes', "joint of xr701: got 'j9'"),
        ('joint = "j2"\ninputs = ["q2_deg"]', 'joint = "j2"\ninputs = ["q3_deg"]', "coordinate of xr701: got 'q3_deg'"),
    ],
)
def test_names_the_robot_has_not_are_told_with_those_it_has(xr701: Robot, old: str, new: str, message: str) -> None:
    with pytest.raises(InputError, match=message) as caught:
        parse_scheme(changed(old, new), "mine.toml").check_against(xr701)
    assert "q3real_deg" in str(caught.value) or "j1, j2, j3" in str(caught.value)


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"scheme file .*none\.toml cannot be read"):
        load_scheme(tmp_path / "none.toml")


def test_a_file_that_is_not_text_is_named(tmp_path: Path) -> None:
    path = tmp_path / "scheme.toml"
    path.write_bytes(b"\xff\xfe\x00title")
    with pytest.raises(InputError, match=r"scheme\.toml cannot be read"):
        load_scheme(path)
