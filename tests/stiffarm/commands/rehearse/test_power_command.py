"""`rehearse` without --hide: what a sheet would show, what one more adds, and bad input."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from cli_runs import run_here
from shortened import blank_pictures, quick_diagnosis
from small_robot import write_readings, write_urdf

import stiffarm as sa
from rehearsal.readings import in_cycles
from stiffarm.commands.rehearse.command import RehearseRequest
from stiffarm.commands.rehearse.power.figures import chances_figure
from stiffarm.commands.rehearse.power.more import one_more
from stiffarm.commands.rehearse.sheet import SetUps
from stiffarm.commands.rehearse.step import prepared, set_ups_of

FAMILIES = ("backlash", "gauge-scale", "joint-tilt", "payload")


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A power analysis of a small arm's sheet."""
    folder = tmp_path_factory.mktemp("power")
    urdf = write_urdf(folder / "small.urdf")
    sheet = write_readings(urdf, folder / "sheet.csv", poses=4)
    with blank_pictures(), quick_diagnosis(*FAMILIES):
        outcome = run_here("rehearse", urdf, sheet, "--draws", "3", "--out", folder / "out")
    assert outcome.code == 0, outcome.err
    return folder


@pytest.mark.slow
def test_every_effect_has_its_chances_or_the_reason_why_not(made: Path) -> None:
    result = json.loads((made / "out" / "rehearse.json").read_text(encoding="utf-8"))
    assert (result["schema"], result["kind"]) == ("stiffarm-rehearse/2", "power")
    assert (result["readings"], result["poses"]) == (32, 4)
    effects = {e["effect"]: e for e in result["effects"]}
    assert {code.partition(":")[0] for code in effects} == set(FAMILIES)
    for e in effects.values():
        if e["why_not"] is not None:
            assert e["found_percent"] is None
            continue
        for chance in ("found", "named"):
            low, high = e[f"{chance}_interval95_percent"]
            assert 0.0 <= low <= e[f"{chance}_percent"] <= high <= 100.0
        assert e["named_percent"] <= e["found_percent"]
    # A scale is all springs at once.
    assert effects["payload"]["found_percent"] > 30.0
    assert 0.0 < effects["payload"]["smallest"] < effects["payload"]["usual"][1]
    assert effects["gauge-scale"]["found_percent"] < 20.0
    assert [(one["with"], one["readings"]) for one in result["one_more"] if one["with"] == "repeat"] == [("repeat", 48)]
    assert len(result["one_more"]) == 3
    assert all(s["stiffness_interval95_Nm_per_rad"][0] < s["stiffness_Nm_per_rad"] for s in result["springs"])
    files = {"rehearse.csv", "springs.csv", "one_more.csv", "chances.png", "one_more.png"}
    assert {p.name for p in (made / "out").iterdir()} == files | {"rehearse.json", "report.html", "run.json"}


@pytest.mark.slow
def test_better_gauges_find_more() -> None:
    arm = sa.load("kr60-3", links="rigid")
    with quick_diagnosis("payload", "joint-tilt"):
        good, poor = (
            sa.rehearse(arm, poses=4, draws=3, one_more=False, noise_percent=percent, noise_um=um, effects=["payload"])
            for percent, um in ((1.0, 1.0), (10.0, 30.0))
        )
    assert good["found"][0] > poor["found"][0]
    assert good["smallest"][0] < 0.5 * np.nan_to_num(poor["smallest"], nan=np.inf)[0]
    assert list(good.to_frame()["effect"]) == ["payload"]
    assert "payload" in chances_figure(good.found).axes[0].get_yticklabels()[0].get_text()
    with pytest.raises(sa.InputError, match="payload"):
        sa.rehearse(arm, poses=4, draws=1, one_more=False, effects=["paylod"])


def campaign(poses: int = 3) -> tuple[object, SetUps]:
    arm = sa.load("kr60-3", links="rigid")
    world = prepared(arm)
    return world, set_ups_of(arm, world, RehearseRequest(poses=poses, reads="xz"))


def test_one_more_is_taken_where_it_belongs() -> None:
    world, given = campaign()
    more = one_more(world, given, 0)  # type: ignore[arg-type]
    n = given.table.n
    assert {what: s.table.n - n for what, s in more.items()} == {
        "one more repeat": n // 3,
        "one more load": n // 3,
        "one more set-up": n // 3,
    }
    for s in more.values():
        r = s.readings
        # Loads go up and down within each cycle, and a pose is set up once.
        assert len(np.unique(r.setup)) == len({tuple(q) for q in r.q.round(9).tolist()})
        size = np.linalg.norm(r.force, axis=1)
        for cycle in np.unique(r.cycle):
            mine = r.cycle == cycle
            up, down = size[mine & ~r.unloading], size[mine & r.unloading]
            assert (np.diff(up) > 0.0).all()
            assert (np.diff(down) < 0.0).all()
        assert s.read.shape == (s.table.n, 3)
        assert (s.read == [True, False, True]).all()
    added = {tuple(q) for q in more["one more set-up"].table.q.round(9).tolist()}
    assert len(added) == 4


def test_the_order_of_time_is_kept() -> None:
    _, given = campaign()
    before = in_cycles(given.readings.q, given.readings.force, given.readings.unloading, given.readings.repeat, 0.0)
    np.testing.assert_array_equal(before[1], given.readings.cycle)


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (("kr60-3", "missing.csv"), "missing.csv"),
        (("kr60-3", "--draws", "0"), "--draws"),
        (("kr60-3", "--poses", "9", "--reads", "q"), "--reads"),
        (("kr60-3", "--noise-um", "-1"), "--noise-um"),
        (("SMALL", "ONE"), "poses"),
        (("SMALL", "EMPTY"), "no readings"),
    ],
)
def test_bad_input_is_one_message(arguments: tuple[str, ...], told: str, tmp_path: Path) -> None:
    urdf = write_urdf(tmp_path / "small.urdf")
    one = write_readings(urdf, tmp_path / "one.csv", poses=1)
    empty = tmp_path / "empty.csv"
    empty.write_text(one.read_text(encoding="utf-8").splitlines()[0] + "\n", encoding="utf-8")
    named = {"SMALL": urdf, "ONE": one, "EMPTY": empty}
    outcome = run_here("rehearse", *(named.get(word, word) for word in arguments), "--out", tmp_path / "out")
    assert outcome.code == 2, outcome.err
    assert told in outcome.err
    assert "Traceback" not in outcome.err
    assert not (tmp_path / "out").exists()
