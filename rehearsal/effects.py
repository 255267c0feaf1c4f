"""The hidden effects: which law each one has and how large it is, drawn within the catalogue's plausible ranges.

A code is ``kind`` or ``kind:where``. Each draw returns plain values for the key; ``law`` names the truth's law.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from rehearsal.arm import Arm


@dataclass(frozen=True)
class Context:
    """What a draw may depend on.

    ``upright``: of joint 2, rad, where the upper arm stands; sizes are those of arms of some 2 to 3 m reach under 500 N
    times ``stiff`` (stiffnesses and torques), ``heavy`` (forces) and ``long`` (lengths of the arm).
    """

    arm: Arm
    where: str
    rng: np.random.Generator
    torque: tuple[float, ...]  # N m, 80 % quantile of |torque| by joint at the largest load
    springs: tuple[float, ...]  # N m/rad as drawn, infinite where rigid
    upright: float
    wanted: str = ""  # law asked for, or none
    stiff: float = 1.0
    heavy: float = 1.0
    long: float = 1.0

    @property
    def joint(self) -> int:
        """Number of the joint where it sits, from 0."""
        return self.arm.index(self.where)

    @property
    def rigid(self) -> float:
        """Stiffnesses along a line are a torque's over a length squared."""
        return self.stiff / self.long**2

    def pick(self, *laws: str) -> str:
        """The law asked for, or one drawn with equal chance."""
        if self.wanted and self.wanted not in laws:
            raise ValueError(f"no law {self.wanted!r}; there are {laws}")
        drawn = laws[int(self.rng.integers(len(laws)))]
        return self.wanted or drawn

    def between(self, low: float, high: float) -> float:
        """Drawn uniformly."""
        return float(self.rng.uniform(low, high))

    def log(self, low: float, high: float) -> float:
        """Drawn uniformly in the logarithm."""
        return float(np.exp(self.rng.uniform(np.log(low), np.log(high))))

    def angle(self) -> float:
        """Any angle, rad."""
        return float(self.rng.uniform(-np.pi, np.pi))

    def sign(self) -> float:
        """Plus or minus one."""
        return float(self.rng.choice([-1.0, 1.0]))


Draw = Callable[[Context], dict[str, Any]]


def joint_compliance(c: Context) -> dict[str, Any]:
    """A spring where the model is rigid, its own if it has one."""
    low, high = (4e5, 2e6) if c.joint == 0 else (1e5, 1e6)
    own = c.springs[c.joint]
    k = own if np.isfinite(own) else c.log(low, high) * c.stiff
    return {"law": "linear", "k_Nm_per_rad": float(k)}


def joint_tilt(c: Context) -> dict[str, Any]:
    """Two stiffnesses across the axis, fixed in the housing."""
    k, ratio = c.log(5e5, 5e6) * c.stiff, c.log(1.2, 3)
    pair = [k, k * ratio] if c.rng.random() < 0.5 else [k * ratio, k]
    return {"law": "two-axes", "k_Nm_per_rad": pair}


def angle_dependent(c: Context) -> dict[str, Any]:
    """Three harmonics, a bump, or a triangle over the angle."""
    law = c.pick("harmonics", "bump", "triangle")
    total = c.between(0.10, 0.45)
    if law == "harmonics":
        share = np.array([1.0, c.between(0.2, 0.6), c.between(0.1, 0.3)])
        amplitudes = (total * share / share.sum()).tolist()
        return {"law": law, "amplitudes": amplitudes, "phases_rad": [c.angle() for _ in range(3)]}
    limits = 0.8 * c.arm.limits[c.joint]
    if law == "bump":
        width = float(c.between(0.15, 0.3) * (limits[1] - limits[0]))
        centre = c.between(float(limits[0]), float(limits[1]))
        return {"law": law, "amplitude": c.sign() * total, "centre_rad": centre, "width_rad": width}
    return {"law": law, "amplitude": total, "phase_rad": c.angle()}


def hardening(c: Context) -> dict[str, Any]:
    """Two kinks, or a power below one."""
    t = c.torque[c.joint]
    if c.pick("slopes", "power") == "slopes":
        breaks = [c.between(0.15, 0.35) * t, c.between(0.5, 0.8) * t]
        return {"law": "slopes", "factors": [1.0, c.between(0.55, 0.75), c.between(0.3, 0.5)], "breaks_Nm": breaks}
    return {"law": "power", "torque_Nm": t, "exponent": c.between(0.6, 0.85)}


def softening(c: Context) -> dict[str, Any]:
    """Two kinks, or a power of one and a half."""
    t = c.torque[c.joint]
    if c.pick("slopes", "growing") == "slopes":
        first = c.between(1.3, 1.8)
        breaks = [c.between(0.25, 0.5) * t, c.between(0.6, 0.85) * t]
        return {"law": "slopes", "factors": [1.0, first, first + c.between(0.2, 0.6)], "breaks_Nm": breaks}
    return {"law": "growing", "torque_Nm": t, "s": c.between(0.2, 0.7)}


