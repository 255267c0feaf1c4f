"""Arms as their description files state them, read as text: fixed frames, axes, limits, masses and sections."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
BUNDLED = Path(__file__).resolve().parents[3] / "robots" / "data"
OWN = Path(__file__).with_name("data")
GRAVITY = 9.81
UNITS = {"m": 1.0, "mm": 1e-3, "deg": 1.0, "kg": 1.0, "GPa": 1e9, "N m/rad": 1.0, "1": 1.0}
# N m/rad. xr701, kr60-3 and fanuc near published values, the others of their class.
SPRINGS: dict[str, tuple[float, ...]] = {
    "xr701": (1.8e6, 1.4e6, 0.76e6, 6e5, 3.5e5, 2.2e5),
    "kr60-3": (2.1977e6, 0.8994e6, 1.1118e6, 6.44e4, 2.54e4, 2.0e4),
    "tx200": (1.7e6, 1.2e6, 8.5e5, 1.9e5, 1.2e5, 8e4),
    "fanuc-r2000ic": (9.34e5, 4.13e6, 1.91e6, 2.33e5, 4.04e5, 7.96e4),
    "crane6": (9e5, 7e5, 4.2e5, 7e4, 4.5e4, 2.8e4),
    "reed7": (4e5, 3.4e5, 2.2e5, 1.5e5, 5.5e4, 4e4, 2.2e4),
}
# No file states the masses of its parts; the whole arm's, split as in others of its class.
FANUC_PARTS = {"base": 330.0, "j1": 290.0, "j2": 190.0, "j3": 230.0, "j6": 50.0}


def _si(entry: Any) -> Any:
    value = entry["value"]
    scale = UNITS[entry["unit"]]
    return [v * scale for v in value] if isinstance(value, list) else value * scale


@dataclass(frozen=True)
class Section:
    """A hollow section: what a beam of OpenSees asks for."""

    area: float
    inertia: float
    torsion: float
    modulus: float
    shear: float


@dataclass(frozen=True)
class Link:
    """A casing between two joints."""

    name: str
    body: str
    section: Section


@dataclass(frozen=True)
class Stand:
    """Where everything is at one pose, in base axes."""

    origins: Array  # (n, 3) of the joints
    axes: Array  # (n, 3)
    across: Array  # (n, 3) a direction across each axis, fixed to the body before it
    turned: Array  # (n, 3, 3) of the bodies behind the joints
    flange: Array  # (3,)


@dataclass(frozen=True)
class Arm:
    """A serial arm of n joints. Lengths in m, angles of joints in deg as tables state them, masses in kg."""

    name: str
    joints: tuple[str, ...]
    columns: tuple[str, ...]
    frames: Array  # (n, 4, 4) of each joint in the frame behind the one before
    about: Array  # (n, 3) its axis there
    signs: Array
    offsets: Array
    low: Array
    high: Array
    flange: Array
    tool: Array
    couplings: tuple[tuple[Array, float, float, float], ...]  # factors, offset, lowest, highest
    masses: dict[str, float]
    links: tuple[Link, ...]
    payload: float  # N
    springs: Array
    pin: Array | None = None

    @property
    def reach(self) -> float:
        """Of all frames in a row, m."""
        return float(np.linalg.norm(self.frames[1:, :3, 3], axis=1).sum() + np.linalg.norm(self.flange))

    @property
    def size(self) -> float:
        """Torques of this arm over those of a 130 kg arm."""
        return self.payload * self.reach / (1300 * 3.0)

    @property
    def torque(self) -> float:
        """What the payload brings at half the reach, N m."""
        return 0.5 * self.payload * self.reach

    def index(self, joint: str) -> int:
        """Number of a joint by its name."""
        return self.joints.index(joint)

    def shifted(self, lengths: Array, zeros: Array) -> Arm:
        """Frames off by lengths (n + 1, 3) in m, joint zeros by (n,) in deg."""
        frames = self.frames.copy()
        frames[:, :3, 3] += lengths[:-1]
        return replace(self, frames=frames, offsets=self.offsets + zeros, flange=self.flange + lengths[-1])

    def allows(self, q: Array) -> bool:
        """Whether angles (n,) in deg are within the limits, coupled ones too."""
        coupled = all(low <= offset + factors @ q <= high for factors, offset, low, high in self.couplings)
        return bool(np.all(q >= self.low - 1e-9) and np.all(q <= self.high + 1e-9) and coupled)

    def stand(self, q: Array) -> Stand:
        """The arm at angles (n,) in deg."""
        here = np.eye(4)
        origins, axes, across, turned = [], [], [], []
        for frame, about, angle in zip(self.frames, self.about, self.signs * q + self.offsets, strict=True):
            here = here @ frame
            u = about / np.linalg.norm(about)
            other = np.eye(3)[int(np.argmin(np.abs(u)))]
            v = np.cross(u, other)
            origins.append(here[:3, 3])
            axes.append(here[:3, :3] @ u)
            across.append(here[:3, :3] @ v / np.linalg.norm(v))
            here = here.copy()
            here[:3, :3] = here[:3, :3] @ rotation(u, np.radians(angle))
            turned.append(here[:3, :3])
        end = here[:3, :3] @ self.flange + here[:3, 3]
        return Stand(np.array(origins), np.array(axes), np.array(across), np.array(turned), end)


def rotation(axis: Array, angle: float) -> Array:
    """About a unit axis by an angle in rad, (3, 3) (Rodrigues)."""
    x, y, z = axis
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * k @ k


def turns(arm: Arm, stand: Stand, point: Array) -> tuple[Array, Array]:
    """What a point (3,) in the flange frame moves by for a turn of 1 rad about each axis (n, 3); where it is (3,)."""
    tip = stand.flange + stand.turned[-1] @ point
    return np.cross(stand.axes, tip - stand.origins), tip


def _fixed(joint: dict[str, Any]) -> tuple[Array, Array]:
    """Frame (4, 4) of a joint at zero, and its axis there."""
    frame = np.eye(4)
    if "frame" in joint:
        frame[:3, 3] = _si(joint["frame"]["xyz"])
        return frame, np.array(joint["frame"]["axis"], dtype=float)
    dh = {key: _si(joint["dh"][key]) for key in ("alpha", "a", "d")}
    frame[:3, :3] = rotation(np.array([1.0, 0, 0]), np.radians(dh["alpha"]))
    frame[:3, 3] = np.array([dh["a"], 0, 0]) + frame[:3, :3] @ np.array([0, 0, dh["d"]])
    return frame, np.array([0.0, 0, 1])


def _section(link: dict[str, Any], materials: dict[str, Any]) -> Section:
    """At the link's root: thin walls, torsion after Bredt."""
    of, material = link["section"], materials[link["material"]]
    modulus, nu = _si(material["youngs_modulus"]), _si(material["poissons_ratio"])
    wall = _si(of["wall"])
    if of["kind"] == "tube":
        radius = (_si(of["diameter"]) - wall) / 2
        area, inertia = 2 * np.pi * radius * wall, np.pi * radius**3 * wall
        torsion = 2 * inertia
    else:
        b, h = _si(of["width"]) - wall, _si(of["height"]) - wall
        area, torsion = 2 * (b + h) * wall, 2 * wall * (b * h) ** 2 / (b + h)
        inertia = (wall * h**2 * (h + 3 * b) + wall * b**2 * (b + 3 * h)) / 12
    return Section(area, inertia, torsion, modulus, modulus / (2 + 2 * nu))


