"""A small robot with casings as visual meshes come: several bodies, holes, overlaps, millimetres; made in code."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import trimesh

UPPER_M, FOREARM_M, SHOULDER_M, SECTION_M = 0.7, 0.6, 0.4, (0.16, 0.2)


def casing(width: float, height: float, low: float, high: float, beside: float = 0.0) -> trimesh.Trimesh:
    """A box along z from ``low`` to ``high``, ``beside`` along y."""
    return trimesh.creation.box((width, height, high - low)).apply_translation([0, beside, 0.5 * (low + high)])


def with_hole(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """The mesh in finer triangles, one of them gone and a few turned."""
    fine = mesh.subdivide().subdivide()
    faces = np.array(fine.faces)
    faces[:6] = faces[:6, ::-1]
    return trimesh.Trimesh(fine.vertices, np.delete(faces, len(faces) // 2, axis=0), process=False)


def upper_arm() -> trimesh.Trimesh:
    """Beside the joints, in two overlapping parts with a hole, in millimetres."""
    lower = casing(SECTION_M[0], SECTION_M[1], -0.1, 0.45, 0.25)
    upper = casing(SECTION_M[0], SECTION_M[1], 0.4, UPPER_M + 0.1, 0.25)
    return trimesh.util.concatenate([with_hole(lower), with_hole(upper)]).apply_scale(1000.0)


@dataclass
class Arm:
    """What may be changed in the robot's description."""

    scale_upper: str = 'scale="0.001 0.001 0.001"'
    upper_file: str = "upper_arm.stl"
    forearm_file: str = "forearm.ply"
    mass_upper: float = 60.0
    meshes: dict[str, trimesh.Trimesh] = field(default_factory=dict)

    def write(self, folder: Path) -> Path:
        """Write URDF and meshes; returns the URDF's path."""
        (folder / "meshes").mkdir(parents=True, exist_ok=True)
        forearm = casing(0.14, 0.14, -0.08, FOREARM_M - 0.1)
        known = {
            "column.stl": casing(0.3, 0.3, 0.0, SHOULDER_M - 0.1),
            "upper_arm.stl": upper_arm(),
            "forearm.ply": trimesh.util.concatenate([forearm, casing(0.05, 0.3, -0.05, 0.05)]),
        }
        for name, mesh in (known | self.meshes).items():
            mesh.export(folder / "meshes" / name)
        path = folder / "arm.urdf"
        path.write_text(self._text(), encoding="utf-8")
        return path

    def _text(self) -> str:
        up = f'<mesh filename="meshes/{self.upper_file}" {self.scale_upper}/>'
        fore = f'<mesh filename="meshes/{self.forearm_file}"/>'
        column = '<mesh filename="meshes/column.stl"/>'
        links = [
            _link("column", column, 100.0),
            _link("carousel", '<cylinder radius="0.14" length="0.2"/>', 30.0),
            _link("upper_arm", up, self.mass_upper),
            _link("forearm", fore, 30.0),
            _link("hand", '<sphere radius="0.05"/>', 2.0),
            '<link name="tool0"/>',
        ]
        joints = [
            _joint("j1", "column", "carousel", (0, 0, SHOULDER_M), (0, 0, 1)),
            _joint("j2", "carousel", "upper_arm", (0, 0, 0), (0, 1, 0)),
            _joint("j3", "upper_arm", "forearm", (0, 0, UPPER_M), (0, 1, 0)),
            _joint("j4", "forearm", "hand", (0, 0, FOREARM_M), (0, 0, 1)),
            '<joint name="f" type="fixed"><parent link="hand"/><child link="tool0"/><origin xyz="0 0 0.01"/></joint>',
        ]
        return '<?xml version="1.0"?>\n<robot name="test_arm">' + "\n".join(links + joints) + "</robot>"


def _link(name: str, geometry: str, mass: float) -> str:
    inertia = '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>'
    return (
        f'<link name="{name}"><inertial><mass value="{mass}"/>{inertia}</inertial>'
        f"<visual><geometry>{geometry}</geometry></visual></link>"
    )


def _joint(name: str, parent: str, child: str, xyz: tuple[float, ...], axis: tuple[float, ...]) -> str:
    at, along = (" ".join(f"{v:g}" for v in values) for values in (xyz, axis))
    return (
        f'<joint name="{name}" type="revolute"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{at}"/><axis xyz="{along}"/><limit lower="-3" upper="3" effort="0" velocity="0"/></joint>'
    )
