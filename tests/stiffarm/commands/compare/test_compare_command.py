"""`compare`: what differs by more than noise, and what cannot be compared at all."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cli_runs import Command, Outcome, run_here
from scipy.stats import t as student
from viewer_maps import arm, kr60_slice

import stiffarm as sa
from doe.estimation.differences import Figure, pairs
from robots import load_description, save_description
from robots.schema.description import Calibration
from robots.schema.uncertainty import CalibrationUncertainty
from stiffarm.commands.compare.map_page import page_of_both
from stiffarm.commands.maps.viewer import viewer_page
from surrogate.maps.data import Axis, Field, Layout, MapData
from surrogate.maps.differences import compare_maps
from surrogate.maps.mesh import read_map, write_map


def model(
    folder: Path,
    name: str,
    stiffness: dict[str, float],
    *,
    relative: float = 0.1,
    data: str = "",
    robot: str = "kr60-3",
) -> Path:
    """A calibrated model whose compliances are known to a share, j2's and j3's with a correlation of -0.9."""
    values = list(stiffness.values())
    u = 1.0 / np.array(values)
    R = np.eye(len(u))
    R[0, 1:2] = R[1:2, 0] = -0.9
    V = R * np.outer(relative * u, relative * u)
    uncertainty = CalibrationUncertainty(
        parameters=tuple(stiffness),
        unit=("N m/rad",) * len(u),
        variable=("1/value",) * len(u),
        estimate=tuple(u.tolist()),
        covariance=tuple(map(tuple, V.tolist())),
        degrees_of_freedom=(50.0,) * len(u),
        status=("determined",) * len(u),
        note="made up",
    )
    origin = Calibration(
        scheme="global",
        load_path="serial",
        links="rigid",
        data="t.csv",
        data_sha256=name,
        rms_mm=0.1,
        loads_N=(100.0,),
        uncertainty=uncertainty,
    )
    save_description(load_description(robot).model_copy(update={"calibration": origin}), folder / f"{name}.toml")
    return folder / f"{name}.toml"


def map_of(folder: Path, data: MapData, **fields: Field) -> Path:
    folder.mkdir()
    kept = replace(data, fields={**data.fields, **fields})
    write_map(kept, folder / "map.vti")
    (folder / "map.json").write_text('{"schema": "stiffarm-map/1"}', encoding="utf-8")
    (folder / "map.html").write_text(viewer_page(kept, *arm("kr60-3"), title="map"), encoding="utf-8")
    return folder


def uncertain(data: MapData, factor: float, percent: float) -> dict[str, Field]:
    k = data.fields["stiffness_N_per_mm"]
    return {
        "stiffness_N_per_mm": replace(k, values=factor * k.values),
        "uncertainty_percent": Field(np.where(data.reached, percent, np.nan), "percent", "standard deviation"),
    }


def rows(outcome: Outcome, table: str = "parameters", key: str = "parameter") -> dict[str, Any]:
    """Rows of a table of the answer by name."""
    return {row[key]: row for row in outcome.json[table]}


def quantities(*folders: Path) -> dict[str, Any]:
    return rows(run_here("compare", *folders, "--json"), "quantities", "name")


def test_numbers_are_judged_in_their_variable_and_together(tmp_path: Path) -> None:
    a = model(tmp_path, "a", {"j2.stiffness": 1e6, "j3.stiffness": 1e6, "j4.stiffness": 1e5})
    b = model(tmp_path, "b", {"j2.rz": 1.05e6, "j3.rz": 1e6, "j4.rz": 2e5})
    outcome = run_here("compare", a, b, "--json")
    numbers = rows(outcome)
    assert {name: p["verdict"] for name, p in numbers.items()} == {
        "j2.stiffness": "within the noise",
        "j3.stiffness": "within the noise",
        "j4.stiffness": "beyond the noise",
    }
    assert numbers["j4.stiffness"]["relative_change"] == pytest.approx(1.0)
    # Compliances 1e-5 and 0.5e-5 with standard deviations of a tenth of each.
    t = 0.5e-5 / math.hypot(1e-6, 0.5e-6)
    # Welch: of 50 degrees of freedom each.
    freedom = 50.0 * (1.0 + 0.25) ** 2 / (1.0 + 0.25**2)
    assert numbers["j4.stiffness"]["p_value"] == pytest.approx(2.0 * student.sf(t, freedom), rel=0.01)
    together = outcome.json["others"][0]["all_at_once"]
    assert together["degrees_of_freedom"] == 3
    assert together["chi_square"] > t**2


def test_correlated_numbers_may_differ_together_though_none_does_alone(tmp_path: Path) -> None:
    """Both compliances are up by 1.2 standard deviations, where noise would raise one and lower the other."""
    a = model(tmp_path, "a", {"j2.stiffness": 1e6, "j3.stiffness": 1e6})
    b = model(tmp_path, "b", {"j2.stiffness": 1.2e6, "j3.stiffness": 1.2e6})
    outcome = run_here("compare", a, b, "--json")
    assert {p["verdict"] for p in rows(outcome).values()} == {"within the noise"}
    assert outcome.json["answer"].startswith("None of 2 ")
    assert outcome.json["others"][0]["all_at_once"]["p_value"] < 1e-3


def test_of_many_numbers_one_differs_by_chance() -> None:
    def list_of(shift: float) -> list[Figure]:
        return [Figure(f"n{k}", "N", 10.0 + (shift if k == 0 else 0.0), 8.0, 12.0, sd=1.0) for k in range(20)]

    def verdict(shift: float) -> str:
        return pairs(list_of(0.0), list_of(shift))[0].verdict

    # 2.5 standard deviations of the difference: below 5 % alone, one of twenty all the same.
    assert verdict(2.5 * math.sqrt(2.0)) == "perhaps"
    assert verdict(4.0 * math.sqrt(2.0)) == "beyond the noise"
    assert verdict(0.5) == "within the noise"


def test_open_numbers_differ_only_where_their_intervals_do_not_touch() -> None:
    def verdict(low: float | None, high: float | None) -> str:
        (pair,) = pairs([Figure("k", "N", None, 5.0, None)], [Figure("k", "N", 3.0, low, high, sd=0.1)])
        return pair.verdict

    assert verdict(2.0, 4.0) == "beyond the noise"
    assert verdict(2.0, 6.0) == "undecided"
    (alone,) = pairs([Figure("k", "N", 1.0, None, None)], [])
    assert alone.b is None


@pytest.mark.slow
def test_maps_are_compared_point_by_point(tmp_path: Path) -> None:
    data = kr60_slice(200.0)
    a = map_of(tmp_path / "a", data, **uncertain(data, 1.0, 3.0))
    b = map_of(tmp_path / "b", data, **uncertain(data, 1.1, 3.0))
    q = rows(run_here("compare", a, b, "--json", "--out", tmp_path / "out"), "quantities", "name")["stiffness_N_per_mm"]
    assert q["points"] == int(data.reached.sum())
    assert q["change_median"] == pytest.approx(0.1, abs=1e-4)
    # ln 1.1 = 0.095 against 1.96 x 0.03 x sqrt 2 = 0.083.
    assert q["share_beyond_noise"] == 1.0
    assert quantities(a, b)["isotropy"]["change_median"] == 0.0
    assert {p.name for p in (tmp_path / "out").iterdir()} >= {"comparison.json", "maps.html", "report.html", "run.json"}
    same = map_of(tmp_path / "c", data, **uncertain(data, 1.05, 3.0))
    assert quantities(a, same)["stiffness_N_per_mm"]["share_beyond_noise"] == 0.0


def test_points_may_stand_in_another_order_or_be_out_of_reach(tmp_path: Path) -> None:
    data = kr60_slice(200.0)
    write_map(data, tmp_path / "whole.vti")
    write_map(data, tmp_path / "reached.vtu")
    both = compare_maps(read_map(tmp_path / "whole.vti"), read_map(tmp_path / "reached.vtu"))
    assert (both.only_a, both.only_b) == (0, 0)
    assert np.abs(both.quantities[0].change).max() < 1e-6


def test_a_map_of_an_uncalibrated_arm_beside_a_calibrated_one_has_a_warning(tmp_path: Path) -> None:
    write_map(kr60_slice(200.0), tmp_path / "a.vti")
    known = read_map(tmp_path / "a.vti")
    warning = "Not calibrated: no joint of this model has a spring."
    bare = replace(known, metadata={**known.metadata, "warning": warning})
    partly = replace(known, metadata={**known.metadata, "warning": "Not fully calibrated: j1 is held rigid."})
    for pair, warned in (((known, bare), 1), ((bare, partly), 2), ((known, known), 0), ((bare, bare), 0)):
        said = [r for r in compare_maps(*pair, ("a.vti", "b.vti")).remarks if r.startswith("warning: ")]
        assert len(said) == warned
        assert all("a.vti" in r or "b.vti" in r for r in said)


def test_an_older_page_is_told_from_one_that_can(tmp_path: Path) -> None:
    page = tmp_path / "old.html"
    page.write_text('<script type="application/json" id="data">{"fields": []}</script>', encoding="utf-8")
    assert page_of_both(page, page, "b") is None


@pytest.fixture
def things(tmp_path: Path) -> dict[str, Path]:
    data = kr60_slice(200.0)
    k = data.fields["stiffness_N_per_mm"]
    made = {
        "CAL": model(tmp_path, "cal", {"j2.stiffness": 1e6, "j3.stiffness": 1e6}),
        "OTHER": model(tmp_path, "other", {"j2.stiffness": 1e6, "j3.stiffness": 1e6}, robot="tx200"),
        "APART": model(tmp_path, "apart", {"j5.stiffness": 1e6, "j6.stiffness": 1e6}),
        "MAP": map_of(tmp_path / "map", data),
        "LOAD": map_of(tmp_path / "load", replace(data, metadata={**data.metadata, "load": "sideways"})),
        "GRID": map_of(tmp_path / "grid", kr60_slice(170.0)),
        "UNIT": map_of(tmp_path / "unit", data, stiffness_N_per_mm=replace(k, unit="N/um")),
        "EMPTY": tmp_path / "empty",
        "TEXT": tmp_path / "text.json",
        "SPOILT": tmp_path / "spoilt.vti",
    }
    made["EMPTY"].mkdir()
    made["TEXT"].write_text("{}", encoding="utf-8")
    made["SPOILT"].write_text("<VTKFile>", encoding="utf-8")
    return made


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        ("CAL MAP MAP MAP MAP MAP MAP MAP MAP", "2 to 8"),
        ("CAL CAL", "twice"),
        ("CAL MAP", "things of one kind"),
        ("CAL OTHER", "one robot"),
        ("CAL APART", "no parameter in common"),
        ("MAP LOAD", "other quantities"),
        ("MAP GRID", "other points"),
        ("MAP UNIT", "units of stiffness_N_per_mm"),
        ("CAL EMPTY", "results folder"),
        ("CAL TEXT", "argument 2"),
        ("CAL nowhere", "check the path"),
        ("MAP SPOILT", "spoilt.vti"),
    ],
)
def test_bad_input_is_one_message(arguments: str, told: str, things: dict[str, Path], cli: Command) -> None:
    outcome = cli("compare", *(things.get(word, word) for word in arguments.split()))
    assert outcome.code == 2, outcome.err
    assert told in outcome.err
    assert len(outcome.err.strip().splitlines()) == 1


def test_an_uncalibrated_model_is_refused(tmp_path: Path) -> None:
    save_description(load_description("kr60-3"), tmp_path / "plain.toml")
    with pytest.raises(sa.InputError, match="not calibrated"):
        sa.compare(tmp_path / "plain.toml", tmp_path / "plain.toml")


def test_diagnoses_and_placements_by_their_files(tmp_path: Path) -> None:
    number = {"sd": 1.0, "unit": "N", "interval95": [28.0, 32.0], "plausible": [10, 80], "value": 30.0}
    content = {
        "schema": "stiffarm-diagnosis/2",
        "robot": "kr60-3",
        "verdict": "named",
        "springs": {},
        "gap": {},
        "effects": [{"code": "payload", "parameters": {"force": number}}],
        "data_sha256": "x",
    }
    other = json.loads(json.dumps(content))
    other["effects"][0]["parameters"]["force"]["value"] = 60.0
    placed = {
        "schema": "stiffarm-placement/2",
        "robot": "tx200",
        "cell": "wing",
        "placements": [{"placement": "recommended", "K_sf": 1.0, "K_sf_interval95": [0.9, 1.1], "axes_mm": {}}],
    }
    for name, text in (("a", content), ("b", other)):
        (tmp_path / f"{name}.json").write_text(json.dumps(text), encoding="utf-8")
    found = sa.compare(tmp_path / "a.json", tmp_path / "b.json")
    assert found.differs == (("payload.force",),)
    assert "payload.force" in found.answer
    assert list(found.to_frame()["parameter"]) == ["payload.force"]
    for name in ("p", "q"):
        (tmp_path / f"{name}.json").write_text(json.dumps(placed), encoding="utf-8")
    assert sa.compare(tmp_path / "p.json", tmp_path / "q.json").differs == ((),)
    (tmp_path / "q.json").write_text(json.dumps(placed | {"placements": 7}), encoding="utf-8")
    with pytest.raises(sa.InputError, match=r"q\.json does not hold"):
        sa.compare(tmp_path / "p.json", tmp_path / "q.json")


def test_two_runs_are_compared_by_their_calibrations(cli: Command, tmp_path: Path) -> None:
    for name, k in (("a", 1e5), ("b", 2e5)):
        folder = tmp_path / name
        folder.mkdir()
        model(folder, "model", {"j2.stiffness": 4e5, "j4.stiffness": k})
        (folder / "results.json").write_text("{}", encoding="utf-8")
    outcome = cli("compare", tmp_path / "a", tmp_path / "b", "--json")
    assert rows(outcome)["j4.stiffness"]["verdict"] == "beyond the noise"
    assert f"{tmp_path / 'b'}/diagnosis" in " ".join(outcome.json["remarks"])


def test_points_that_several_poses_reach_are_told_apart_by_pose(tmp_path: Path) -> None:
    one = read_map(map_of(tmp_path / "m", kr60_slice(400.0)) / "map.vti")
    twice = replace(
        one,
        points=np.tile(one.points, (2, 1)),
        q=np.vstack([one.q, one.q + 1.0]),
        reached=np.tile(one.reached, 2),
        layout=Layout("points", (Axis("point", "", np.arange(2.0 * one.layout.n)),)),
        fields={name: replace(f, values=np.tile(f.values, 2)) for name, f in one.fields.items()},
    )
    both = compare_maps(twice, twice)
    assert (both.only_a, both.only_b, len(both.points)) == (0, 0, 2 * int(one.reached.sum()))