def backlash(c: Context) -> dict[str, Any]:
    """A gap that is crossed in a straight line, from its middle or preloaded."""
    law = c.pick("kink", "kink", "preloaded") if not c.wanted else c.pick("kink", "preloaded")
    closing = c.between(0.02, 0.1) * c.torque[c.joint]
    preload = c.sign() * c.between(0.2, 0.8) * closing if law == "preloaded" else 0.0
    return {"law": law, "gap_rad": c.between(0.3e-3, 0.9e-3), "closing_Nm": closing, "preload_Nm": preload}


def friction(c: Context) -> dict[str, Any]:
    """One slider, three of them, or a loop by Bouc and Wen."""
    slip = c.between(60, 225) * c.stiff
    if c.joint > 2:  # the wrist's gears are smaller
        slip = c.between(0.1, 0.35) * c.torque[c.joint]
    law = c.pick("play", "jenkins", "bouc-wen")
    if law == "bouc-wen":
        return {"law": law, "slip_Nm": slip, "stuck_ratio": c.between(4, 12), "n": 1.6, "b": c.between(0.5, 0.8)}
    if law == "play":
        return {"law": law, "slip_Nm": [slip], "weights": [1.0], "stuck_share": c.between(0.0, 0.1)}
    slips = [0.4 * slip, slip, 1.6 * slip]
    return {"law": law, "slip_Nm": slips, "weights": [0.3, 0.4, 0.3], "stuck_share": c.between(0.05, 0.2)}


def payload(c: Context) -> dict[str, Any]:
    """A weight the sheet does not know, hung a little off the tool point."""
    at = [c.between(-0.08, 0.08) * c.long, c.between(-0.08, 0.08) * c.long, c.between(0.0, 0.05) * c.long]
    return {"law": "off-centre", "weight_N": c.between(20, 60) * c.heavy, "at_flange_m": at}


def gravity_compensator(c: Context) -> dict[str, Any]:
    """A tension spring between two pins beside joint 2."""
    a, b = c.between(0.25, 0.5), c.between(0.7, 1.0)
    shape = {"a_m": a, "b_m": b, "rest_m": c.between(0.5, 0.95) * (b - a), "top_rad": c.upright - np.pi}
    return {"law": "compensator", "share": c.between(0.10, 0.40), **shape}


def base_tilt(c: Context) -> dict[str, Any]:
    """Two stiffnesses about the base's x and y."""
    k, ratio = c.log(2e6, 4e7) * c.stiff, c.log(1.0, 3.0)
    pair = [k, k * ratio] if c.rng.random() < 0.5 else [k * ratio, k]
    return {"law": "two-axes", "k_Nm_per_rad": pair}


def base_vertical(c: Context) -> dict[str, Any]:
    """A contact that gets stiffer with the load."""
    return {"law": "contact", "k_N_per_m": c.log(2e6, 3e7) * c.rigid, "loss_at_1kN": c.between(0.1, 0.3)}


def parallelogram_bar(c: Context) -> dict[str, Any]:
    """A bar that gets stiffer with its force."""
    return {"law": "stiffening", "k_N_per_m": c.log(3e6, 3e7) * c.rigid, "loss_at_3kN": c.between(0.0, 0.25)}


def load_path(c: Context) -> dict[str, Any]:
    """The other way for the forearm's moment."""
    return {"law": "serial" if c.arm.parallelogram else "parallelogram"}


def link_flexibility(c: Context) -> dict[str, Any]:
    """A link softer than described, each mode by another share."""
    phi = c.between(0.3, 1.5)
    return {"law": "by-mode", "phi": phi, "modes": {"bending": phi, "shear": 2 * phi, "torsion": phi / 2, "axial": 0.0}}


def tool_compliance(c: Context) -> dict[str, Any]:
    """Soft across, not the same both ways, and ten times stiffer along."""
    per = c.between(1.5e-7, 6e-7) / c.rigid
    return {"law": "anisotropic", "c_m_per_N": [per, per * c.between(0.7, 1.3), 0.1 * per]}


def load_point_offset(c: Context) -> dict[str, Any]:
    """A point beside the tool point, fixed to the flange."""
    size, direction = c.between(0.015, 0.045) * c.long, c.angle()
    at = [size * np.cos(direction), size * np.sin(direction), c.sign() * c.between(0, 0.4) * size]
    return {"law": "flange-fixed", "at_flange_m": [float(v) for v in at]}


def load_misalignment(c: Context) -> dict[str, Any]:
    """Tilted by a fixed angle, the azimuth wandering a little with joint 1."""
    tilt = float(np.radians(c.between(1.5, 4.5)))
    return {"law": "wandering", "tilt_rad": tilt, "azimuth_rad": c.angle(), "per_q1": c.between(-0.2, 0.2)}


