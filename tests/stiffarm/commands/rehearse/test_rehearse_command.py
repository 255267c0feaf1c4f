"""`rehearse`: what is hidden is found or not, told as it is; sheets of any kind; secrets kept; bad input refused."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest
from cli_runs import Command, run_here
from shortened import blank_pictures, quick_diagnosis
from small_robot import write_readings, write_urdf

import stiffarm as sa
from doe import read_measurements
from robots import load_robot
from stiffarm.commands.rehearse import step as rehearsing
from stiffarm.commands.rehearse.command import RehearseRequest
from stiffarm.commands.rehearse.sheet import of_sheet

pytestmark = pytest.mark.usefixtures("blank", "quick_diagnoses")

QUICK = ("kr60-3", "--links", "rigid", "--poses", "9")


@pytest.fixture(scope="module")
def hidden_payload(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("rehearsal") / "out"
    with blank_pictures(), quick_diagnosis():
        assert run_here("rehearse", *QUICK, "--hide", "payload", "--out", out).code == 0
    return out


@pytest.fixture
def urdf(tmp_path: Path) -> Path:
    return write_urdf(tmp_path / "small.urdf")


def rewritten(source: Path, target: Path, change: object) -> Path:
    """A CSV with its rows (as dictionaries) changed in place by ``change``."""
    with source.open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    change(rows)  # type: ignore[operator]
    with target.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)
    return target


def test_a_hidden_payload_is_named_and_the_gap_shrinks(hidden_payload: Path) -> None:
    result = json.loads((hidden_payload / "rehearse.json").read_text(encoding="utf-8"))
    (draw,) = result["draws"]
    assert (draw["hidden"], draw["outcome"], draw["visible"]) == ("payload", "named", True)
    assert draw["after_mm"] < 0.7 * draw["before_mm"]
    (force,) = result["parameters"]
    assert force["found"] == pytest.approx(force["true"], rel=0.3)
    truth = json.loads((hidden_payload / "truth.json").read_text(encoding="utf-8"))
    assert truth["effects"][0]["weight_N"] == pytest.approx(force["true"], rel=1e-5)
    page = (hidden_payload / "report.html").read_text(encoding="utf-8")
    assert "Hidden was payload; the diagnosis named payload: named right." in page


@pytest.mark.slow
def test_the_diagnosis_saw_what_readings_csv_holds(hidden_payload: Path) -> None:
    """The same verdict by `diagnose` on the file alone."""
    table = hidden_payload / "readings.csv"
    outcome = run_here("diagnose", "kr60-3", table, "--links", "rigid", "--next", "0", "--json")
    assert [e["code"] for e in outcome.json["effects"]] == ["payload"]
    text = table.read_text(encoding="utf-8")
    assert "payload" not in text
    assert text.startswith("pose,q1_deg")


def test_a_secret_is_kept_until_the_end(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing that is said or written before the diagnosis has ended names the hidden code."""
    told: list[str] = []
    diagnose = rehearsing.diagnosing.diagnose

    def watched(*given: object, **more: object) -> object:
        names = "\n".join(str(p) for p in tmp_path.rglob("*"))
        files = "\n".join(p.read_text(encoding="utf-8") for p in tmp_path.rglob("*") if p.is_file())
        told.append(names + files)
        return diagnose(*given, **more)  # type: ignore[arg-type]

    monkeypatch.setattr(rehearsing.diagnosing, "diagnose", watched)
    outcome = run_here("rehearse", *QUICK, "--hide", "any", "--seed", "2", "--out", tmp_path / "out", "--json")
    hidden = outcome.json["draws"][0]["hidden"]
    assert outcome.json["secret"]
    assert hidden != "none"
    assert told
    assert hidden.partition(":")[0] not in told[0]


