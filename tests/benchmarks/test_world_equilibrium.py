"""The foreign world that stands on MuJoCo: same seed same bytes, same mechanics as ours where nothing is hidden."""

from __future__ import annotations

import importlib
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks.worlds.shared import description, model_text


def part(name: str) -> Any:
    pytest.importorskip("mujoco", reason="the world stands on MuJoCo: the extra `worlds`")
    return importlib.import_module(f"benchmarks.worlds.equilibrium.{name}")


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("equilibrium")
    part("sets").make(out, 5, single=2, none=1, outside=1, pairs=1)
    return out


@pytest.mark.parametrize("name", ["kr60-3", "tx200", "xr701", "heron7", "mantis5"])
def test_springs_alone_are_those_of_fem(name: str, tmp_path: Path) -> None:
    """Under a tenth of a newton, as a large load changes the pose that it acts on."""
    arms, effect, truth = part("arm"), part("effects"), part("campaign")
    from fem import build_model, deflection
    from robots import load_description

    arm = arms.load(name)
    springs = dict(zip(arm.names, np.array(arms.SPRINGS[name]) * 1.3, strict=True))
    (tmp_path / "model.toml").write_text(model_text(description(name), springs), encoding="utf-8")
    poses = part("campaign").draw_poses(np.random.default_rng(3), arm, 12, False)
    force, point = np.array([0.03, -0.05, -0.08]), np.array([0.05, -0.02, 0.11])
    rows = [effect.Row(f"P{i}", 1, "loading", q, force, point) for i, q in enumerate(poses)]
    site = effect.Site(arm, springs, {}, {}, True, 1.0)
    found = truth.Truth(site, gravity=False).readings(rows)
    model = build_model(load_description(tmp_path / "model.toml"), links="rigid")
    bare = deflection(model, poses, np.array([*force, 0, 0, 0]), point)[:, :3]
    assert np.max(np.abs(found - bare)) < 1e-6 * np.max(np.abs(bare))


def test_springs_alone_leave_next_to_nothing_over() -> None:
    hidden, sets = part("sets"), part("sets")
    wish = sets.wishes(np.random.default_rng(2), "none", 1)[0]
    bare = hidden.draw(wish, 4)
    rows = [replace(row, force=row.force * 1e-3) for row in bare.rows]
    feather = replace(bare, rows=rows, nuisance=replace(bare.nuisance, compensated=1.0))
    noise = replace(bare.noise, kind="white", axes=(1e-8, 1e-8, 1e-8))
    assert replace(feather, noise=noise).excess([]) < 0.05
    assert bare.excess([], bare.nuisance) < hidden.DETECTABLE


def test_it_deflects_at_the_deflected_pose() -> None:
    """Ten times the load is not ten times the deflection, and the equilibrium is one: forces balance there."""
    chain, arms = part("arm"), part("arm")
    arm = arms.load("kr60-3")
    c = 1 / np.array(arms.SPRINGS["kr60-3"])
    one = chain.Chain(arm)
    angles, lever = arm.real(np.radians([10, -60, 50, 20, 30, 0])), np.array([0.05, 0, 0.2])
    ends = []
    for force in (30.0, 300.0):
        load = np.array([0, 0, -force])
        deflection, _ = one.settle(angles, load, lever, lambda torque: c * torque, np.zeros(6))
        one.pose(angles, deflection)
        assert np.allclose(deflection / c, one.torque(load, lever), rtol=1e-9, atol=1e-6)
        ends.append(one.point(lever))
    one.pose(angles, one.settle(angles, np.zeros(3), lever, lambda torque: c * torque, np.zeros(6))[0])
    small, large = (np.linalg.norm(end - one.point(lever)) for end in ends)
    assert 1e-4 < abs(large / small / 10 - 1) < 0.05


@pytest.mark.slow
def test_every_family_can_be_hidden_and_read_from_its_key() -> None:
    catalogue, hidden, sets = part("catalogue"), part("sets"), part("sets")
    assert len(catalogue.CATALOGUE) == 28
    assert len(catalogue.OUTSIDE) >= 8
    wish = replace(sets.wishes(np.random.default_rng(2), "single", 1)[0], poses=9, xyz=True)
    for number, family in enumerate(catalogue.EVERY):
        found = hidden.draw(replace(wish, families=(family,)), number)
        told = json.loads(json.dumps(hidden.key(found, "equilibrium")))
        again = replace(hidden.hidden_of(told), rows=found.rows)
        assert np.array_equal(again.truth().readings(found.rows), found.truth().readings(found.rows)), family


def test_friction_goes_round_a_loop_and_creep_recovers() -> None:
    laws = part("arm")
    moment = laws.Moment()
    rub = laws.Dahl(0, 1e-6, 100.0, 5e6)
    rub.rest(0.0, moment)
    way = []
    for torque in (0, 500, 1000, 500, 0):
        way.append(1e-6 * torque + rub.more(torque, moment))
        rub.keep(torque, moment)
    assert way[1] < 500e-6 < way[3]
    assert way[4] > 0
    assert 1000e-6 - 100e-6 <= way[2] < 1000e-6
    creep = laws.Creep(0, 1e-6, (0.1, 0.2), (100.0, 1000.0))
    creep.rest(0.0, moment)
    creep.keep(1000.0, replace(moment, time_s=1e5))
    assert creep.more(1000.0, replace(moment, time_s=1e5)) == pytest.approx(0.3e-3)
    assert creep.more(0.0, replace(moment, time_s=2e5)) == pytest.approx(0.0, abs=1e-12)
