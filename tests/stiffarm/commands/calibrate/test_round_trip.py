"""For every number that can be set free: calibrate, write, read back, simulate on the same table, same residuals."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from cli_runs import run_here
from round_trip_cases import CASES, LOAD, NOISE_M, STAGED, Case, Trip, arm, filled, quantity, table, travelled
from shortened import quick_diagnosis

from doe.certainty.uncertainty import ParameterEstimate
from doe.model_file.applied import apply_estimates
from doe.tables.loaded import simulate
from doe.tables.reading import write_measurements
from fem.effects import build_plain, catalogue
from fem.free.kinds import KINDS
from fem.free.parameters import parameter
from robots import ModelDescription, save_description
from robots.robot import robot_from
from stiffarm.commands.calibrate import step as calibrating
from stiffarm.commands.diagnose import step as diagnosing
from stiffarm.commands.diagnose.command import DiagnoseRequest
from stiffarm.commands.diagnose.model import described
from stiffarm.session import inputs

# A model file holds all digits; what is left is sums of some ten numbers of a millimetre in another order.
DIGITS = 1e-14
# Walls are interpolated between condensed ones (fem.elements.walls: 1e-7 of the link's part, 0.1 mm).
INTERPOLATED = 2e-11
# A diagnosis writes springs with nine digits: 1e-9 of some millimetres.
NINE_DIGITS = 2e-11

EVERYDAY = [pytest.param(cases[0], id=kind) for kind, cases in CASES.items()]
OTHERS = [pytest.param(case, id=f"{kind}-{k}") for kind, cases in CASES.items() for k, case in enumerate(cases) if k]
KNOWN = catalogue(build_plain(arm()), arm())
# One place of every family; the second joint where there is a choice.
CODES = {code.partition(":")[0]: code for code in [*reversed(KNOWN), *(c for c in KNOWN if c.endswith(":j2"))]}
EFFECTS = [f"{code}.{p.name}" for code in CODES.values() for p in KNOWN[code].parameters]


def check(trip: Trip) -> None:
    """The file gives the residuals of the calibration and of its fit, and at least one number was moved by it."""
    found = trip.found.found
    tolerance = (
        INTERPOLATED if any(p.kind.has_sections for p in found.stages[0].estimate.problem.parameters) else DIGITS
    )
    assert np.abs(trip.simulated - found.residual).max() <= tolerance
    last = found.stages[-1].estimate
    same = np.isin(last.problem.value, found.overall.value)
    assert same.all()
    if len(last.problem) == len(found.overall):
        assert np.abs(last.residual - found.residual).max() <= tolerance
    moved = [
        e.status != "not identified" and abs(e.parameter.inner(e.value) - e.parameter.inner(e.parameter.value)) > 1e-12
        for stage in found.stages
        for e in stage.certainty.estimates
        if not math.isnan(e.value)
    ]
    assert any(moved)


def test_every_kind_of_number_has_a_case() -> None:
    assert set(CASES) == {kind.name for kind in KINDS}
    plain = build_plain(arm())
    for kind, (case, *_) in CASES.items():
        placed = [
            KNOWN[described.code].placed({p.name: p.upper for p in KNOWN[described.code].parameters})
            for described in case.description.effect
        ]
        assert kind in {p.kind.name for p in case.campaign.free(plain, None, placed)[0]}
    # Every family of effects, and every number of them, is calibrated below.
    assert {name.partition(":")[0].partition(".")[0] for name in EFFECTS} | {"load-path", "angle-sign"} == {
        code.partition(":")[0] for code in KNOWN
    }


@pytest.mark.parametrize("case", EVERYDAY)
def test_the_written_model_gives_the_residuals_of_the_fit(case: Case, tmp_path: Path) -> None:
    check(travelled(case, tmp_path))


@pytest.mark.slow
@pytest.mark.parametrize("case", OTHERS)
def test_so_does_it_in_every_variant(case: Case, tmp_path: Path) -> None:
    check(travelled(case, tmp_path))


@pytest.mark.slow
@pytest.mark.parametrize("name", EFFECTS)
def test_so_does_it_for_every_number_of_an_effect(name: str, tmp_path: Path) -> None:
    trip = travelled(Case((name, "j3.stiffness"), arm((name.rpartition(".")[0],))), tmp_path)
    check(trip)


@pytest.mark.slow
def test_so_does_it_after_stages(tmp_path: Path) -> None:
    check(travelled(STAGED, tmp_path))


@pytest.mark.slow
def test_a_shift_of_the_point_goes_where_readings_have_theirs(tmp_path: Path) -> None:
    for points, tool, own in (("own", False, True), ("tool", True, False), ("mixed", True, True)):
        folder = tmp_path / points
        folder.mkdir()
        trip = travelled(Case(("point.x",), points=points), folder)  # type: ignore[arg-type]
        shift = trip.found.found.stages[0].certainty.estimates[0].value
        assert shift == pytest.approx(0.03, abs=2e-3)
        before = robot_from(arm()).T_flange_tool[:3, 3]
        moved = trip.back.robot.T_flange_tool[:3, 3] - before
        assert moved == pytest.approx([shift if tool else 0.0, 0.0, 0.0], abs=1e-12)
        assert trip.back.model.load_point == pytest.approx([shift if own else 0.0, 0.0, 0.0], abs=1e-12)
        assert any("points of the table" in remark for remark in trip.found.remarks) == own


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["point", "zero", "load"])
def test_poses_left_out_are_predicted_as_a_model_without_them_does(kind: str, tmp_path: Path) -> None:
    case = CASES[kind][0]
    whole = travelled(case, tmp_path)
    out = np.array(whole.data.pose) == "P4"
    given = inputs.read_model(str(tmp_path / "given.toml"), None, None)
    fewer = calibrating.calibrate(given, whole.data.select(~out), whole.found.request)
    save_description(fewer.description, tmp_path / "fewer.toml")
    back = inputs.read_model(str(tmp_path / "fewer.toml"), None, None)
    error = whole.data.displacement - simulate(back.model, whole.data, back.effects)
    p = whole.found.found.overall
    mine = p.pose == p.poses.index("P4")
    expected = error[p.row[mine], p.component[mine]]
    # Each has its own estimate of the noise, and so slightly other weights.
    assert np.abs(whole.found.left_out[mine] - expected).max() < 2e-6


@pytest.mark.slow
@pytest.mark.parametrize(
    ("effects", "load_path", "loads", "truth"),
    [
        ((), None, (), {"backlash:j3": {"gap": 1.2e-3, "crossing": 20.0, "preload": 0.0}}),
        ((), None, (150.0,), {"drift": {"x": 8e-5, "y": 0.0, "z": 1e-4, "settling": 0.3}}),
        (("base-tilt",), "serial", (), {"base-tilt": {"stiffness_x": 4e6, "stiffness_y": 3e6}}),
    ],
    ids=["backlash", "drift on some loads", "another path than the file's"],
)
def test_so_does_the_model_that_a_diagnosis_writes(
    effects: tuple[str, ...],
    load_path: str | None,
    loads: tuple[float, ...],
    truth: dict[str, dict[str, float]],
    tmp_path: Path,
) -> None:
    save_description(arm(effects, load=LOAD), tmp_path / "given.toml")
    given = inputs.read_model(str(tmp_path / "given.toml"), None, load_path)
    plain = build_plain(given.description, load_path=load_path).with_springs({"j2": 1.8e6, "j3": 1.1e6})  # type: ignore[arg-type]
    known = catalogue(plain, given.description)
    data = table(given.robot, poses=8)
    data = filled(data, simulate(plain, data, [known[code].placed(v) for code, v in truth.items()]))
    with quick_diagnosis(*(code.partition(":")[0] for code in truth)):
        found = diagnosing.diagnose(given, data, DiagnoseRequest(loads=loads, next_poses=0, folds=0))
    save_description(described(found), tmp_path / "model.toml")
    back = inputs.read_model(str(tmp_path / "model.toml"), None, load_path)
    error = data.displacement - simulate(back.model, data, back.effects)
    after = found.found.after
    # What it names is not asked here: a law without a name may take up the last digits of noise-free readings.
    assert {e.effect.code for e in after.setting.accepted} >= set(truth)
    error = error[np.isin(data.row_numbers, found.used.row_numbers)]
    p = after.setting.data
    assert np.abs(error[p.row, p.component] - after.residual).max() <= NINE_DIGITS


def test_all_walls_of_a_link_get_thicker_together() -> None:
    data = arm().model_dump(by_alias=True)
    for link in data["link"]:
        link["rim"] = {"length": quantity(60.0, "mm"), "wall": quantity(20.0, "mm")}
    description = ModelDescription.model_validate(data)
    wall = parameter(build_plain(description), "forearm.wall")
    found = ParameterEstimate(wall, 1.25 * wall.value, (wall.value, 1.5 * wall.value), 1.0, "determined", 10.0)
    changed = next(x for x in apply_estimates(description, [found]).link if x.name == "forearm")
    before = next(x for x in description.link if x.name == "forearm")
    for part in ("section", "section_end", "rim"):
        if getattr(before, part) is not None:
            assert getattr(changed, part).wall.si == pytest.approx(1.25 * getattr(before, part).wall.si, rel=1e-12)
    assert changed.rim is not None


@pytest.mark.slow
def test_the_commands_say_the_same_error(tmp_path: Path) -> None:
    trip = travelled(CASES["point"][0], tmp_path)
    csv = tmp_path / "table.csv"
    write_measurements(trip.data, csv, trip.back.robot)
    names = ",".join(CASES["point"][0].names)
    done = run_here(
        "calibrate",
        tmp_path / "given.toml",
        csv,
        "--free",
        names,
        "--scheme",
        "global",
        "--json",
        "--out",
        tmp_path / "out",
    )
    assert done.code == 0, done.err
    simulated = run_here("simulate", tmp_path / "out" / "model.toml", csv, "--json")
    assert simulated.code == 0, simulated.err
    assert simulated.json["rms_mm"] == pytest.approx(done.json["rms_mm"], rel=1e-5)
    assert done.json["rms_mm"] == pytest.approx(1e3 * NOISE_M, rel=0.2)
    assert done.json["left_one_pose_out_rms_mm"] == pytest.approx(1e3 * NOISE_M, rel=0.5)