def test_the_same_seed_hides_the_same(tmp_path: Path) -> None:
    arm = sa.load("kr60-3", links="rigid")
    world = rehearsing.prepared(arm)
    for seed in (0, 1):
        request = RehearseRequest(hide="any", seed=seed, poses=4)
        first, again = (
            rehearsing.made(arm, world, rehearsing.set_ups_of(arm, world, request, 0), request, 0) for _ in "ab"
        )
        assert first.code == again.code
        np.testing.assert_array_equal(first.measured(), again.measured())
        other = rehearsing.made(arm, world, rehearsing.set_ups_of(arm, world, request, 1), request, 1)
        assert not np.array_equal(other.measured(), first.measured())


def test_secret_codes_are_spread_over_all_kinds() -> None:
    arm = sa.load("xr701")
    world = rehearsing.prepared(arm)
    set_ups = rehearsing.set_ups_of(arm, world, RehearseRequest(poses=3))
    request = RehearseRequest(hide="any")
    kinds = {rehearsing.made(arm, world, set_ups, request, k).code.partition(":")[0] for k in range(40)}
    every = {code.partition(":")[0] for code in rehearsing.possible(arm, world)}
    # Of 22 kinds 40 even draws show 18.6 on average, with a standard deviation of 1.4.
    assert len(every) > 20
    assert kinds <= every
    assert len(kinds) > 13


@pytest.mark.slow
def test_several_draws_are_tallied(tmp_path: Path) -> None:
    outcome = run_here("rehearse", *QUICK, "--hide", "none", "--draws", "2", "--out", tmp_path / "out")
    assert outcome.code == 0
    result = json.loads((tmp_path / "out" / "rehearse.json").read_text(encoding="utf-8"))
    assert result["right_family"]["of"] == 2
    assert [draw["hidden"] for draw in result["draws"]] == ["none", "none"]
    assert {p.name for p in (tmp_path / "out").iterdir()} >= {"draw_1", "draw_2", "report.html"}
    first, second = ((tmp_path / "out" / f"draw_{k}" / "readings.csv").read_bytes() for k in (1, 2))
    assert first != second


def test_a_urdf_without_springs_and_links_is_rehearsed_on_its_own_sheet(urdf: Path, tmp_path: Path) -> None:
    table = write_readings(urdf, tmp_path / "readings.csv", poses=4)
    found = sa.rehearse(sa.load(urdf), table, hide="base-vertical", seed=1)
    (one,) = found.draws
    assert one.world.readings.q.shape == (32, 4)
    assert "by the scatter of the repeats" in one.set_ups.words
    # 2 um in each axis: 16 x 3 pairs give the standard deviation to 10 %; the shape of share and floor takes the rest.
    scatter = one.world.noise
    typical = np.hypot(float(np.max(scatter.floor_m)), scatter.share * 1e-4)
    assert 1e-6 < typical < 4e-6
    assert found.gaps_mm[0] is not None
    assert "base-vertical" in found.answer
    assert len(found.to_frame()) == 1
    assert found.plot(file=tmp_path / "gap.png").png[:4] == b"\x89PNG"


def test_an_empty_sheet_gives_poses_loads_and_axes(urdf: Path, tmp_path: Path) -> None:
    full = write_readings(urdf, tmp_path / "full.csv", poses=3)

    def emptied(rows: list[dict[str, str]]) -> None:
        for row in rows:
            row.pop("dy_mm")
            row.update(dx_mm="", dz_mm="")

    sheet = rewritten(full, tmp_path / "empty.csv", emptied)
    given = sa.load(urdf)
    set_ups = of_sheet(given, sheet, RehearseRequest())
    assert set_ups.table.n == 24
    assert set_ups.read.tolist() == [[True, False, True]] * 24
    assert "assumed" in set_ups.words
    d = np.arange(72.0).reshape(24, 3)
    filled = set_ups.filled(np.where(set_ups.read, d, np.nan))
    np.testing.assert_array_equal(filled.displacement[set_ups.row, 0], d[:, 0])
    assert np.isnan(filled.displacement[:, 1]).all()


