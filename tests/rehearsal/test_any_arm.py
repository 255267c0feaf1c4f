"""Any described arm: this world and the program, two witnesses, agree where nothing is hidden."""

from __future__ import annotations

import ast
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from odd_arms import EVERYTHING, skew

from fem import build_model, deflection
from fem.statics.loads import as_loaded
from rehearsal import Noise, Truth, arm_of, codes, exact, hide, nuisance
from rehearsal.arm import Arm
from rehearsal.design import poses_of, repeated, up_and_down
from rehearsal.readings import Readings
from robots import ModelDescription, load_description
from robots.arrays import Array
from robots.schema.description import Joint
from robots.schema.springs import BearingLaws, LogFourierLaw, LogPolynomialLaw, PlaceStiffness, TableLaw

ROOT = Path(__file__).resolve().parents[2]
# What the world may take of robots.
TAKEN = {"robots.arrays", "robots.errors", "robots.lazily"}


def plain(arm: Arm, links: str = "rigid") -> Truth:
    c = np.array([0.0 if k is None else 1 / k for k in arm.stiffness])
    return Truth(arm, c, links, nuisance.nothing(arm), (), 0)


def readings(arm: Arm, rng: np.random.Generator, n: int = 6) -> Readings:
    low, high = arm.limits.T
    r = repeated(rng.uniform(low, high, (n, arm.dof)), [up_and_down([200.0], np.array([0.3, -0.5, -0.8]))], 1)
    return replace(r, force=r.force + rng.normal(0, 30, r.force.shape))


def simulated(d: ModelDescription, r: Readings, links: str = "rigid") -> Array:
    model = build_model(d, links)  # type: ignore[arg-type]
    point = np.tile(model.robot.T_flange_tool[:3, 3], (len(r), 1))
    if r.point is not None:
        point = np.where(np.isnan(r.point), point, r.point)
    at = as_loaded(model, r.q, r.wrench, point)
    return deflection(model, at.q, at.wrench, at.point)[:, :3]


def with_joint(d: ModelDescription, index: int, **changes: object) -> ModelDescription:
    joint: Joint = d.joint[index].model_copy(update=changes)
    return d.model_copy(update={"joint": (*d.joint[:index], joint, *d.joint[index + 1 :])})


def described() -> ModelDescription:
    """Everything a description may have but links and a parallelogram."""

    def k(value: float, unit: str) -> dict[str, object]:
        return {"value": value, "unit": unit, "source": "assumed"}

    d = skew(more=EVERYTHING)
    entry = {"rows": ("rx", "rz"), "compliance": k(1e-7, "rad/(N m)")}
    bearing = PlaceStiffness.model_validate(
        {"tx": k(1e8, "N/m"), "rx": k(2e6, "N m/rad"), "ry": k(3e6, "N m/rad"), "entry": (entry,)}
    )
    fourier = {"kind": "log-fourier", "coefficients": (14.0, 0.3, -0.2, 0.1, 0.05), "source": "assumed"}
    laws = BearingLaws(rx=LogFourierLaw.model_validate(fourier | {"input": "theta4_deg"}))
    d = with_joint(d, 2, bearing=bearing, bearing_laws=laws)
    d = with_joint(d, 1, stiffness=LogFourierLaw.model_validate(fourier | {"input": "theta2_deg"}))
    table = {"kind": "table", "input": "theta4_deg", "nodes_deg": (-90, 0, 50), "source": "assumed"}
    d = with_joint(d, 3, stiffness=TableLaw.model_validate(table | {"stiffness_Nm_per_rad": (1e5, 3e5, 2e5)}))
    law = {
        "inputs": ("theta1_deg", "theta3_deg"),
        "centre_deg": (0, 10),
        "half_range_deg": (90, 80),
        "source": "assumed",
    }
    law |= {"exponents": ((0, 0), (1, 0), (1, 2)), "coefficients": (13.0, 0.2, -0.3)}
    d = with_joint(d, 4, stiffness=LogPolynomialLaw.model_validate(law))
    return with_joint(d, 0, zero_error=d.joint[1].offset)


@pytest.mark.parametrize("joints", [4, 5, 6, 7])
def test_arms_of_four_to_seven_joints_move_as_simulated(joints: int, rng: np.random.Generator) -> None:
    d = skew(joints=joints)
    arm = arm_of(d)
    r = readings(arm, rng)
    # Round-off of a few hundred operations.
    np.testing.assert_allclose(exact(plain(arm), r), simulated(d, r), rtol=1e-9, atol=1e-15)


def test_all_that_a_description_has_moves_as_simulated(rng: np.random.Generator) -> None:
    d = described()
    arm = arm_of(d)
    r = readings(arm, rng)
    point = np.where(np.arange(len(r))[:, None] < 5, np.nan, rng.normal(0, 0.1, (len(r), 3)))
    r = replace(r, point=point, moment=rng.normal(0, 20, (len(r), 3)))
    np.testing.assert_allclose(exact(plain(arm), r), simulated(d, r), rtol=1e-9, atol=1e-15)


