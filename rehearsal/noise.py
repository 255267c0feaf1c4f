"""Gauge and set-up: how exact readings become what the sheet holds, and the covariance that belongs to it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rehearsal.readings import Readings
from robots.arrays import Array, Bools


@dataclass(frozen=True)
class Noise:
    """White noise sqrt((share d)^2 + floor^2), rounding, and one factor 1 + N(0, setup) a set-up.

    ``floor_m``: one for all, or (n, 1) for each reading.
    """

    share: float
    floor_m: float | Array
    resolution_m: float
    setup: float

    def read(self, r: Readings, exact: Array, rng: np.random.Generator) -> Array:
        """Readings (n, 3) in m."""
        scale = 1 + self.setup * rng.normal(size=r.setup.max() + 1)
        d = exact * scale[r.setup][:, None]
        d = d + rng.normal(size=d.shape) * np.hypot(self.share * exact, self.floor_m)
        return np.asarray(np.round(d / self.resolution_m) * self.resolution_m if self.resolution_m > 0 else d)

    def whiten(self, r: Readings, exact: Array, columns: Array, read: Bools | None = None) -> Array:
        """V^-1/2 times ``columns`` (n, a, m) for readings (n, a) of the axes that were read; rows flattened.

        V of one set-up is diagonal plus setup^2 d d^T, so its root is a rank-one change of the diagonal's.
        ``read`` (n, a): what was read, if not all.
        """
        sd = np.sqrt((self.share * exact) ** 2 + self.floor_m**2 + self.resolution_m**2 / 12)
        # A set without any noise (for tests) is weighed as by a perfect gauge of a tenth of a micrometre.
        sd = np.maximum(sd, 1e-7)
        if read is not None:
            sd = np.where(read, sd, np.inf)
        out = columns / sd[:, :, None]
        if self.setup > 0:
            u = exact / sd * self.setup
            count = r.setup.max() + 1
            size = np.zeros(count)
            np.add.at(size, r.setup, (u**2).sum(1))
            # (I + u u^T)^-1/2 = I - (1 - 1 / sqrt(1 + |u|^2)) u u^T / |u|^2
            part = np.zeros((count, columns.shape[2]))
            np.add.at(part, r.setup, np.einsum("na,nam->nm", u, out))
            gain = (1 - 1 / np.sqrt(1 + size)) / np.maximum(size, 1e-30)
            out = out - u[:, :, None] * (gain[:, None] * part)[r.setup][:, None, :]
        return out.reshape(-1, columns.shape[2])
