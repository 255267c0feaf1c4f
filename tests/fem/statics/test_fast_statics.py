"""Compiled loops against numpy behind `fem.compliance`: the same numbers, whatever the arm is made of."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import oracles
import pytest
from scipy.spatial.transform import Rotation

import fem
from fem import ArmModel, build_model
from fem.compiled import compliance as compiled
from fem.compiled.compliance import SHARE, why_not_compiled
from fem.model import LinkKind, LinkPart
from fem.springs import ConstantSpring
from fem.statics import flexibility
from robots import InputError, LoadPath, Robot, load_description
from robots.arrays import Array

# Compiling takes its time.
pytestmark = pytest.mark.slow

oracles.load("numba")
kernels = compiled.kernels()
assert kernels is not None
BLOCK = kernels.BLOCK

Random = np.random.Generator
Draw = Callable[..., Array]
Soften = Callable[..., ArmModel]
Furnish = Callable[..., ArmModel]

ARMS: list[tuple[str, LoadPath]] = [
    ("xr701", "parallelogram"),
    ("xr701", "serial"),
    ("kr60-3", "serial"),
    ("tx200", "serial"),
]
# Entry by entry, of sqrt(C_ii C_jj), which bounds C_ij. Some hundred products and sums in another order, each rounded
# to 1e-16 of numbers of this size; measured 3e-14, and 2e-13 at the worst of 1e5 poses.
EXACT = 1e-12
# Several blocks, the last one not full.
POSES = 2 * BLOCK + 17


def difference(a: Array, b: Array) -> float:
    size = np.sqrt(np.einsum("nii->ni", b))
    return float((np.abs(a - b) / (size[:, :, None] * size[:, None, :])).max())


def fast(model: ArmModel, q: Array, point: Array | None = None, threads: int | None = 1) -> Array:
    assert why_not_compiled(model) is None
    return fem.compliance(model, q, point, threads=threads)


@pytest.fixture(autouse=True)
def _few_poses_too(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(compiled, "FEWEST", 0)


def positive(rng: Random, turn: float, points: int = 1) -> Array:
    """A full compliance (6 points, 6 points): shifts about 1e-8 m/N."""
    size = np.sqrt(np.array(([1e-8] * 3 + [turn] * 3) * points) * 10.0 ** -rng.uniform(0.0, 2.0, 6 * points))
    mix = rng.normal(size=(6 * points, 6 * points))
    return np.asarray(size[:, None] * (mix @ mix.T + 2.0 * np.eye(6 * points)) / 8.0 * size)


def with_linked(model: ArmModel, rng: Random) -> ArmModel:
    """Links whose interfaces all move one another: in beams the pin's force does not move the tip."""

    def link(part: LinkPart) -> LinkPart:
        F = positive(rng, 1e-7, len(part.element.flexibility) // 6)
        return replace(part, element=replace(part.element, flexibility=F))

    return replace(model, links=tuple(link(part) for part in model.links))


def askew(robot: Robot, rng: Random) -> Robot:
    """The same joints in frames turned at random."""
    T_pre, flange = robot.T_pre.copy(), robot.T_last_flange.copy()
    T_pre[:, :3, :3] = Rotation.random(robot.dof, rng=rng).as_matrix()
    flange[:3, :3] = Rotation.random(rng=rng).as_matrix()
    return replace(robot, T_pre=T_pre, T_last_flange=flange, R_post=Rotation.random(robot.dof, rng=rng).as_matrix())


def chain(dof: int, rng: Random) -> ArmModel:
    """A chain as from a URDF: axes anywhere, parallel ones and meeting ones too, every joint soft in six ways."""
    base = build_model(load_description("kr60-3"), links="rigid")
    T_pre = np.tile(np.eye(4), (dof, 1, 1))
    T_pre[:, :3, :3] = Rotation.random(dof, rng=rng).as_matrix()
    T_pre[1, :3, :3] = np.eye(3)
    T_pre[2, :3, :3] = Rotation.from_euler("x", 1e-9).as_matrix()
    T_pre[3, :3, :3] = Rotation.from_euler("zxz", [0.3, np.pi, 0.2]).as_matrix()
    T_pre[:, :3, 3] = rng.normal(size=(dof, 3)) * rng.integers(0, 2, (dof, 1))
    names = tuple(f"j{i + 1}" for i in range(dof))
    robot = replace(
        base.robot,
        name="chain",
        coordinates=tuple(f"q{i + 1}_deg" for i in range(dof)),
        joint_names=names,
        T_pre=T_pre,
        R_post=Rotation.random(dof, rng=rng).as_matrix(),
        sign=rng.choice([-1.0, 1.0], dof),
        offset=rng.normal(size=dof),
        limits=np.tile([-3.0, 3.0], (dof, 1)),
        couplings=(),
        T_flange_tool=T_pre[0],
    )
    joints = tuple(
        replace(base.joints[0], name=n, joint=i, axial=ConstantSpring(1e5), bearing=positive(rng, 1e-6))
        for i, n in enumerate(names)
    )
    return replace(base, robot=robot, joints=joints, base=positive(rng, 1e-7), tool=positive(rng, 1e-6))


@pytest.mark.parametrize("other", [False, True], ids=["axial", "six-way"])
@pytest.mark.parametrize("links", ["rigid", "beam", pytest.param("shell", marks=pytest.mark.slow)])
@pytest.mark.parametrize(("robot", "path"), ARMS)
def test_bundled_arms(
    robot: str, path: LoadPath, links: LinkKind, other: bool, soften: Soften, reachable: Draw, rng: Random
) -> None:
    model = soften(build_model(load_description(robot), links=links, load_path=path), rng, other=other)
    q = reachable(model.robot, POSES, rng)
    C = fast(model, q)
    assert difference(C, flexibility.compliance(model, q)) < EXACT
    np.testing.assert_array_equal(C, C.swapaxes(1, 2))
    size = np.sqrt(np.einsum("nii->ni", C))
    # Six springs hold six directions, so the least eigenvalue is above zero; scaled entries are of the order of one.
    assert np.linalg.eigvalsh(C / (size[:, :, None] * size[:, None, :])).min() > -EXACT


@pytest.mark.parametrize("turned", [False, True], ids=["as built", "askew"])
@pytest.mark.parametrize(("robot", "path"), ARMS)
def test_all_that_can_give_way(
    robot: str, path: LoadPath, turned: bool, soften: Soften, furnish: Furnish, reachable: Draw, rng: Random
) -> None:
    model = soften(build_model(load_description(robot), links="beam", load_path=path), rng, other=True)
    model = with_linked(furnish(model, rng), rng)
    q = reachable(model.robot, POSES, rng)
    if turned:
        model = replace(model, robot=askew(model.robot, rng))
    points = 0.3 * rng.normal(size=(POSES, 3))
    assert difference(fast(model, q, points), flexibility.compliance(model, q, points)) < EXACT
    assert difference(fast(model, q, points[0]), flexibility.compliance(model, q, points[0])) < EXACT


@pytest.mark.parametrize("crank_about", [0, 1, 3])
def test_a_parallelogram_anywhere_in_the_chain(
    crank_about: int, soften: Soften, furnish: Furnish, reachable: Draw, rng: Random
) -> None:
    model = with_linked(
        furnish(soften(build_model(load_description("xr701"), links="rigid"), rng, other=True), rng), rng
    )
    p = model.robot.parallelogram
    assert p is not None
    robot = askew(model.robot, rng)
    T_pre = robot.T_pre.copy()
    T_pre[:, :3, 3] = rng.normal(size=(6, 3))
    robot = replace(robot, T_pre=T_pre, parallelogram=replace(p, driven=crank_about + 1, crank_about=crank_about))
    model = replace(model, robot=robot)
    q = reachable(model.robot, POSES, rng)
    assert difference(fast(model, q), flexibility.compliance(model, q)) < EXACT


@pytest.mark.parametrize("dof", [4, 5, 6, 7])
def test_chains_as_from_a_urdf(dof: int, furnish: Furnish, rng: Random) -> None:
    model = chain(dof, rng)
    q = rng.uniform(-3.0, 3.0, (POSES, dof))
    assert difference(fast(model, q), flexibility.compliance(model, q)) < EXACT
    everything = with_linked(furnish(model, rng), rng)
    assert difference(fast(everything, q), flexibility.compliance(everything, q)) < EXACT


def test_many_turns_of_a_joint(soften: Soften, rng: Random) -> None:
    model = soften(build_model(load_description("kr60-3"), links="rigid"), rng)
    q = rng.uniform(-1e3, 1e3, (POSES, 6))
    # The angle itself is known to 1e-13 rad.
    assert difference(fast(model, q), flexibility.compliance(model, q)) < 1e-11
    q[3, 2] = 1e15  # the other way
    np.testing.assert_array_equal(fast(model, q), flexibility.compliance(model, q))


def test_sines_and_cosines_to_the_last_digit(rng: Random) -> None:
    cos, sin = np.empty(BLOCK), np.empty(BLOCK)
    for scale in 10.0 ** np.linspace(-6.0, 6.0, 40):
        angle = rng.uniform(-scale, scale, BLOCK)
        angle[:9] = np.arange(-4, 5) * (0.5 * np.pi)
        kernels._sines(angle, cos, sin)
        # Half a unit of numbers below one, twice: theirs and ours.
        np.testing.assert_allclose(sin, np.sin(angle), rtol=4e-16, atol=2e-16)
        np.testing.assert_allclose(cos, np.cos(angle), rtol=4e-16, atol=2e-16)


def test_threads_and_shares_change_no_digit(soften: Soften, furnish: Furnish, reachable: Draw, rng: Random) -> None:
    model = with_linked(furnish(soften(build_model(load_description("xr701")), rng, other=True), rng), rng)
    n = 3 * SHARE * BLOCK + 5
    q, points = reachable(model.robot, n, rng), rng.normal(size=(n, 3))
    C = fast(model, q, points, threads=3)
    np.testing.assert_array_equal(C, fast(model, q, points, threads=1))
    some = slice(n - 700, n - 100)
    np.testing.assert_array_equal(C[some], fast(model, q[some], points[some]))
    out = np.full_like(C, np.nan)
    assert fem.compliance(model, q, points, threads=2, out=out) is out
    np.testing.assert_array_equal(out, C)


@pytest.mark.parametrize(("robot", "path"), ARMS)
def test_deflection_and_directional_stiffness(
    robot: str, path: LoadPath, soften: Soften, reachable: Draw, rng: Random
) -> None:
    model = soften(build_model(load_description(robot), load_path=path), rng, other=True)
    q, points = reachable(model.robot, POSES, rng), rng.normal(size=(POSES, 3))
    size = np.sqrt(np.einsum("nii->ni", flexibility.compliance(model, q, points)))
    w = rng.normal(size=(POSES, 6)) * [500, 500, 500, 100, 100, 100]
    for load in (w, w[0]):
        d = fem.deflection(model, q, load, points, threads=1)
        # |C_ij| <= size_i size_j
        bound = size * np.sum(size * np.abs(load), axis=1, keepdims=True)
        assert (np.abs(d - flexibility.deflection(model, q, load, points)) / bound).max() < EXACT
    for direction in (None, np.array([1.0, -2.0, 0.5])):
        unit = compiled.unit_force(direction)
        k = fem.directional_stiffness(model, q, direction)
        np.testing.assert_allclose(1.0 / k, flexibility.deflection(model, q, unit) @ unit, rtol=10 * EXACT)


def test_few_poses_go_by_numpy(monkeypatch: pytest.MonkeyPatch, soften: Soften, reachable: Draw, rng: Random) -> None:
    model = soften(build_model(load_description("kr60-3")), rng)
    q, w = reachable(model.robot, POSES, rng), rng.normal(size=6)
    monkeypatch.setattr(compiled, "FEWEST", POSES + 1)
    np.testing.assert_array_equal(fem.compliance(model, q), flexibility.compliance(model, q))
    np.testing.assert_array_equal(fem.deflection(model, q, w), flexibility.deflection(model, q, w))


def test_arrays_of_any_kind_need_no_second_compilation(soften: Soften, reachable: Draw, rng: Random) -> None:
    model = soften(build_model(load_description("kr60-3"), links="rigid"), rng)
    q = reachable(model.robot, 50, rng)
    want = fast(model, q)
    q.setflags(write=False)
    np.testing.assert_array_equal(fast(model, q, np.zeros(3) + model.robot.T_flange_tool[:3, 3]), want)
    np.testing.assert_array_equal(fast(model, np.asfortranarray(q)), want)
    np.testing.assert_array_equal(fast(model, np.repeat(q, 2, axis=0)[::2]), want)
    assert len(kernels.deflections.signatures) == 1


def test_another_model_has_its_own_arrays(soften: Soften, reachable: Draw, rng: Random) -> None:
    model = build_model(load_description("kr60-3"), links="rigid")
    q = reachable(model.robot, 300, rng)
    for _ in range(3):
        model = soften(model, rng)
        assert difference(fast(model, q), flexibility.compliance(model, q)) < EXACT


def test_a_flat_parallelogram_is_refused_in_the_same_words(reachable: Draw, rng: Random) -> None:
    model = build_model(load_description("xr701"))
    n = 2 * SHARE * BLOCK
    q = reachable(model.robot, n, rng)
    q[[n - 300, n - 30], 2] = np.pi
    with pytest.raises(InputError, match="flat") as plain:
        flexibility.compliance(model, q)
    for threads in (1, 3):
        with pytest.raises(InputError) as refused:
            fast(model, q, threads=threads)
        assert str(refused.value) == str(plain.value)


def test_bad_input_is_refused_in_the_same_words() -> None:
    model = build_model(load_description("kr60-3"), links="rigid")
    q = np.zeros((5, 6))
    q[3, 1] = np.nan
    with pytest.raises(InputError, match="pose 3"):
        fem.compliance(model, q)
    with pytest.raises(InputError, match="tool point"):
        fem.compliance(model, np.zeros((5, 6)), np.zeros((4, 3)))
    with pytest.raises(InputError, match="out"):
        fem.compliance(model, np.zeros((5, 6)), out=np.zeros((5, 36)))
    with pytest.raises(InputError, match="threads"):
        fem.compliance(model, np.zeros((5, 6)), threads=0)
    with pytest.raises(InputError, match="wrench"):
        fem.deflection(model, np.zeros((5, 6)), np.zeros(5))
    with pytest.raises(InputError, match="load direction"):
        fem.directional_stiffness(model, np.zeros((5, 6)), np.zeros(3))
    with pytest.raises(InputError, match="rigid in this direction"):
        fem.directional_stiffness(model.with_rigid_joints(), np.zeros((5, 6)))


def test_no_poses_and_nothing_that_gives_way() -> None:
    model = build_model(load_description("kr60-3"), links="rigid").with_rigid_joints()
    assert fem.compliance(model, np.zeros((0, 6))).shape == (0, 6, 6)
    assert not fast(model, np.full((3, 6), 0.7)).any()


def test_without_numba_it_goes_the_other_way(monkeypatch: pytest.MonkeyPatch) -> None:
    model = build_model(load_description("kr60-3"))
    q = np.full((3, 6), 0.4)
    monkeypatch.setattr(compiled, "kernels", lambda: None)
    assert "numba" in str(why_not_compiled(model))
    np.testing.assert_array_equal(fem.compliance(model, q), flexibility.compliance(model, q))


def test_few_poses_do_not_load_numba() -> None:
    code = (
        "import sys, fem, numpy as np; from robots import load_description; "
        "fem.compliance(fem.build_model(load_description('kr60-3')), np.zeros((50, 6))); "
        "sys.exit('numba' in sys.modules)"
    )
    subprocess.run([sys.executable, "-c", code], check=True)  # noqa: S603


def test_a_crank_elsewhere_goes_the_other_way(reachable: Draw, rng: Random) -> None:
    model = build_model(load_description("xr701"))
    assert model.bar is not None
    assert model.bar.crank is not None
    strange = replace(model, bar=replace(model.bar, crank=replace(model.bar.crank, body=2)))
    assert "crank" in str(why_not_compiled(strange))
    q = reachable(model.robot, 5, rng)
    np.testing.assert_array_equal(fem.compliance(strange, q), flexibility.compliance(strange, q))
