"""Six gear springs on the FANUC's real readings, its links imported from a public description's meshes.

    python -m benchmarks.links.fanuc_links FOLDER [--scales 0.5,1,2,3]

FOLDER is what ``stiffarm import r2000ic165f.urdf --out FOLDER`` wrote (fanuc_r2000ic_support of ROS-Industrial's
fanuc_experimental; expand its xacro first). Compliances of at least zero by least squares, in the fit and with one pose
left out at a time, in mm; ``scales``: times the links' compliance.
"""

from __future__ import annotations

import csv
import itertools
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

import doe
from benchmarks.asked import asked
from fem import build_model, compliance
from fem.model import ArmModel, LinkKind
from robots import Robot, load_description
from robots.kinematics import forward_kinematics, tool_position
from robots.robot import robot_from

READINGS = Path(doe.__file__).with_name("data") / "fanuc_r2000ic.csv"
SAME_M = 2e-3

Array = NDArray[np.float64]


def readings() -> tuple[Array, Array, Array, Array]:
    """Joint angles (n, 6) rad, wrenches (n, 6), displacements (n, 3) mm, point (3,) m in the flange frame."""
    with READINGS.open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))

    def columns(*names: str) -> Array:
        return np.array([[float(row[name]) for name in names] for row in rows])

    wrench = np.hstack([columns("fx_N", "fy_N", "fz_N"), np.zeros((len(rows), 3))])
    q = np.deg2rad(columns(*(f"q{k}_deg" for k in range(1, 7))))
    return q, wrench, columns("dx_mm", "dy_mm", "dz_mm"), 1e-3 * columns("px_mm", "py_mm", "pz_mm")[0]


def signs(bundled: Robot, imported: Robot) -> tuple[Array, Array]:
    """Signs (6,) of the description's joints, and its flange's axes (3, 3) in the bundled arm's, by trying all."""
    q = np.random.default_rng(0).uniform(-1.0, 1.0, (4, 6))

    def points(robot: Robot, poses: Array) -> Array:
        frames = forward_kinematics(robot, poses)
        return np.stack([tool_position(robot, frames, p) for p in np.vstack([np.zeros(3), np.eye(3)])])

    one = points(bundled, q)
    for sign in itertools.product((1.0, -1.0), repeat=6):
        other = points(imported, q * np.array(sign))
        turn = np.einsum("kni,jni->nkj", other[1:] - other[0], one[1:] - one[0])
        # The last joint turns about the flange's middle: only its axes tell its sign.
        if np.abs(other[0] - one[0]).max() < SAME_M and np.ptp(turn, axis=0).max() < SAME_M:
            return np.array(sign), np.asarray(turn[0])
    raise RuntimeError("the description's joints are not the readings' ones")


def fitted(A: Array, y: Array) -> tuple[float, float]:
    """RMS in the fit and at poses left out one at a time, mm; three rows of A (3n, 6) a pose."""
    out = []
    for i in range(0, len(y), 3):
        kept = np.ones(len(y), dtype=bool)
        kept[i : i + 3] = False
        out.append(A[i : i + 3] @ nnls(A[kept], y[kept])[0] - y[i : i + 3])
    residual = A @ nnls(A, y)[0] - y
    return float(np.sqrt(np.mean(residual**2))), float(np.sqrt(np.mean(np.square(out))))


def main() -> None:
    """Print the figures for rigid, beam and shell links."""
    given = asked(__doc__, "folder", scales="0.5,1,2,3")
    description = load_description(str(given.folder / "model.toml"))
    rigid = build_model(description, "rigid").with_rigid_joints()
    q, wrench, read, point = readings()
    sign, turn = signs(robot_from(load_description("fanuc-r2000ic")), rigid.robot)
    q, point = q * sign, turn @ point

    def motion(model: ArmModel) -> Array:
        return np.asarray(1e3 * np.einsum("nij,nj->ni", compliance(model, q, point), wrench)[:, :3])

    springs = [motion(rigid.with_springs({name: 1e6})) for name in rigid.robot.joint_names]
    A = np.stack(springs, axis=-1).reshape(-1, len(springs))
    print("rigid: {:.4f} in the fit, {:.4f} left out".format(*fitted(A, read.ravel())))
    kinds: tuple[LinkKind, ...] = ("beam", "shell")
    for kind in kinds:
        links = build_model(description, kind).links
        own = motion(replace(rigid, link_kind=kind, links=links))
        for scale in given.scales.split(","):
            figures = fitted(A, (read - float(scale) * own).ravel())
            print(f"{kind} links, {scale} times as compliant: {figures[0]:.4f} in the fit, {figures[1]:.4f} left out")


if __name__ == "__main__":
    main()