def test_bearings_beside_a_parallelogram_carry_its_bar(rng: np.random.Generator) -> None:
    d = load_description("xr701")
    k = {"unit": "N/m", "source": "assumed"}
    soft = PlaceStiffness.model_validate({"tx": k | {"value": 1e8}, "tz": k | {"value": 2e8}})
    for joint in (1, 2):
        d = with_joint(d, joint, bearing=soft)
    bar = {"bar_stiffness": soft.tx}
    assert d.parallelogram is not None
    d = d.model_copy(update={"parallelogram": d.parallelogram.model_copy(update=bar)})
    arm = arm_of(d)
    r = readings(arm, rng)
    np.testing.assert_allclose(exact(plain(arm), r), simulated(d, r), rtol=1e-9, atol=1e-15)


def test_a_dh_table_without_links_or_springs_gets_springs_of_its_class(rng: np.random.Generator) -> None:
    arm = arm_of(skew(springs=False))
    r = readings(arm, rng)
    low, high = np.full(7, 1e5), np.full(7, 1e6)
    world = hide(arm, "none", r, Noise(0, 0, 0, 0), seed=3, ranges=(low, high))
    springs = 1 / world.truth.compliance
    assert ((springs >= low) & (springs <= high)).all()
    assert np.ptp(springs) > 1e5


@pytest.mark.slow
@pytest.mark.parametrize("name", ["xr701", "kr60-3", "skew", "four"])
def test_every_code_makes_finite_readings(name: str, rng: np.random.Generator) -> None:
    arm = arm_of(skew(joints=4) if name == "four" else skew() if name == "skew" else load_description(name))
    r = repeated(poses_of(arm, 3, rng), [up_and_down([100.0, 200.0], np.array([0.4, -0.3, -0.87]))], 1)
    r = replace(r, point=np.tile([0.1, 0.05, 0.0], (len(r), 1)))  # off the last axis
    ranges = np.full(arm.dof, 1e5), np.full(arm.dof, 1e6)
    for links in ("rigid", "beam"):
        known = codes(arm, links)
        assert len(known) == len(set(known)) > 20
        for code in known if links == "rigid" else [c for c in known if c.startswith("link-")]:
            world = hide(arm, code, r, Noise(0.03, 3e-6, 1e-6, 0), seed=5, links=links, ranges=ranges)
            assert world.truth.effects[0]["code"] == code
            d = world.without_noise(r)
            assert np.isfinite(d).all(), code
            assert np.abs(d).max() < 0.1, code
            bare = hide(arm, "none", r, world.noise, seed=5, links=links, ranges=ranges)
            assert (d != bare.without_noise(r)).any(), code


def test_a_turned_frame_turns_what_is_stated_and_a_wrong_tool_point_moves_it() -> None:
    arm = arm_of(load_description("kr60-3"))
    r = repeated(np.radians([[0, -60, 60, 0, 40, 0]]), [up_and_down([300.0], np.array([0, 0, -1.0]))], 1)
    base = plain(arm)
    quarter = replace(
        base,
        effects=(
            {"code": "turned-frame", "kind": "turned-frame", "where": "", "law": "", "turn_rad": [0, 0, np.pi / 2]},
        ),
    )
    # A vertical load stays vertical; what was x is stated as minus y of a frame turned by a quarter about z.
    d, turned = exact(base, r), exact(quarter, r)
    np.testing.assert_allclose(turned, np.column_stack([d[:, 1], -d[:, 0], d[:, 2]]), atol=1e-15)
    at = np.array([0.05, -0.02, 0.1])
    wrong = replace(
        base, effects=({"code": "tool-point-offset", "kind": "tool-point-offset", "where": "", "at_flange_m": at},)
    )
    np.testing.assert_allclose(exact(wrong, r), exact(base, replace(r, point=np.tile(at, (2, 1)))), atol=1e-15)
    for kind, where, values, stated in (
        ("angle-sign", "j2", {}, [0, 60, 60, 0, 40, 0]),
        ("angle-offset", "j2", {"offset_rad": np.pi / 2}, [0, -150, 60, 0, 40, 0]),
        ("angle-coupling", "j3", {"share": 1.0}, [0, -60, 120, 0, 40, 0]),
    ):
        hidden = replace(base, effects=({"code": f"{kind}:{where}", "kind": kind, "where": where, **values},))
        at_stated = r.moved(np.tile(np.radians(stated), (2, 1)))
        np.testing.assert_allclose(exact(hidden, at_stated), d, atol=1e-15)


def test_no_code_is_shared_with_the_packages_under_test() -> None:
    theirs = {"meshes", "fem", "doe", "surrogate", "machining", "stiffarm"}
    for path in (ROOT / "rehearsal").glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            if isinstance(node, ast.ImportFrom):
                assert node.level == 0, path.name
                names = [str(node.module)]
            for name in names:
                assert name.split(".")[0] not in theirs, path.name
                if name.split(".")[0] == "robots":
                    assert name in TAKEN or name.startswith("robots.schema."), f"{path.name}: {name}"
