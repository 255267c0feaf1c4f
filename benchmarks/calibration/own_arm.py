"""A world of its own for `calibrate`: an arm from a DH table and readings by plain numpy, which share no code with it.

Springs about the axes and nothing else: the deflection under a force F is ``J diag(1/k) J^T F``. What is not so (play,
friction, a drift of the gauge, set-ups that scatter) is asked for by name.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from robots.arrays import Array

# Modified DH (Craig): alpha deg, a, d mm, theta deg, limits deg; the flange last.
JOINTS = (
    (0.0, 0.0, 700.0, 0.0, -170.0, 170.0),
    (-90.0, 300.0, 0.0, -90.0, -80.0, 60.0),
    (0.0, 900.0, 0.0, 0.0, -80.0, 150.0),
    (-90.0, 100.0, 850.0, 0.0, -180.0, 180.0),
    (90.0, 0.0, 0.0, 0.0, -115.0, 115.0),
    (-90.0, 0.0, 0.0, 0.0, -180.0, 180.0),
)
FLANGE = (0.0, 0.0, 200.0, 0.0)
PAYLOAD_kg, MASS_kg = 60.0, 650.0
SPRINGS = np.array([0.9e6, 0.8e6, 0.6e6, 2.0e5, 1.5e5, 0.8e5])
AXES = {"x": 0, "y": 1, "z": 2}


@dataclass(frozen=True)
class Campaign:
    """``loads`` N down (or, ``every_way``, in a direction drawn for each pose), ``unload``: and off again; SI.

    ``noise`` m: of each component; ``setup``: scatter between set-ups as a share of each component; ``play`` rad: in
    joint 3, half of the gap, on the side to which its torque pushes; ``friction`` N m in joint 2; ``drift`` m: of the
    gauge's Z over the whole campaign, evenly; ``sigma_mm``: what the table says of itself.
    """

    poses: int = 20
    loads: tuple[float, ...] = (100.0, 300.0, 500.0)
    repeats: int = 1
    every_way: bool = False
    unload: bool = False
    read: str = "xyz"
    noise: float = 6e-6
    setup: float = 0.0
    play: float = 0.0
    friction: float = 0.0
    drift: float = 0.0
    sigma_mm: float | None = None
    steps: bool = False


def dh_table(file: Path) -> Path:
    """The arm as a table that `stiffarm new --mdh` takes."""
    rows = ["joint,alpha_deg,a_mm,d_mm,theta_deg,lower_deg,upper_deg,sign"]
    rows += [f"j{k},{','.join(map(str, row))},1" for k, row in enumerate(JOINTS, start=1)]
    file.write_text("\n".join([*rows, f"flange,{','.join(map(str, FLANGE))},,,"]) + "\n", encoding="utf-8")
    return file


def _link(alpha: float, a: float, d: float, theta: float) -> Array:
    ca, sa, ct, st = np.cos(alpha), np.sin(alpha), np.cos(theta), np.sin(theta)
    return np.array([[ct, -st, 0.0, a], [st * ca, ct * ca, -sa, -sa * d], [st * sa, ct * sa, ca, ca * d], [0, 0, 0, 1]])


def jacobian(q: Array) -> tuple[Array, Array]:
    """How the flange moves with each joint (3, 6), and where it is (3,), m; q (6,) deg."""
    T, axes, places = np.eye(4), [], []
    for (alpha, a, d, theta, _, _), angle in zip(JOINTS, q, strict=True):
        T = T @ _link(np.radians(alpha), a * 1e-3, d * 1e-3, np.radians(theta + angle))
        axes.append(T[:3, 2])
        places.append(T[:3, 3])
    end = (T @ _link(np.radians(FLANGE[0]), FLANGE[1] * 1e-3, FLANGE[2] * 1e-3, np.radians(FLANGE[3])))[:3, 3]
    return np.array([np.cross(z, end - p) for z, p in zip(axes, places, strict=True)]).T, end


def _poses(rng: np.random.Generator, n: int) -> Array:
    low, high = 0.8 * np.array(JOINTS)[:, 4:].T
    out: list[Array] = []
    while len(out) < n:
        q = np.round(rng.uniform(low, high), 3)
        end = jacobian(q)[1]
        if end[2] > 0.3 and np.hypot(*end[:2]) > 0.7:
            out.append(q)
    return np.array(out)


@dataclass(frozen=True)
class Read:
    """Readings in the order of time: ``q`` (n, 6) deg, ``force`` (n, 3) N, ``moved`` (n, 3) m, labels."""

    q: Array
    force: Array
    moved: Array
    pose: list[int]
    repeat: list[int]
    phase: list[str]

    def least_squares(self, seen: tuple[int, ...]) -> tuple[Array, Array, int]:
        """Compliances of joints ``seen`` (counted from 0), their standard deviations, degrees of freedom: plain."""
        J = [jacobian(q)[0] for q in self.q]
        A = np.vstack([j[:, seen] * (j.T @ f)[list(seen)] for j, f in zip(J, self.force, strict=True)])
        y = self.moved.reshape(-1)
        x = np.linalg.lstsq(A, y, rcond=None)[0]
        free = len(y) - len(seen)
        return x, np.sqrt(np.diag(np.linalg.inv(A.T @ A)) * np.sum((y - A @ x) ** 2) / free), free


def read(c: Campaign, rng: np.random.Generator, springs: Array = SPRINGS) -> Read:
    """One campaign."""
    course = [(load, "loading") for load in c.loads]
    course += [(load, "unloading") for load in c.loads[-2::-1]] if c.unload else []
    rows = []
    for number, q in enumerate(_poses(rng, c.poses), start=1):
        J = jacobian(q)[0]
        way = rng.normal(size=3) if c.every_way else np.array([0.0, 0.0, -1.0])
        scatter = 1.0 + c.setup * rng.normal(size=3)
        for repeat in range(1, c.repeats + 1):
            for load, phase in course:
                force = load * way / np.linalg.norm(way)
                torque = J.T @ force
                turn = torque / springs
                turn[2] += c.play * np.sign(torque[2])
                back = c.friction if phase == "unloading" else -c.friction
                turn[1] = np.sign(torque[1]) * max(abs(torque[1]) + back, 0.0) / springs[1]
                rows.append((q, force, J @ turn * scatter, number, repeat, phase))
    q, force, moved = (np.array([row[k] for row in rows]) for k in range(3))
    moved = moved + np.linspace(0.0, c.drift, len(rows))[:, None] * np.array([0.0, 0.0, 1.0])
    moved = moved + c.noise * rng.normal(size=moved.shape)
    return Read(q, force, moved, *([row[k] for row in rows] for k in (3, 4, 5)))


def write(c: Campaign, r: Read, file: Path, *, loads: float = 1.0, deflections: float = 1.0) -> Path:
    """The measurement table; loads and deflections times a factor, as where a unit is wrong."""
    heads = [f"q{k}_deg" for k in range(1, 7)] + ["fx_N", "fy_N", "fz_N"] + [f"d{axis}_mm" for axis in c.read]
    heads += ["pose", "repeat", *(["phase"] if c.unload else []), *(["step"] if c.steps else [])]
    lines = [",".join([*heads, *([] if c.sigma_mm is None else ["sigma_mm"])])]
    for k in range(len(r.q)):
        cells = [f"{v:.3f}" for v in r.q[k]] + [f"{loads * v:.4f}" for v in r.force[k]]
        cells += [f"{1e3 * deflections * r.moved[k, AXES[axis]]:.5f}" for axis in c.read]
        cells += [str(r.pose[k]), str(r.repeat[k]), *([r.phase[k]] if c.unload else [])]
        cells += [*([str(k + 1)] if c.steps else []), *([] if c.sigma_mm is None else [f"{c.sigma_mm:g}"])]
        lines.append(",".join(cells))
    file.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return file
