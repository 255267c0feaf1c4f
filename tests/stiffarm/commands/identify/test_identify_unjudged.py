"""`identify` answers whatever angles were measured, and says of every figure that it cannot give why."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cli_runs import run_here
from hypothesis import given, settings
from hypothesis import strategies as st

from doe.joint_twists import LawKind, TwistReadings, flange, identify, write_twists
from doe.joint_twists.identify import unjudged
from doe.joint_twists.synthetic import Campaign, draw_poses, draw_truth, make_readings
from fem import build_model
from fem.arm import Arm
from robots import ModelDescription, load_description, save_description
from stiffarm.commands.identify import command
from stiffarm.commands.identify.command import IdentifyRequest, answer
from stiffarm.commands.identify.results import WHY_NULL
from stiffarm.commands.identify.results import _law as law_of

# Degrees; pairs of them are whole turns apart.
ANGLES = (-340.0, -100.0, -50.0, 10.0, 20.0, 70.0, 260.0, 310.0, 370.0)
NEEDED: dict[LawKind, int] = {"constant": 1, "fourier-1": 3, "fourier-2": 5, "table": 2}


@cache
def wide() -> Arm:
    """The TX200 with joints that turn more than once."""
    data = load_description("tx200").model_dump(by_alias=True)
    for joint in data["joint"]:
        joint["limits"] = {**joint["limits"], "value": (-400.0, 400.0), "unit": "deg"}
    description = ModelDescription.model_validate({**data, "coupling": ()})
    model = build_model(description, "rigid")
    return Arm(description, model.robot, model)


def readings(angles_deg: Sequence[float], poses: int = 2, seed: int = 0, **campaign: Any) -> TwistReadings:
    """A noisy campaign of every joint at these angles."""
    rng, model = np.random.default_rng(seed), wide().model
    asked = Campaign(angles=len(angles_deg), poses=poses, **campaign)
    q = draw_poses(model, replace(asked, poses=poses), rng)
    for j in range(model.robot.dof):
        q[j, :, :, j] = np.radians(angles_deg)[:, None]
    return make_readings(model, draw_truth(model, rng), asked, rng, poses=q)


def distinct(angles_deg: Sequence[float]) -> int:
    return len({round(a % 360.0, 6) for a in angles_deg})


def answered(monkeypatch: pytest.MonkeyPatch, data: TwistReadings, **request: Any) -> Any:
    """The JSON of an identification; fewer random poses at the flange, which have no part in what is asked here."""
    monkeypatch.setattr(flange, "POSES", 40)
    monkeypatch.setattr(command, "_simulated", lambda *_: (data, None))
    return answer(wide(), IdentifyRequest(synthetic=True, **request)).as_json


def faults(value: Any, reasons: Mapping[str, str], where: tuple[str, ...] = ()) -> Iterator[str]:
    """Numbers that are not finite, and nulls without a reason: by one of their keys, or by the row's status."""
    if isinstance(value, dict):
        why = (value["status"],) if value.get("status") in reasons else ()
        for key, one in value.items():
            yield from faults(one, reasons, (*where, *why, key))
    elif isinstance(value, list):
        for one in value:
            yield from faults(one, reasons, where)
    elif value is None and not reasons.keys() & set(where):
        yield f"{where}: null without a reason"
    elif isinstance(value, float) and not math.isfinite(value):
        yield f"{where}: {value}"


def all_faults(content: Any) -> list[str]:
    return list(faults(content, content["why_null"]))


@pytest.mark.slow
@given(
    angles=st.lists(st.sampled_from(ANGLES), min_size=1, max_size=8),
    poses=st.sampled_from((1, 2)),
    law=st.sampled_from((None, None, *NEEDED)),
    noisy=st.booleans(),
    one_way=st.sampled_from((False, False, True)),
    seed=st.integers(0, 5),
)
@settings(max_examples=20)
def test_any_angles_are_answered_in_full(
    angles: list[float], poses: int, law: LawKind | None, noisy: bool, one_way: bool, seed: int
) -> None:
    law = law if law is None or distinct(angles) >= NEEDED[law] else None
    more = {} if noisy else {"noise_m": 0.0, "noise_rad": 0.0, "scatter": 0.0}
    data = readings(angles, poses, seed, unloading=not one_way, steps_N=(600.0,) if one_way else (300.0, 600.0), **more)
    with pytest.MonkeyPatch.context() as patched:
        content = answered(patched, data, law=law, branches="loading" if one_way else "mean", seed=seed)
    assert all_faults(content) == []