def path_of(name: str) -> Path:
    """The description file of an arm."""
    own = OWN / f"{name}.toml"
    return own if own.exists() else BUNDLED / f"{name}.toml"


@cache
def load(name: str) -> Arm:
    """One of ``SPRINGS`` by its name."""
    raw = tomllib.loads(path_of(name).read_text(encoding="utf-8"))
    joints = raw["joint"]
    fixed = [_fixed(joint) for joint in joints]
    columns = tuple(joint["coordinate"] for joint in joints)
    limits = np.array([_si(joint["limits"]) for joint in joints], dtype=float)
    links = raw.get("link", [])
    couplings = [
        (
            np.array([sum(t["factor"] for t in one["terms"] if t["coordinate"] == c) for c in columns], dtype=float),
            float(_si(one["offset"])),
            *map(float, _si(one["limits"])),
        )
        for one in raw.get("coupling", [])
    ]
    return Arm(
        name=name,
        joints=tuple(joint["name"] for joint in joints),
        columns=columns,
        frames=np.array([frame for frame, _ in fixed]),
        about=np.array([axis for _, axis in fixed]),
        signs=np.array([joint.get("sign", 1) for joint in joints], dtype=float),
        offsets=np.array([_si(joint["offset"]) if "offset" in joint else 0 for joint in joints], dtype=float),
        low=limits[:, 0],
        high=limits[:, 1],
        flange=np.array(_si(raw["flange"]["xyz"])),
        tool=np.array(_si(raw["tool"]["xyz"])) if "tool" in raw else np.zeros(3),
        couplings=tuple(couplings),
        masses={link["body"]: float(_si(link["mass"])) for link in links} or FANUC_PARTS,
        links=tuple(Link(link["name"], link["body"], _section(link, raw["materials"])) for link in links),
        payload=GRAVITY * float(_si(raw["payload"])),
        springs=np.array(SPRINGS[name]),
        pin=np.array(_si(raw["parallelogram"]["pin"])) if "parallelogram" in raw else None,
    )


def model_text(arm: Arm, springs: dict[str, float]) -> str:
    """The description with these springs in N m/rad; a joint without one is rigid."""
    out: list[str] = []
    joint = ""
    for line in path_of(arm.name).read_text(encoding="utf-8").splitlines():
        if line.startswith("["):
            joint = "?" if line == "[[joint]]" else ""
        if joint and line.startswith("stiffness"):
            continue
        out.append(line)
        if joint and line.startswith("name"):
            joint = line.split('"')[1]
            if joint in springs:
                out.append(f'stiffness = {{ value = {springs[joint]:.6g}, unit = "N m/rad", source = "assumed" }}')
    return "\n".join(out) + "\n"
