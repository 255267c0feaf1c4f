"""What a kind of parameter is stands in one place: nothing else asks for its name."""

from __future__ import annotations

import ast
import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from fem import ArmModel, build_model, deflection
from fem.free import parameters as names
from fem.free.base import Figure, Flexibility, Kind, Parameter, Tables
from fem.free.kinds import KINDS
from fem.free.model import FreeModel, LoadedPoses
from fem.free.parameters import known_parameters, parameter
from fem.statics.ports import Port
from robots import load_description
from robots.arrays import Array

ROOT = Path(__file__).resolve().parents[3]
PACKAGES = ("robots", "meshes", "fem", "doe", "surrogate", "machining", "rehearsal", "stiffarm")


def asked(text: str) -> list[str]:
    """Comparisons of something's ``kind`` with the name of a kind of parameter."""
    known = {kind.name for kind in KINDS}
    # Parsing all files would take most of the test's time.
    if not re.search(r"\.(kind|name)\b", text) or not any(name in text for name in known):
        return []
    out = []
    for node in ast.walk(ast.parse(text)):
        if (
            isinstance(node, ast.Compare)
            and isinstance(node.left, ast.Attribute)
            and node.left.attr in ("kind", "name")
        ):
            owner = ast.unparse(node.left.value)
            strings = {n.value for c in node.comparators for n in ast.walk(c) if isinstance(n, ast.Constant)}
            if strings & known and not owner.endswith(("section", "law")):
                out.append(ast.unparse(node))
    return out


@pytest.mark.slow
def test_no_other_file_asks_for_a_kind_by_name() -> None:
    for package in PACKAGES:
        for path in (ROOT / package).rglob("*.py"):
            assert not asked(path.read_text(encoding="utf-8")), path
    assert asked("x = p.kind == 'wall'")  # it can be seen


@dataclass(frozen=True)
class _Softness(Kind):
    """By what share a joint's spring is softer than the model has it: a kind made up here."""

    def made(self, model: ArmModel, place: str, what: str) -> Parameter | None:
        if place not in model.robot.joint_names or what != self.name:
            return None
        index = model.robot.joint_names.index(place)
        return Parameter("", self, place, (index,), "1", 0.0, -0.5, 9.0, "linear")

    def changed(self, p: Parameter, v: float, model: ArmModel, walls: Mapping[str, Flexibility]) -> ArmModel:
        c = model.joints[p.index[0]].axial.compliance(np.zeros((1, model.robot.dof)))[0]
        return model.with_springs({p.place: 1.0 / (c * (1.0 + v))})

    def at_port(
        self, p: Parameter, v: Array, port: Port, model: ArmModel, q: Array, walls: Mapping[str, Flexibility]
    ) -> tuple[Array, Array]:
        J = model.joints[p.index[0]].axial.compliance(q)[:, None] * port.influence(5, 5)
        return v * J, J

    def put(self, p: Parameter, value: float, tables: Tables, figure: Figure) -> None:
        stiffness = tables.of("joint", p.place)["stiffness"]
        tables.of("joint", p.place)["stiffness"] = figure(stiffness["value"] / (1.0 + value), stiffness["unit"])


def test_a_kind_made_up_here_needs_no_other_file(monkeypatch: pytest.MonkeyPatch, rng: np.random.Generator) -> None:
    """Named, evaluated with its derivative, and written, by what it says itself."""
    monkeypatch.setattr(names, "KINDS", (*KINDS, _Softness("softness", is_linear=True)))
    springs = dict.fromkeys(("j1", "j2", "j3", "j4", "j5", "j6"), 1e6)
    model = build_model(load_description("kr60-3"), links="rigid").with_springs(springs)
    free = parameter(model, "j2.softness")
    assert free.is_linear
    q, w = rng.uniform(*model.robot.limits.T, (5, 6)), np.tile([0.0, 0.0, -500.0, 0.0, 0.0, 0.0], (5, 1))
    at = LoadedPoses(q, w, np.zeros((5, 3)))
    value, J = FreeModel(model, (free, parameter(model, "j3.stiffness")), at).evaluate(np.array([0.3, 1e-6]))
    softer = deflection(model.with_springs({"j2": 1e6 / 1.3}), q, w, np.zeros(3))
    np.testing.assert_allclose(value, softer, rtol=1e-10, atol=1e-15)  # sums of the same few terms
    np.testing.assert_allclose(0.3 * J[:, :, 0], softer - deflection(model, q, w, np.zeros(3)), rtol=1e-9, atol=1e-15)
    tables = Tables({"joint": [{"name": "j2", "stiffness": {"value": 1e6, "unit": "N m/rad"}}]})
    free.kind.put(free, 0.25, tables, lambda value, unit: {"value": value, "unit": unit})
    assert tables.of("joint", "j2")["stiffness"]["value"] == pytest.approx(8e5)


def test_every_kind_names_what_it_takes() -> None:
    model = build_model(load_description("xr701"))
    words = "; ".join(known_parameters(model))
    for name in (
        "j2.zero",
        "load.x",
        "load.tilt_z",
        "frame.rz",
        "point.z",
        "bar.stiffness",
        "forearm.modulus",
        "forearm.wall",
    ):
        place, what = name.split(".")
        assert place in words
        assert what.split("_")[0] in words
        found = parameter(model, name)
        low, high = found.kind.screened(found, (1e5, 1e6))
        assert replace(found, lower=low, upper=high).inner_bounds[0] < found.inner_bounds[1]
