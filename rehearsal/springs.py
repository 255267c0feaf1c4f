"""Springs of a model file that vary with joint angles."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rehearsal.arm import Arm
from robots.arrays import Array
from robots.schema.springs import LogFourierLaw, LogPolynomialLaw, SpringLawTable


def stiffness_at(law: SpringLawTable, coordinates: Sequence[str], q: Array) -> Array:
    """Stiffness (m,) of a law, N m/rad (of a bearing's translations N/m), at poses q (m, n) rad."""
    if isinstance(law, LogPolynomialLaw):
        columns = [coordinates.index(name) for name in law.inputs]
        u = (np.degrees(q[:, columns]) - np.array(law.centre_deg)) / np.array(law.half_range_deg)
        log = sum(
            c * np.prod(u ** np.array(powers), axis=1)
            for c, powers in zip(law.coefficients, law.exponents, strict=True)
        )
        return np.asarray(np.exp(log * np.ones(len(q))))
    angle = q[:, coordinates.index(law.input)]
    if isinstance(law, LogFourierLaw):
        log = np.full(len(q), law.coefficients[0])
        for m, (a, b) in enumerate(zip(law.coefficients[1::2], law.coefficients[2::2], strict=True), start=1):
            log = log + a * np.cos(m * angle) + b * np.sin(m * angle)
        return np.asarray(np.exp(log))
    nodes = np.log(law.stiffness_Nm_per_rad)
    return np.asarray(np.exp(np.interp(np.degrees(angle), law.nodes_deg, nodes)))


def shapes(arm: Arm, q: Array) -> Array:
    """Factors (m, n) on the joints' compliances by the model's own laws, 1 where a spring is constant."""
    out = np.ones(q.shape)
    for j, law in enumerate(arm.laws):
        own = arm.stiffness[j]
        if law is not None and own is not None:
            out[:, j] = own / stiffness_at(law, arm.coordinates, q)
    return out
