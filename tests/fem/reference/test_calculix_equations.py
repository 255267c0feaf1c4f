"""The equations and springs of the CalculiX input, exactly and without CalculiX."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from calculix_arms import SPRINGS, WRENCH, WRITTEN, coarse, compliant, in_file_order, pose
from calculix_runs import Freedom, Read, read_deck

from benchmarks.statics.calculix.arm import arm_deck
from benchmarks.statics.calculix.deck import safe_name
from fem import ArmModel, compliance
from fem.elements.couplings import Coupling
from robots.arrays import Array
from robots.kinematics import forward_kinematics, jacobian

Random = np.random.Generator


def velocities(model: ArmModel, q: Array, rates: Array) -> list[tuple[Array, Array, Array]]:
    """Of each body at joint rates (dof,): displacement of its origin, rotation, origin (3,) m."""
    frames = forward_kinematics(model.robot, q[None])
    out = [(np.zeros(3), np.zeros(3), np.zeros(3))]
    for rate, axis, at in zip(rates, frames.axis[0], frames.p[0, 1:], strict=True):
        shift, turn, origin = out[-1]
        out.append((shift + np.cross(turn, at - origin), turn + rate * axis, at))
    return out


def moved(model: ArmModel, read: Read, q: Array, rates: Array) -> dict[int, Array]:
    """Displacement (3,) of every node, mm, or what stands for it, as all bodies are rigid and joints turn."""
    bodies = velocities(model, q, rates)
    u: dict[int, Array] = {}

    def move(name: str, shift: Array, turn: Array, origin: Array) -> None:
        for node in read.node_sets[name]:
            rotates = "ROT_" in f"{name}_".replace("TOOL_", "")
            u[node] = turn if rotates else 1e3 * shift + np.cross(turn, read.nodes[node] - 1e3 * origin)

    for i, link in enumerate(in_file_order(model), 1):
        body = bodies[link.body]
        if link.name == "crank":  # it turns as the forearm does, but about the upper arm's joint
            body = (bodies[link.body - 1][0], body[1], bodies[link.body - 1][2])
        for name in read.node_sets:
            if re.match(rf"(N|REF|ROT)_L{i}_", name):
                move(name, *body)
    for name in ("TOOL", "TOOL_ROT"):
        move(name, *bodies[-1])
    for name, (node, *more) in read.node_sets.items():
        if node not in u and not more:
            joint = int("".join(re.findall(r"^[A-Z]+(\d+)_", name)) or 0)
            turn = 0.0 if joint == 0 else rates[joint - 1]
            if model.bar is not None and name == "J3_J3":  # the actuator turns the crank against the carousel
                turn = rates[1] + rates[2]
            u[node] = np.array([turn, 0.0, 0.0])
    return u


@pytest.mark.parametrize("flanges", ["rigid", "distributing"])
@pytest.mark.parametrize(
    ("name", "rigid"),
    [
        ("xr701", ()),
        ("kr60-3", ()),
        # Without a shell motions are carried on; without a bar's compliance another freedom follows.
        ("kr60-3", ("pedestal", "upper-arm", "wrist")),
        ("xr701", ("bar",)),
        ("xr701", ("bar", "carousel", "forearm")),
        ("xr701", ("bar", "crank", "forearm", "wrist")),
    ],
)
def test_rigid_bodies_turning_in_the_joints_fulfil_every_equation(
    name: str, rigid: tuple[str, ...], flanges: Coupling, rng: Random
) -> None:
    model, q = coarse(name, flanges).with_springs(SPRINGS), pose(name)
    model = replace(model, links=tuple(link for link in model.links if link.name not in rigid))
    if model.bar is not None and rigid:
        model = replace(model, bar=replace(model.bar, compliance=0.0))
    if model.bar is not None and "crank" in rigid:
        model = replace(model, bar=replace(model.bar, crank=None))
    deck = arm_deck(model, q, WRENCH)
    read = read_deck(deck.text)
    rates = rng.normal(size=6)
    u = moved(model, read, q, rates)
    size = max(float(np.abs(v).max()) for v in u.values())
    spinning = {node: rotation for name, _, rotation in read.rigid for node in read.node_sets[name]}
    for equation in read.equations:
        # A ring's own rotations (4 to 6) are the ones of its link.
        values = [(u[n] if k <= 3 else u[spinning[n]])[(k - 1) % 3] for n, k in equation]
        terms = np.array(list(equation.values())) * values
        assert abs(terms.sum()) < WRITTEN * size * max(1.0, *map(abs, equation.values())), equation
    for ring, reference, rotation in read.rigid:
        at = read.nodes[reference]
        for node in read.node_sets[ring]:
            assert np.abs(u[node] - u[reference] - np.cross(u[rotation], read.nodes[node] - at)).max() < WRITTEN * size
    assert max(abs(u[node][k - 1]) for node, k in read.fixed) < WRITTEN
    tool = np.concatenate([1e-3 * u[deck.tool[0]], u[deck.tool[1]]])
    expected = jacobian(model.robot, q[None])[0] @ (rates * model.robot.sign)
    assert np.abs(tool - expected).max() < WRITTEN * np.abs(expected).max()


def test_the_springs_alone_give_the_compliance_of_the_rigid_arm(rng: Random) -> None:
    """Resolve the equations with rigid links: the scalar freedoms and their springs are the whole compliance."""
    model, q = compliant(coarse("kr60-3"), rng), pose("kr60-3")
    deck = arm_deck(model, q, WRENCH)
    read = read_deck(deck.text)
    scalars = read.node_sets["SCALARS"]
    value: dict[Freedom, Array] = {f: np.zeros(len(scalars)) for f in read.fixed}
    value |= {(node, 1): row for node, row in zip(scalars, np.eye(len(scalars)), strict=True)}
    rooted = {next(iter(e)): e for e in read.equations}
    for i, link in enumerate(in_file_order(model), 1):
        label = f"L{i}_{safe_name(link.name)}"
        root, turn, tip, tip_turn = (
            read.node_sets[f"{kind}_{label}_{end}"][0] for end in ("ROOT", "TIP") for kind in ("REF", "ROT")
        )
        _resolve(rooted, value, root)
        _resolve(rooted, value, turn)
        shift, rotation = (np.array([value[node, k] for k in (1, 2, 3)]) for node in (root, turn))
        carried = shift + np.cross(rotation, read.nodes[tip] - read.nodes[root], axisa=0, axisb=0, axisc=0)
        value |= {(tip, k): carried[k - 1] for k in (1, 2, 3)}
        value |= {(tip_turn, k): rotation[k - 1] for k in (1, 2, 3)}
    for node in deck.tool:
        _resolve(rooted, value, node)
    columns = np.array(
        [value[node, k] / (1e3 if node == deck.tool[0] else 1.0) for node in deck.tool for k in (1, 2, 3)]
    )
    springs = {read.elements[read.members(name)[0]][1][0]: k for name, k in read.springs.items()}
    k_SI = np.array([springs[node] for node in scalars]) / 1e3  # N mm per unit^2 in J
    C = columns / k_SI @ columns.T
    expected = compliance(replace(model, links=(), link_kind="rigid"), q[None])[0]
    scale = np.sqrt(np.diag(expected))
    assert (np.abs(C - expected) / np.outer(scale, scale)).max() < WRITTEN


def _resolve(rooted: dict[Freedom, dict[Freedom, float]], value: dict[Freedom, Array], node: int) -> None:
    for k in (1, 2, 3):
        if (node, k) not in value:
            terms = list(rooted[node, k].items())[1:]
            value[node, k] = -np.sum([c * value[freedom] for freedom, c in terms], axis=0)
