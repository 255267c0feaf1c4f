"""The capsules that stand for arms without a shape, against the collision meshes that support packages publish.

    python benchmarks/shop/assumed_shapes.py FOLDER [--write]

FOLDER holds checkouts of packages such as ros-industrial's abb, fanuc, kuka_experimental and staubli: every
``*_macro.xacro`` below it whose meshes are there is read. Kinematics go the way of any URDF; of each link's collision
mesh it is counted how many vertices some capsule of the arm holds, over poses drawn within the limits, and the volume
of all capsules together (by random points) is put over that of the links' convex hulls. The shares in

``machining/cell/assumed_shapes.py`` were fitted on such arms; none is held out.
The meshes are for trying only.
``--write`` writes docs/validation/assumed_shapes.md.
"""

from __future__ import annotations

import math
import re
import sys
import tempfile
import xml.etree.ElementTree as ET
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from benchmarks.asked import asked

sys.path.insert(0, str(Path(__file__).parents[1]))

from arithmetic import value

from machining.cell.assumed_shapes import assumed_solids
from robots import InputError, Robot, read_urdf
from robots.arrays import Array
from robots.kinematics import moving_frames, stretched_length
from robots.robot import robot_from, trial_poses

PAGE = Path(__file__).resolve().parents[2] / "docs" / "validation" / "assumed_shapes.md"
POSES, POINTS = 3, 60_000
WANTED, MOST = 0.95, 3.0
HEAD = """# Assumed shapes against published meshes

Capsules that stand for an arm without a shape hold {held:.1%} of the vertices of the collision meshes of {count} arms
from {packages} support packages, in the mean over the arms, and {volume:.2f} times the volume of the links' hulls.
{good} of the arms have both at least 95 % and at most three times. What is left outside: base plates wider than the
arm is thick, and upper arms that stand beside the plane of the joint origins (rx160).

Written by `python benchmarks/shop/assumed_shapes.py FOLDER --write`; checkouts of the packages are needed, their meshes
are not part of stiffarm. The shares of the radii were fitted on about half of the arms, and the base's was then raised
after a look at all of them, so no arm here is an independent check.

| arm | length, mm | vertices held | volume over hulls |
|---|---|---|---|
"""


def plain(text: str) -> str:
    """A xacro attribute with its simple arithmetic done."""
    names = {"radians": math.radians, "pi": math.pi, "prefix": ""}
    return re.sub(r"\$\{([^}]*)\}", lambda found: str(value(found[1], names)), text)


def expanded(path: Path) -> ET.Element | None:
    """The links and joints of a macro as a URDF; None where there is none."""
    tree = ET.parse(path).getroot()  # noqa: S314
    macro = next((one for one in tree.iter() if str(one.tag).endswith("}macro")), None)
    if macro is None:
        return None
    out = ET.Element("robot", name=path.stem)
    for part in macro:
        if part.tag not in ("link", "joint"):
            continue
        for one in part.iter():
            for key, text in one.attrib.items():
                one.set(key, plain(text))
            for child in [c for c in one if str(c.tag).startswith("{")]:
                one.remove(child)
        out.append(part)
    return out


def arm_of(path: Path) -> tuple[Robot, list[list[Any]]] | None:
    """An arm and the collision meshes of its bodies, in their frames; None where too much is missing."""
    urdf = expanded(path)
    if urdf is None:
        return None
    meshes: dict[str, list[Any]] = {}
    for link in urdf.findall("link"):
        for shape in link.findall("collision"):
            mesh, origin = shape.find("geometry/mesh"), shape.find("origin")
            moved = origin is not None and any(
                float(v) for key in ("xyz", "rpy") for v in origin.get(key, "0 0 0").split()
            )
            file = None if mesh is None else path.parents[2] / mesh.get("filename", "").removeprefix("package://")
            if file is not None and file.is_file() and not moved:
                meshes.setdefault(link.get("name", ""), []).append(trimesh.load(file))
        for tag in ("visual", "collision", "inertial"):
            for one in link.findall(tag):
                link.remove(one)
    with tempfile.TemporaryDirectory() as folder:
        bare = Path(folder) / "arm.urdf"
        bare.write_bytes(ET.tostring(urdf))
        robot = robot_from(read_urdf(bare).description)
    child = {joint.get("name"): joint.find("child") for joint in urdf.findall("joint")}
    links = ["base_link", *(str(one.get("link")) for name in robot.joint_names if (one := child[name]) is not None)]
    found = [meshes.get(link, []) for link in links]
    return (robot, found) if sum(map(bool, found)) >= robot.dof else None


def compared(robot: Robot, meshes: list[list[Any]]) -> tuple[float, float]:
    """Share of the vertices that capsules hold, and their volume over that of the hulls."""
    solids = assumed_solids(robot)
    R, p = moving_frames(robot, trial_poses(robot, 200, POSES))
    held, count = 0, 0
    for i in range(len(R)):
        capsules = [
            (solid.nodes @ R[i, body].T + p[i, body], solid.radius) for body, made in solids.items() for solid in made
        ]
        for body, several in enumerate(meshes):
            for mesh in several:
                at = np.asarray(mesh.vertices) @ R[i, body].T + p[i, body]
                held += int(inside(at, capsules).sum())
                count += len(at)
    low = np.min([ends.min(axis=0) - radius for ends, radius in capsules], axis=0)
    high = np.max([ends.max(axis=0) + radius for ends, radius in capsules], axis=0)
    within = inside(np.random.default_rng(0).uniform(low, high, (POINTS, 3)), capsules).mean()
    hulls = sum(mesh.convex_hull.volume for several in meshes for mesh in several)
    return held / count, float(within * np.prod(high - low) / hulls)


def inside(points: Array, capsules: list[tuple[Array, float]]) -> Array:
    """Whether any capsule holds each point (k,)."""
    out = np.zeros(len(points), dtype=np.bool_)
    for ends, radius in capsules:
        for a, b in pairwise(ends):
            share = np.clip((points - a) @ (b - a) / ((b - a) @ (b - a)), 0.0, 1.0)
            out |= np.linalg.norm(points - a - share[:, None] * (b - a), axis=1) <= radius
    return out


def main() -> None:
    """Compare all arms of a folder."""
    given = asked(__doc__, "folder", write=False)
    rows: list[tuple[str, float, float, float]] = []
    packages = set()
    for path in sorted(given.folder.rglob("*_macro.xacro"), key=lambda p: p.name):
        try:
            found = arm_of(path)
        except (InputError, ET.ParseError, NameError, SyntaxError):
            continue
        if found is None:
            continue
        packages.add(path.relative_to(given.folder).parts[0])
        rows.append(
            (path.stem.removesuffix("_macro"), 1e3 * stretched_length(found[0], np.zeros(3)), *compared(*found))
        )
        print(f"{rows[-1][0]:20s} {rows[-1][2]:.3f} {rows[-1][3]:.2f}", flush=True)
    figures = np.array([row[2:] for row in rows])
    good = int(((figures[:, 0] >= WANTED) & (figures[:, 1] <= MOST)).sum())
    held, volume = figures.mean(axis=0)
    print(f"mean {held:.3f} {volume:.2f}; {good} of {len(rows)} both")
    if given.write:
        head = HEAD.format(
            held=held,
            volume=volume,
            count=len(rows),
            packages=len(packages),
            good=good,
        )
        lines = [f"| {name} | {length:.0f} | {share:.1%} | {ratio:.2f} |" for name, length, share, ratio in rows]
        PAGE.write_text(head + "\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
