"""The fast path against the direct stiffness assembly of the same parts, and that the comparison can fail."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from refusals import refuses

import fem.elements.beam
import fem.statics.transfers
from fem import ArmModel, build_model, compliance, deflection
from fem.effects.base import PlacedEffect
from fem.effects.catalogue import catalogue
from fem.effects.observed import act
from fem.model import LinkKind
from fem.reference import direct
from fem.reference.direct import CHUNK
from meshes import SectionProperties, section_properties
from robots import LoadPath, load_description
from robots.arrays import Array
from robots.schema.description import LogPolynomialLaw

Random = np.random.Generator
Draw = Callable[..., Array]
Soften = Callable[..., ArmModel]
Furnish = Callable[..., ArmModel]

# Arms to compare: every bundled robot, the xr701 by both load paths.
ARMS: list[tuple[str, LoadPath]] = [
    ("xr701", "parallelogram"),
    ("xr701", "serial"),
    ("kr60-3", "serial"),
    ("tx200", "serial"),
]

EPS = np.finfo(np.float64).eps

# Rigid links: joint springs alone, both paths are a few dozen products (measured 3e-15).
RIGID = 1e-13
# Beams: the direct solve loses eps times the condition number of its diagonally scaled matrix (asserted
# below): the carousel is that much stiffer than the arm is soft. Measured 9e-10 over eight draws of springs
# as soft as 2e4 N m/rad; 1e-11 with springs near 1e6.
CONDITION = 1e7
BEAMS = EPS * CONDITION
# All beam elements in one solve: short elements are stiffer still (measured 7e-10).
WHOLE = 10.0 * BEAMS


def _difference(a: Array, b: Array) -> float:
    """Largest difference of two compliances relative to sqrt(C_ii C_jj), which bounds C_ij."""
    size = np.sqrt(np.einsum("nii->ni", b))
    return float((np.abs(a - b) / (size[:, :, None] * size[:, None, :])).max())


def _arm(robot: str, path: LoadPath, links: LinkKind, soften: Soften, rng: Random, *, other: bool) -> ArmModel:
    return soften(build_model(load_description(robot), links=links, load_path=path), rng, other=other)


@pytest.mark.parametrize("other", [False, True], ids=["axial", "six-way"])
@pytest.mark.parametrize(("links", "tolerance"), [("rigid", RIGID), ("beam", BEAMS)])
@pytest.mark.parametrize(("robot", "path"), ARMS)
def test_two_hundred_random_poses(
    robot: str,
    path: LoadPath,
    links: LinkKind,
    tolerance: float,
    other: bool,
    soften: Soften,
    reachable: Draw,
    rng: Random,
) -> None:
    model = _arm(robot, path, links, soften, rng, other=other)
    q, points = reachable(model.robot, 200, rng), 0.3 * rng.normal(size=(200, 3))
    fast, slow = compliance(model, q, points), direct.compliance(model, q, points)
    # Joints alone let the tool move in six directions, some of them only just: no entry is zero or NaN.
    assert (np.einsum("nii->ni", slow) > 0).all()
    assert _difference(fast, slow) < tolerance
    w = rng.normal(size=(200, 6)) * [500, 500, 500, 100, 100, 100]
    d = direct.deflection(model, q, w, points)
    bound = np.sqrt(np.einsum("nii->ni", slow)) * np.sqrt(np.einsum("ni,nij,nj->n", w, slow, w))[:, None]
    assert (np.abs(deflection(model, q, w, points) - d) / bound).max() < tolerance


@pytest.mark.parametrize(("robot", "path"), ARMS)
def test_condition_number_behind_the_tolerance(
    robot: str, path: LoadPath, soften: Soften, reachable: Draw, rng: Random
) -> None:
    model = _arm(robot, path, "beam", soften, rng, other=True)
    K, _ = direct.assemble(model, reachable(model.robot, 20, rng))
    scale = np.sqrt(np.abs(np.einsum("nii->ni", K)))
    scaled = K / (scale[:, :, None] * scale[:, None, :])
    assert np.linalg.cond(scaled).max() < CONDITION


@pytest.mark.parametrize(("robot", "path"), ARMS)
def test_every_beam_element_in_one_solve(
    robot: str, path: LoadPath, soften: Soften, reachable: Draw, rng: Random
) -> None:
    model = _arm(robot, path, "beam", soften, rng, other=True)
    q = reachable(model.robot, 2, rng)
    whole = direct.compliance(model, q, condensed=False)
    assert _difference(compliance(model, q), whole) < WHOLE


@pytest.mark.parametrize(("links", "tolerance"), [("rigid", RIGID), ("beam", BEAMS)])
@pytest.mark.parametrize(("robot", "path"), ARMS)
def test_all_that_can_give_way(
    robot: str,
    path: LoadPath,
    links: LinkKind,
    tolerance: float,
    soften: Soften,
    furnish: Furnish,
    reachable: Draw,
    rng: Random,
) -> None:
    """Housings, laws about the axes and across them, coupled bearings, base and tool, all at once."""
    model = furnish(_arm(robot, path, links, soften, rng, other=True), rng)
    q, points = reachable(model.robot, 40, rng), 0.3 * rng.normal(size=(40, 3))
    slow = direct.compliance(model, q, points)
    assert _difference(compliance(model, q, points), slow) < tolerance
    for part in ("housing", "laws"):
        joints = tuple(replace(j, **{part: getattr(model.with_rigid_joints().joints[0], part)}) for j in model.joints)
        assert _difference(compliance(replace(model, joints=joints), q, points), slow) > 1e-3  # each of them counts


@pytest.mark.parametrize(("robot", "path"), ARMS)
def test_every_effect_on_the_arms_structure(robot: str, path: LoadPath, reachable: Draw, rng: Random) -> None:
    description = load_description(robot)
    model = build_model(description, load_path=path)
    model = model.with_springs(dict.fromkeys(model.robot.joint_names, 1e6))
    q, w = reachable(model.robot, 5, rng), rng.normal(size=6) * [500, 500, 500, 100, 100, 100]
    plain, tried = deflection(model, q, w), 0
    for effect in catalogue(model, description).values():
        if effect.stage != "model":
            continue
        values = np.array([p.grid[0] if p.role == "shape" else p.size[1] for p in effect.parameters])
        changed = act(PlacedEffect(effect, values), model, None)
        d = deflection(changed, q, w)
        bound = BEAMS * np.abs(d).max()
        np.testing.assert_allclose(direct.deflection(changed, q, w), d, rtol=0, atol=bound, err_msg=effect.code)
        assert np.abs(d - plain).max() > 10.0 * bound, effect.code
        tried += 1
    assert tried >= 3 * model.robot.dof


def test_springs_that_depend_on_the_angle(reachable: Draw, rng: Random) -> None:
    law = LogPolynomialLaw(
        inputs=("q2_deg",),
        centre_deg=(5.0,),
        half_range_deg=(40.0,),
        exponents=((0,), (1,), (2,)),
        coefficients=(14.0, 0.4, -0.3),
        source="assumed",
    )
    description = load_description("xr701")
    joints = tuple(
        joint.model_copy(update={"stiffness": law}) if joint.name == "j2" else joint for joint in description.joint
    )
    model = build_model(description.model_copy(update={"joint": joints}), links="rigid")
    model = model.with_springs({"j3": 8e5, "j5": 1e6})
    q = reachable(model.robot, 50, rng)
    w = np.array([0, 0, -650.0, 0, 0, 0])
    d = deflection(model, q, w)
    scale = np.abs(d).max()
    np.testing.assert_allclose(d, direct.deflection(model, q, w), rtol=0, atol=RIGID * scale)
    # The law by hand: joint 2's share is known, the rest comes from a model in which it is rigid.
    u = (np.degrees(q[:, 1]) - 5.0) / 40.0
    k2 = np.exp(14.0 + 0.4 * u - 0.3 * u**2)
    share = d[:, 2] - deflection(model.with_springs({"j2": np.inf}), q, w)[:, 2]
    np.testing.assert_allclose(share, -650.0 * (1.10 * np.sin(q[:, 1])) ** 2 / k2, rtol=0, atol=RIGID * scale)


def test_direct_batches_join_without_a_seam(soften: Soften, reachable: Draw, rng: Random) -> None:
    model = _arm("xr701", "parallelogram", "beam", soften, rng, other=False)
    n = CHUNK + 2
    q, w, points = reachable(model.robot, n, rng), rng.normal(size=(n, 6)), 0.2 * rng.normal(size=(n, 3))
    d, C = direct.deflection(model, q, w, points), direct.compliance(model, q, points)
    last = slice(n - 4, n)
    # One LAPACK solve a pose: the neighbours do not matter, but products around it may round differently.
    close = BEAMS * np.abs(d).max()
    np.testing.assert_allclose(d[last], direct.deflection(model, q[last], w[last], points[last]), rtol=0, atol=close)
    assert _difference(direct.compliance(model, q[last], points[last]), C[last]) < BEAMS


def test_a_rigid_arm_does_not_move_in_either() -> None:
    for robot, path in ARMS:
        model = build_model(load_description(robot), links="rigid", load_path=path).with_rigid_joints()
        q = np.full((3, 6), 0.9)
        np.testing.assert_array_equal(direct.compliance(model, q), compliance(model, q))
        np.testing.assert_array_equal(compliance(model, q), 0.0)


def test_direct_checks_its_input_too() -> None:
    model = build_model(load_description("kr60-3"))
    refuses("A006", "wrench array", direct.deflection, model, np.zeros((2, 6)), np.zeros(5))
    refuses("A006", "tool point array", direct.compliance, model, np.zeros((2, 6)), np.zeros((3, 3)))


# --- The comparison is worth something only if it fails when the physics is wrong. ---


def test_a_bar_force_of_the_wrong_sign_is_seen(
    monkeypatch: pytest.MonkeyPatch, soften: Soften, reachable: Draw, rng: Random
) -> None:
    model = _arm("xr701", "parallelogram", "beam", soften, rng, other=False)
    q = reachable(model.robot, 20, rng)
    slow = direct.compliance(model, q)
    assert _difference(compliance(model, q), slow) < BEAMS
    right = fem.statics.transfers._loop

    def wrong(arm: fem.statics.transfers._Arm, first: int) -> fem.statics.transfers._Loop | None:
        loop = right(arm, first)
        return None if loop is None else replace(loop, row=-loop.row)

    monkeypatch.setattr(fem.statics.transfers, "_loop", wrong)
    assert _difference(compliance(model, q), slow) > 0.1


def test_the_wrong_load_path_is_seen(soften: Soften, reachable: Draw, rng: Random) -> None:
    model = _arm("xr701", "parallelogram", "rigid", soften, rng, other=False)
    q = reachable(model.robot, 20, rng)
    serial = replace(model, bar=None)
    assert _difference(compliance(serial, q), direct.compliance(model, q)) > 0.01


def test_ten_percent_of_shear_area_are_seen(
    monkeypatch: pytest.MonkeyPatch, soften: Soften, reachable: Draw, rng: Random
) -> None:
    def wrong(*arguments: object) -> SectionProperties:
        p = section_properties(*arguments)  # type: ignore[arg-type]
        return replace(p, shear_y=1.1 * p.shear_y, shear_z=1.1 * p.shear_z)

    monkeypatch.setattr(fem.elements.beam, "section_properties", wrong)
    monkeypatch.setattr(fem.model, "_beam_parts", {})
    model = _arm("kr60-3", "serial", "beam", soften, rng, other=False)
    monkeypatch.undo()
    # The fast path uses the superelements made with the wrong area; the full assembly makes its own.
    q = reachable(model.robot, 20, rng)
    whole = direct.compliance(model, q, condensed=False)
    assert _difference(compliance(model, q), whole) > 1e3 * WHOLE


def test_a_tenth_of_a_degree_is_seen(soften: Soften, reachable: Draw, rng: Random) -> None:
    model = _arm("tx200", "serial", "rigid", soften, rng, other=False)
    q = reachable(model.robot, 20, rng)
    shifted = q + np.radians([0, 0, 0.1, 0, 0, 0])
    assert _difference(compliance(model, shifted), direct.compliance(model, q)) > 1e8 * RIGID
