"""Calibration files: the bundled one is the paper's, and every fault gets one clear message."""

from __future__ import annotations

from importlib import resources
from pathlib import Path

import pytest
from refusals import refuses, refuses_each

from doe import Campaign, bundled_campaign, load_campaign
from doe.estimation.campaign import parse_campaign
from robots import InputErrors, Robot

TEXT = resources.files("doe").joinpath("schemes", "xr701.toml").read_text(encoding="utf-8")
Q5_LAW = (
    '[[law]]\nkind = "regression"\njoint = "j5"\ninputs = ["q5_deg", "q2_deg"]\ndegree = 6\nsymmetric_in = "q5_deg"\n'
)


def changed(old: str, new: str) -> str:
    assert TEXT.count(old) == 1
    return TEXT.replace(old, new)


def test_the_bundled_scheme_is_the_papers(scheme: Campaign, xr701: Robot) -> None:
    scheme.check_against(xr701)
    assert [(s.parameters, s.poses, s.levels) for s in scheme.stage] == [
        (("j2.law", "j3.law"), ("5", "41", "77"), 10),
        (("j5.law",), ("4", "40", "76"), 10),
        (("j4.law",), ("3", "39", "75"), 10),
    ]
    assert scheme.springs.ends == (1e5, 1e6)
    assert list(scheme.loads_N) == [650.0]
    assert [law.degree for law in scheme.regressions] == [6, 6, 6, 6]


def test_a_robot_without_a_scheme_has_none() -> None:
    assert bundled_campaign("kr60-3") is None


def test_a_file_reads_like_the_bundled_campaign(tmp_path: Path, scheme: Campaign) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(TEXT, encoding="utf-8")
    assert load_campaign(path) == scheme


BAD = {
    "missing law": (changed(Q5_LAW, ""), r"stage 'step 2': j5.law is not among"),
    "bounds reversed": (
        changed("low_Nm_per_rad = 1e5", "low_Nm_per_rad = 1e7"),
        "low_Nm_per_rad must be below high_Nm_per_rad",
    ),
    "negative bound": (
        changed("low_Nm_per_rad = 1e5", "low_Nm_per_rad = -1e5"),
        r"low_Nm_per_rad: .*greater than 0: got -100000\.0",
    ),
    "infinite bound": (changed("high_Nm_per_rad = 1e6", "high_Nm_per_rad = inf"), "high_Nm_per_rad: .*finite"),
    "syntax": (changed("[compare.sensitivity]", "[compare.sensitivity"), r"not valid TOML .*line"),
    "unknown key": (changed("gauge_mm = 0.01", "gauge_mm = 0.01\ngage = 1"), "gage: unknown key"),
    "missing key": (changed('robot = "xr701"\n', ""), "robot: this key is missing"),
    "the format before": (
        changed('"stiffarm-calibration/1"', '"stiffarm-scheme/1"'),
        "schema: got 'stiffarm-scheme/1'; allowed: stiffarm-calibration/1",
    ),
    "no levels": (
        changed('poses = ["3", "39", "75"]\nlevels = 10', 'poses = ["3", "39", "75"]'),
        "needs 'levels' and 'poses'",
    ),
    "symmetry elsewhere": (
        changed('symmetric_in = "q5_deg"', 'symmetric_in = "q4_deg"'),
        "symmetric_in 'q4_deg' is not one of the inputs",
    ),
    # With three levels the two neighbours of the best one are the whole grid: nothing could be refined.
    "three levels": (TEXT.replace("levels = 10", "levels = 3", 1), "levels: .*greater than or equal to 4: got 3"),
    "two stages for a joint": (
        changed('["j4.law"]\n', '["j2.law"]\n'),
        "j2.law: studied in two stages",
    ),
    "two laws": (changed(Q5_LAW, Q5_LAW + Q5_LAW), "j5.law: set free twice"),
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
}


@pytest.mark.parametrize("case", BAD)
def test_a_bad_scheme_gets_one_message_with_file_and_fault(case: str) -> None:
    text, message = BAD[case]
    caught = refuses("F005 F006 F011", message, parse_campaign, text, "mine.toml")
    assert not isinstance(caught, InputErrors)
    assert str(caught).startswith("mine.toml")
    assert "To fix it" in str(caught)
    assert "Value error" not in str(caught)


def test_several_faults_are_reported_together() -> None:
    text = changed("gauge_mm = 0.01", "gauge_mm = 0").replace("degree = 6", "degree = 60", 1)
    caught = refuses_each("F011", r"2 problem", parse_campaign, text, "mine.toml")
    assert "gauge_mm" in str(caught)
    assert "degree" in str(caught)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('joints = ["j2", "j3", "j4", "j5"]\nposes', 'joints = ["j2", "j9"]\nposes', "joint of xr701: got 'j9'"),
        ('joint = "j2"\ninputs = ["q2_deg"]', 'joint = "j2"\ninputs = ["q3_deg"]', "coordinate of xr701: got 'q3_deg'"),
    ],
)
def test_names_the_robot_has_not_are_told_with_those_it_has(xr701: Robot, old: str, new: str, message: str) -> None:
    caught = refuses("C002", message, parse_campaign(changed(old, new), "mine.toml").check_against, xr701)
    assert "q3real_deg" in str(caught) or "j1, j2, j3" in str(caught)


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    refuses("F001", r"calibration file .*none\.toml cannot be read", load_campaign, tmp_path / "none.toml")


def test_a_file_that_is_not_text_is_named(tmp_path: Path) -> None:
    path = tmp_path / "scheme.toml"
    path.write_bytes(b"\xff\xfe\x00title")
    refuses("F004", r"scheme\.toml cannot be read", load_campaign, path)


def test_a_stage_may_study_as_many_springs_as_the_grid_holds(xr701: Robot) -> None:
    """Four joints of ten levels are 10 000 runs a pose; the format before took three joints at most."""
    text = changed('parameters = ["j2.law", "j3.law"]', 'parameters = ["j2.law", "j3.law", "j5.law", "j4.law"]')
    second, third = (text.index(f'[[stage]]\nname = "step {k}"') for k in (2, 3))
    text = text[:second] + text[text.index("# Which angles", third) :]
    parse_campaign(text, "mine.toml").check_against(xr701)


def test_the_documented_file_is_the_bundled_one_in_short() -> None:
    """The example of docs/reference/calibration_files.md is read, and studies the same springs at the same poses."""
    page = (Path(__file__).parents[3] / "docs" / "reference" / "calibration_files.md").read_text(encoding="utf-8")
    blocks = page.split("```toml\n")[1:]
    published = [parse_campaign(block.split("```")[0], f"block {k}") for k, block in enumerate(blocks)]
    staged = next(c for c in published if c.regressions)
    bundled = bundled_campaign("xr701")
    assert bundled is not None
    assert (staged.stage, staged.law, staged.springs, staged.compare) == (
        bundled.stage,
        bundled.law,
        bundled.springs,
        bundled.compare,
    )
