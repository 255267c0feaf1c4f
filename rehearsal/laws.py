"""Twist of a joint under the history of its torque: the truth's laws, none of them a smooth textbook form.

``tau`` is (cycles, m) N m, the torque from the unloaded arm's zero on, one row a cycle in the order of time;
``c`` (cycles, 1) rad/(N m) the joint's own compliance. Each returns (cycles, m) rad.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from robots.arrays import Array


def linear(tau: Array, c: Array, p: dict[str, Any]) -> Array:
    """A spring."""
    return c * tau


def slopes(tau: Array, c: Array, p: dict[str, Any]) -> Array:
    """Piecewise straight: compliance c * factors[k] between the torques ``breaks`` (kinks)."""
    size, theta, low = np.abs(tau), np.zeros_like(tau), 0.0
    for factor, high in zip(p["factors"], [*p["breaks_Nm"], np.inf], strict=True):
        theta += factor * np.clip(size - low, 0, high - low)
        low = high
    return c * np.sign(tau) * theta


def power(tau: Array, c: Array, p: dict[str, Any]) -> Array:
    """C t0 (|tau| / t0)^exponent: below one it hardens, above it softens."""
    t0 = p["torque_Nm"]
    return np.asarray(c * t0 * np.sign(tau) * (np.abs(tau) / t0) ** p["exponent"])


def growing(tau: Array, c: Array, p: dict[str, Any]) -> Array:
    """C tau (1 + s (|tau| / t0)^1.5)."""
    return np.asarray(c * tau * (1 + p["s"] * (np.abs(tau) / p["torque_Nm"]) ** 1.5))


def gap(tau: Array, c: Array, p: dict[str, Any]) -> Array:
    """Backlash: the flank is crossed in a straight line over the torque ``closing_Nm``, then the spring works on.

    ``preload_Nm`` shifts the rest position into the gap; the zero is the arm at rest.
    """
    t0, rest = p["closing_Nm"], p["preload_Nm"]
    return np.asarray(c * tau + p["gap_rad"] * (np.clip((tau + rest) / t0, -1, 1) - np.clip(rest / t0, -1, 1)))


def play(tau: Array, c: Array, p: dict[str, Any]) -> Array:
    """Coulomb friction in series: each slider follows the torque at a distance of its own slip torque.

    One slider without a stuck share is the play operator; several are a Jenkins series (Prandtl-Ishlinskii).
    """
    theta = p["stuck_share"] * tau
    for slip, weight in zip(p["slip_Nm"], p["weights"], strict=True):
        at = np.zeros(len(tau))
        for k in range(tau.shape[1]):
            at = np.clip(at, tau[:, k] - slip, tau[:, k] + slip)
            theta[:, k] += (1 - p["stuck_share"]) * weight * at
    return np.asarray(c * theta)


def bouc_wen(tau: Array, c: Array, p: dict[str, Any]) -> Array:
    """Tau = theta / c + z with dz = kz (1 - |z/zs|^n (b sign(z dtheta) + 1 - b)) dtheta, driven by the torque."""
    kz = p["stuck_ratio"] / c[:, 0]
    z, theta, at = np.zeros(len(tau)), np.zeros(len(tau)), np.zeros(len(tau))
    out = np.zeros_like(tau)
    steps = 60
    for k in range(tau.shape[1]):
        step = (tau[:, k] - at) / steps
        for _ in range(steps):
            # z dtheta has the sign of z dtau while the tangent is positive.
            sign = np.sign(z * step)
            bent = np.minimum(np.abs(z) / p["slip_Nm"], 1.0) ** p["n"]
            tangent = np.maximum(kz * (1 - bent * (p["b"] * sign + 1 - p["b"])), 0.0)
            move = step / (1 / c[:, 0] + tangent)
            z = np.clip(z + tangent * move, -p["slip_Nm"], p["slip_Nm"])
            theta = theta + move
        at = tau[:, k]
        out[:, k] = theta
    return out


LAWS = {
    "linear": linear,
    "slopes": slopes,
    "power": power,
    "growing": growing,
    "gap": gap,
    "play": play,
    "bouc-wen": bouc_wen,
}


def harmonics(q: Array, p: dict[str, Any]) -> Array:
    """1 + sum a_k cos(k q - phase_k), k from one."""
    total = np.ones_like(q)
    for k, (a, phase) in enumerate(zip(p["amplitudes"], p["phases_rad"], strict=True), start=1):
        total += a * np.cos(k * q - phase)
    return total


def bump(q: Array, p: dict[str, Any]) -> Array:
    """1 + a exp(-(q - q0)^2 / (2 width^2))."""
    return np.asarray(1 + p["amplitude"] * np.exp(-((q - p["centre_rad"]) ** 2) / (2 * p["width_rad"] ** 2)))


def triangle(q: Array, p: dict[str, Any]) -> Array:
    """1 + a times a triangular wave of one period a turn."""
    return np.asarray(1 + p["amplitude"] * 2 / np.pi * np.arcsin(np.sin(q - p["phase_rad"])))


def ripple(q: Array, p: dict[str, Any]) -> Array:
    """1 + A (sin(N q + phase) + 0.25 sin(2 N q)): mesh stiffness with a second harmonic."""
    N = p["teeth"]
    return np.asarray(1 + p["amplitude"] * (np.sin(N * q + p["phase_rad"]) + 0.25 * np.sin(2 * N * q)))


def compensator(q: Array, p: dict[str, Any]) -> Array:
    """Compliance factor 1 / (1 + s g(q)), g the stiffness of a tension spring between two pins (1 at its largest).

    Pins at distances a (on the upper arm) and b (on the carousel) from joint 2's axis, rest length l0.
    """

    def stiffness(angle: Array) -> Array:
        a, b, l0 = p["a_m"], p["b_m"], p["rest_m"]
        length = np.sqrt(a**2 + b**2 + 2 * a * b * np.cos(angle))
        # Energy k (l - l0)^2 / 2, differentiated twice; up to the factor k.
        first = -a * b * np.sin(angle) / length
        second = -a * b * np.cos(angle) / length - first**2 / length
        return np.asarray(first**2 + (length - l0) * second)

    scale = np.abs(stiffness(np.linspace(-np.pi, np.pi, 721))).max()
    return np.asarray(1 / (1 + p["share"] * stiffness(q - p["top_rad"]) / scale))


FACTORS = {
    "harmonics": harmonics,
    "bump": bump,
    "triangle": triangle,
    "ripple": ripple,
    "compensator": compensator,
}
