"""Arms for the tests of the CalculiX input: bundled robots with large elements, poses, springs everywhere."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fem import ArmModel, build_model
from fem.elements.couplings import Coupling
from fem.elements.shell import shell_superelement
from fem.model import LinkPart
from fem.springs import FourierBasis, LawSpring
from meshes import casing_mesh
from robots import load_description
from robots.arrays import Array

Random = np.random.Generator

COARSE_M = 0.14
WRENCH = np.array([100.0, 50.0, -650.0, 10.0, 20.0, 30.0])
SPRINGS = {"j1": 2e6, "j2": 1.4e6, "j3": 0.76e6, "j4": 1.4e6, "j5": 1e6, "j6": 5e5}  # N m/rad
POSES_DEG = {
    "xr701": [20.0, 5.0, 77.5, 30.0, 40.0, 10.0],
    "kr60-3": [0.0, -60.0, 30.0, 0.0, 45.0, 0.0],
    "tx200": [20.0, 30.0, 60.0, 10.0, 45.0, 0.0],
}
# Twelve digits are written; levers and positions of some 1e3 mm take three.
WRITTEN = 1e-8


def coarse_link(part: LinkPart, flanges: Coupling, size: float, *, triangles: bool) -> LinkPart:
    shell = casing_mesh(part.mesh, size)
    if triangles:
        q = shell.quads
        halves = np.concatenate([q[:, [0, 1, 2]], q[:, [0, 2, 3]]])
        shell = replace(shell, triangles=halves, quads=q[:0], thickness=np.tile(shell.thickness, 2))
    kinds = dict.fromkeys(shell.interfaces, flanges)
    return replace(part, shell=shell, element=shell_superelement(shell, part.element.points, kinds), flanges=kinds)


def coarse(name: str, flanges: Coupling = "rigid", size: float = COARSE_M, *, triangles: bool = False) -> ArmModel:
    """A bundled robot with large shell elements and no openings or rims, joints as its description says."""
    model = build_model(load_description(name), links="beam")
    bar = model.bar
    if bar is not None and bar.crank is not None:
        bar = replace(bar, crank=coarse_link(bar.crank, flanges, size, triangles=triangles))
    links = tuple(coarse_link(link, flanges, size, triangles=triangles) for link in model.links)
    return replace(model, link_kind="shell", links=links, bar=bar)


def compliant(model: ArmModel, rng: Random) -> ArmModel:
    """Springs about the axes, full compliances of housings, bearings, base and tool, and laws across the axes."""
    model = model.with_springs(SPRINGS)
    size = np.sqrt([1e-9] * 3 + [1e-7] * 3)  # m/N and rad/(N m)

    def some() -> Array:
        A = rng.normal(size=(6, 6))
        return np.asarray(size[:, None] * (A @ A.T / 6.0) * size)

    joints = []
    for joint in model.joints:
        C = some()
        C[5, 5] = 0.0
        # Coupled with the axis: at most a tenth, so that the whole stays positive definite.
        C[5] *= 0.1 if model.bar is None else 0.0
        C[:, 5] = C[5]
        if joint.joint == 3:
            C = np.diag([1e-9, 2e-9, 3e-9, 1e-7, 2e-7, 0.0])
        law = LawSpring(FourierBasis(1, 1), np.array([17.0, 0.2, -0.1]))
        joints.append(replace(joint, bearing=C, housing=some(), laws=((joint.joint % 3, law),)))
    return replace(model, joints=tuple(joints), base=some(), tool=some())


def pose(name: str) -> Array:
    return np.radians(POSES_DEG[name])


def in_file_order(model: ArmModel) -> list[LinkPart]:
    """Links in the order of the file: the crank comes when the chain reaches its joint."""
    links = list(model.links)
    crank = None if model.bar is None else model.bar.crank
    if crank is None:
        return links
    first = next(i for i, link in enumerate(links) if link.body == crank.body - 1)
    return [*links[:first], crank, *links[first:]]
