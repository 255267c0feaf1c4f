"""Links as tapered Timoshenko beams: of each body a 6x6 flexibility in the body's frame, by integrals along the link.

An element at ``s`` yields by ``c(s)`` in the axes of its section; with ``Ad(s)`` the motion action from there to the
body's frame, the link yields by the integral of ``Ad c Ad^T`` (statically determinate: nothing else is needed).
Sections are hollow boxes and tubes, thin against their size; shear areas after Cowper (1966), torsion after Bredt.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from typing import Any

import numpy as np

from benchmarks.worlds.shopfloor.arms import Floats, Robot, robot, source_of

LENGTHS = {"m": 1.0, "mm": 1e-3, "GPa": 1e9, "1": 1.0}
# Gauss-Legendre points on each straight piece; the integrands are smooth.
NODES, SHARES = np.polynomial.legendre.leggauss(12)


def _si(figure: Mapping[str, Any]) -> Any:
    return np.multiply(figure["value"], LENGTHS[figure["unit"]])


def _outline(section: Mapping[str, Any], wall: float) -> Floats:
    """Width, height and wall of a box; diameter twice and wall of a tube, m; the wall times a factor."""
    names = ("diameter", "diameter", "wall") if section["kind"] == "tube" else ("width", "height", "wall")
    return np.array([float(_si(section[name])) for name in names]) * (1.0, 1.0, wall)


def yields(kind: str, outline: Floats, modulus: float, nu: float) -> Floats:
    """Flexibility per length (6,) of a section: along x; shear y, z; torsion; bending about y, z. y is the width."""
    width, height, wall = outline
    shear = modulus / (2.0 * (1.0 + nu))
    if kind == "tube":
        outer, inner = width / 2, width / 2 - wall
        area, bend = np.pi * (outer**2 - inner**2), np.pi / 4 * (outer**4 - inner**4)
        m = inner / outer
        kappa = 6 * (1 + nu) * (1 + m**2) ** 2 / ((7 + 6 * nu) * (1 + m**2) ** 2 + (20 + 12 * nu) * m**2)
        sheared, bent = kappa * shear * area, modulus * bend
        return 1.0 / np.array([modulus * area, sheared, sheared, 2 * shear * bend, bent, bent])
    b, h = width - wall, height - wall
    area = width * height - (width - 2 * wall) * (height - 2 * wall)
    about_y = (width * height**3 - (width - 2 * wall) * (height - 2 * wall) ** 3) / 12
    about_z = (height * width**3 - (height - 2 * wall) * (width - 2 * wall) ** 3) / 12
    torsion = 4 * (b * h) ** 2 * wall / (2 * (b + h))
    across = [2 * b * wall * 5 / 6, 2 * h * wall * 5 / 6]
    return 1.0 / np.array(
        [
            modulus * area,
            shear * across[0],
            shear * across[1],
            shear * torsion,
            modulus * about_y,
            modulus * about_z,
        ]
    )


def _action(point: Floats, axes: Floats) -> Floats:
    """Motion action (linear before angular) from a section's axes at a point to the body's frame."""
    x, y, z = point
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    action = np.zeros((6, 6))
    action[:3, :3] = action[3:, 3:] = axes
    action[:3, 3:] = cross @ axes
    return action


def _axes(x: Floats, up: Floats) -> Floats:
    """Axes of a section as columns: along, across, and towards ``up``."""
    up = up - (up @ x) * x
    if np.linalg.norm(up) < 1e-6:
        up = np.cross(x, [0.0, 1.0, 0.0] if abs(x[1]) < 0.9 else [0.0, 0.0, 1.0])
    z = up / np.linalg.norm(up)
    return np.stack([x, np.cross(z, x), z], axis=1)


def _along(points: Sequence[Floats], link: Mapping[str, Any], wall: float, modulus: float, nu: float) -> Floats:
    kind, first = link["section"]["kind"], _outline(link["section"], wall)
    last = _outline(link.get("section_end", link["section"]), wall)
    pieces = [b - a for a, b in pairwise(points)]
    total = sum(float(np.linalg.norm(p)) for p in pieces)
    flexibility, gone = np.zeros((6, 6)), 0.0
    for start, piece in zip(points, pieces, strict=False):
        length = float(np.linalg.norm(piece))
        axes = _axes(piece / length, np.array(link.get("beam_up", (1, 0, 0)), dtype=float))
        for node, share in zip((NODES + 1) / 2, SHARES / 2, strict=True):
            at = (gone + node * length) / total
            c = yields(kind, first + at * (last - first), modulus, nu)
            ad = _action(start + node * piece, axes)
            flexibility += share * length * (ad * c) @ ad.T
        gone += length
    return flexibility


def _ends(arm: Robot, body: int, link: Mapping[str, Any]) -> list[Floats]:
    """Corners of a link in its body's frame: from its origin over ``via`` to where the next body begins."""
    last = arm.flange if body == arm.dof - 1 else arm.axes[body + 1].xyz
    return [np.zeros(3), *(np.asarray(_si(v), dtype=float) for v in link.get("via", ())), np.array(last)]


@dataclass(frozen=True)
class Beam:
    """A link: its name, its body (a joint's number, -2 for the base) and 6x6 flexibility in that body's frame."""

    name: str
    body: int
    flexibility: Floats


@cache
def beams(name: str, wall: float = 1.0, modulus: float = 1.0) -> tuple[Beam, ...]:
    """The links of an arm, walls and moduli times these factors."""
    arm, table = robot(name), tomllib.loads(source_of(name).read_text(encoding="utf-8"))
    found = []
    for link in table["link"]:
        body = -1 if link["body"] == "base" else arm.names.index(link["body"])
        stuff = table["materials"][link["material"]]
        e, nu = modulus * float(_si(stuff["youngs_modulus"])), float(_si(stuff["poissons_ratio"]))
        flexibility = _along(_ends(arm, body, link), link, wall, e, nu)
        found.append(Beam(str(link["name"]), -2 if body < 0 else body, flexibility))
    return tuple(found)