def test_the_order_of_steps_is_the_order_of_time(urdf: Path, tmp_path: Path) -> None:
    full = write_readings(urdf, tmp_path / "full.csv", poses=3)

    def numbered(rows: list[dict[str, str]]) -> None:
        for k, row in enumerate(rows):
            row.update(step=str(len(rows) - k), sigma_mm="0.01", phase="loading")

    set_ups = of_sheet(sa.load(urdf), rewritten(full, tmp_path / "steps.csv", numbered), RehearseRequest())
    assert set_ups.row.tolist() == list(range(23, -1, -1))
    assert "sigma_mm" in set_ups.words
    np.testing.assert_allclose(set_ups.noise.floor_m, 1e-5)


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (("kr60-3", "--hide", "paylod"), "Did you mean payload?"),
        (("kr60-3", "--hide", "load-path"), "--hide"),
        (("kr60-3", "--hide", "friction:j9"), "--hide"),
        (("kr60-3", "--hide", "link-flexibility:forearm", "--links", "rigid"), "--hide"),
        (("kr60-3", "--reads", "q"), "--reads"),
        (("kr60-3", "--reads", "zz"), "--reads"),
        (("kr60-3", "--links", "shell"), "--links"),
        (("kr60-3", "missing.csv"), "missing.csv"),
        (("kr60-3", "--draws", "0"), "--draws"),
        (("kr60-3", "--draws", "x"), "--draws"),
        (("kr60-3", "--poses", "1"), "--poses"),
        (("kr60-3", "--noise-percent", "-1"), "--noise-percent"),
        (("kr60-3", "--noise-um", "-1"), "--noise-um"),
        (("kr60-3", "--noise-um", "nan"), "--noise-um"),
        (("kr60-3", "--noise-percent", "nan"), "--noise-percent"),
        (("kr60-3", "--setup-percent", "nan"), "--setup-percent"),
        (("kr60-3", "--setup-percent", "60"), "--setup-percent"),
        (("kr60-3", "--seed", "-1"), "--seed"),
        (("kr60-4",), "kr60-3"),
    ],
)
def test_bad_input_is_one_clear_message(cli: Command, arguments: tuple[str, ...], told: str) -> None:
    outcome = cli("rehearse", *arguments)
    assert outcome.code == 2
    assert told in outcome.err
    assert "Traceback" not in outcome.err


def test_a_sheet_and_a_campaign_exclude_each_other(cli: Command, urdf: Path, tmp_path: Path) -> None:
    sheet = write_readings(urdf, tmp_path / "full.csv", poses=3)
    for option in (("--poses", "5"), ("--reads", "z")):
        outcome = cli("rehearse", urdf, sheet, *option)
        assert outcome.code == 2
        assert option[0] in outcome.err


def test_a_sheet_of_rotations_alone_is_refused(cli: Command, urdf: Path, tmp_path: Path) -> None:
    full = write_readings(urdf, tmp_path / "full.csv", poses=3)

    def turned(rows: list[dict[str, str]]) -> None:
        for row in rows:
            row["rx_mrad"] = row.pop("dx_mm")
            row.pop("dy_mm"), row.pop("dz_mm")

    outcome = cli("rehearse", urdf, rewritten(full, tmp_path / "turned.csv", turned))
    assert outcome.code == 2
    assert "rotations" in outcome.err


def test_a_model_that_has_effects_is_refused(cli: Command, tmp_path: Path) -> None:
    from robots.library.models import load_description, save_description
    from robots.schema.effects import EffectTable

    d = load_description("kr60-3")
    table = EffectTable.model_validate(
        {"code": "payload", "parameters": {"force": {"value": 20, "unit": "N", "source": "assumed"}}}
    )
    save_description(d.model_copy(update={"effect": (table,)}), tmp_path / "model.toml")
    outcome = cli("rehearse", tmp_path / "model.toml")
    assert outcome.code == 2
    assert "payload" in outcome.err


def test_the_readings_of_the_bundled_table_are_its_set_ups() -> None:
    arm = sa.load("xr701")
    world = rehearsing.prepared(arm)
    set_ups = rehearsing.set_ups_of(arm, world, RehearseRequest())
    table = read_measurements(sa.bundled("xr701"), load_robot("xr701"))
    np.testing.assert_allclose(set_ups.table.wrench, table.wrench)
    assert set_ups.read[:, 2].all()
    assert not set_ups.read[:, :2].any()