def joint_zero(c: Context) -> dict[str, Any]:
    """A zero that is off by up to 3 degrees."""
    return {"law": "exact-geometry", "zero_rad": float(c.sign() * np.radians(c.log(0.3, 3.0)))}


def gauge_zero(c: Context) -> dict[str, Any]:
    """The same on every reading, with a tenth of scatter between set-ups."""
    return {"law": "per-setup", "zero_m": c.sign() * c.between(15e-6, 45e-6), "scatter": 0.1}


def gauge_scale(c: Context) -> dict[str, Any]:
    """A gauge that reads too much or too little."""
    return {"law": "linear", "scale": c.sign() * c.between(0.02, 0.08)}


def drift(c: Context) -> dict[str, Any]:
    """Settling, or straight with a wave on it."""
    size = c.sign() * c.between(20e-6, 80e-6)
    if c.pick("exponential", "wiggly") == "exponential":
        return {"law": "exponential", "size_m": size, "T": c.between(0.15, 0.6)}
    return {"law": "wiggly", "size_m": size, "share": c.between(0.05, 0.15), "turns": c.between(1.5, 3)}


def gear_ripple(c: Context) -> dict[str, Any]:
    """A mesh with a second harmonic."""
    teeth = int(c.rng.choice([40, 59, 81, 105, 121, 141, 161, 171]))
    return {"law": "ripple", "amplitude": c.between(0.1, 0.3), "teeth": teeth, "phase_rad": c.angle()}


def wrist(dof: int) -> int:
    """Number, from 0, of the axis that turns the next one: the third last of six or more, the fourth of five."""
    return max(dof - 3, 3)


def wrist_coupling(c: Context) -> dict[str, Any]:
    """A torque about one wrist axis turns the other, not quite the same both ways."""
    first = wrist(c.arm.dof)
    size = c.sign() * c.between(0.3, 0.7) / np.sqrt(c.springs[first] * c.springs[first + 1])
    return {"law": "asymmetric", "per_Nm": [float(size), float(size * c.between(0.8, 1.2))]}


def turned_frame(c: Context) -> dict[str, Any]:
    """The frame of forces and displacements: levelled to a fraction of a degree, its azimuth set by hand."""
    turns = [c.between(-0.3, 0.3), c.between(-0.3, 0.3), c.sign() * c.between(1.0, 5.0)]
    return {"law": "exact-geometry", "turn_rad": [float(np.radians(v)) for v in turns]}


def tool_point_offset(c: Context) -> dict[str, Any]:
    """Loads act and displacements are read at another point of the flange than the sheet says."""
    at = c.rng.normal(size=3)
    at = c.between(0.015, 0.05) * c.long * at / np.linalg.norm(at)
    return {"law": "exact-geometry", "at_flange_m": [float(v) for v in at]}


def angle_sign(c: Context) -> dict[str, Any]:
    """The sheet's angle has the other sign."""
    return {"law": "exact-geometry"}


def angle_offset(c: Context) -> dict[str, Any]:
    """The sheet's angle counts from another zero, a quarter or half turn away."""
    return {"law": "exact-geometry", "offset_rad": float(c.rng.choice([-np.pi / 2, np.pi / 2, np.pi]))}


def angle_coupling(c: Context) -> dict[str, Any]:
    """The sheet's angle counts from the horizontal, not from the part before it."""
    return {"law": "exact-geometry", "share": c.sign()}


DRAWS: dict[str, Draw] = {
    "joint-compliance": joint_compliance,
    "joint-tilt": joint_tilt,
    "angle-dependent-stiffness": angle_dependent,
    "hardening": hardening,
    "softening": softening,
    "backlash": backlash,
    "friction": friction,
    "payload": payload,
    "gravity-compensator": gravity_compensator,
    "base-tilt": base_tilt,
    "base-vertical": base_vertical,
    "parallelogram-bar": parallelogram_bar,
    "load-path": load_path,
    "link-flexibility": link_flexibility,
    "tool-compliance": tool_compliance,
    "load-point-offset": load_point_offset,
    "load-misalignment": load_misalignment,
    "joint-zero-offset": joint_zero,
    "gauge-zero": gauge_zero,
    "gauge-scale": gauge_scale,
    "drift": drift,
    "gear-ripple": gear_ripple,
    "wrist-coupling": wrist_coupling,
    "turned-frame": turned_frame,
    "tool-point-offset": tool_point_offset,
    "angle-sign": angle_sign,
    "angle-offset": angle_offset,
    "angle-coupling": angle_coupling,
}
# Kinds that say how a joint twists under its torque, and kinds that multiply its compliance.
TORQUE_LAWS = ("hardening", "softening", "backlash", "friction")
FACTOR_LAWS = ("angle-dependent-stiffness", "gravity-compensator", "gear-ripple")