@pytest.mark.slow
@pytest.mark.parametrize("angles", [(10.0,), (10.0, 70.0), (-100.0, -50.0, 20.0, 70.0), ANGLES])
def test_every_null_has_a_reason_and_no_figure_is_infinite(
    angles: tuple[float, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    content = answered(monkeypatch, readings(angles, poses=1))
    assert all_faults(content) == []
    assert content["cannot_judge"]
    assert all(x["what"] and x["of"] and x["reason"] for x in content["cannot_judge"])


def test_angles_whole_turns_apart_are_one_angle(monkeypatch: pytest.MonkeyPatch) -> None:
    content = answered(monkeypatch, readings((-100.0, -50.0, 260.0, 310.0)))
    assert {round(s["angle_deg"]) for s in content["stiffnesses"] if s["law"]} == {-100, -50}
    # Two angles are no ground for a law, and it is said of every joint.
    assert {s["law"] for s in content["stiffnesses"]} <= {"constant", ""}
    said = [x for x in content["cannot_judge"] if "vary with the angle" in x["what"]]
    assert len(said) == 1
    assert len(said[0]["of"]) == 6


@pytest.mark.slow
def test_a_law_through_as_many_angles_as_numbers_is_not_checked(monkeypatch: pytest.MonkeyPatch) -> None:
    content = answered(monkeypatch, readings((-100.0, 10.0, 70.0)), law="fourier-1")
    said = [x for x in content["cannot_judge"] if "lack of fit" in x["what"]]
    assert len(said) == 1
    assert "3 numbers through 3 angles" in said[0]["reason"]
    spare = answered(monkeypatch, readings((-100.0, -50.0, 10.0, 70.0)), law="fourier-1")
    assert not [x for x in spare["cannot_judge"] if "lack of fit" in x["what"]]


def test_one_reading_a_cycle_gives_numbers_without_intervals(monkeypatch: pytest.MonkeyPatch) -> None:
    data = readings((10.0,), poses=1, unloading=False, steps_N=(600.0,))
    content = answered(monkeypatch, data, branches="loading")
    known = [s for s in content["stiffnesses"] if s["law"]]
    # Forces at the flange's centre leave two stiffnesses unloaded; of the others nothing tells the noise.
    assert {s["status"] for s in known} == {"not judged"}
    assert all(s["stiffness_interval95"] is None for s in known)
    assert "cross_terms" not in content
    told = replace(data, sigma=np.full_like(data.sigma, 3e-6))
    known = [s for s in answered(monkeypatch, told, branches="loading")["stiffnesses"] if s["law"]]
    assert "not judged" not in {s["status"] for s in known}


@pytest.mark.slow
def test_the_command_writes_everything_where_nothing_is_sure(tmp_path: Path) -> None:
    save_description(wide().description, tmp_path / "wide.toml")
    data = readings((10.0, 370.0), poses=1, unloading=False, steps_N=(600.0,))
    write_twists(data, tmp_path / "one.csv", wide().robot)
    table, out = tmp_path / "one.csv", tmp_path / "out"
    done = run_here("identify", tmp_path / "wide.toml", table, "--json", "--out", out, "--branches", "loading")
    assert done.code == 0, done.err
    assert all_faults(done.json) == []
    assert {p.name for p in out.iterdir()} >= {"identify.json", "model.toml", "report.html", "identify.csv"}


def test_a_score_that_cannot_be_reckoned_is_null_with_its_reason() -> None:
    found = identify(wide().model, readings((-100.0, -50.0, 10.0, 70.0)))
    key, one = next((k, d) for k, d in found.directions.items() if d.law is not None)
    lost = replace(one, scores={"constant": 1.0, "fourier-1": math.inf})
    content = law_of(lost)
    assert content["left_out_scores"]["fourier-1"] is None
    assert list(faults(content, WHY_NULL)) == []
    said = unjudged({key: lost}, found.cycles, wide().robot.joint_names, None, found.scatter_dof)
    assert any("fourier-1 predicts angles left out" in x.what for x in said)
