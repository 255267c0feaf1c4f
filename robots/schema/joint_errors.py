"""What positions told of an arm: by how much its joints and their frames are off, beside the geometry as described."""

from __future__ import annotations

from typing import Annotated, Self

import numpy as np
from pydantic import Field, model_validator

from robots.schema.quantities import Angle, Length, Number, Ratio, Strict

# Errors beyond these are no errors of that arm: a unit was mistaken, or the model is another arm's.
LARGEST_m, LARGEST_rad, LARGEST_SHARE, LARGEST_mrad = 0.5, 0.5, 0.5, 200.0
# Sines and cosines of higher orders are no error of a gear or an encoder's eccentric disc.
HIGHEST_ORDER = 400


class TurnsWith(Strict):
    """Another joint that this one turns with: its angle times ``factor`` is added."""

    joint: str
    factor: Ratio


class ErrorCurve(Strict):
    """A joint's error over its coordinate: ``sum_n sin_n sin(n q) + cos_n cos(n q)``, in mrad.

    ``identified_deg``: the angles between which readings tell it; beyond them it is unknown, of about ``height_mrad``.
    """

    sin_mrad: tuple[Number, ...] = Field(max_length=HIGHEST_ORDER)
    cos_mrad: tuple[Number, ...] = Field(max_length=HIGHEST_ORDER)
    identified_deg: tuple[tuple[Number, Number], ...]
    height_mrad: Annotated[Number, Field(ge=0.0)]
    source: str

    @model_validator(mode="after")
    def _shapes_agree(self) -> Self:
        if len(self.sin_mrad) != len(self.cos_mrad):
            raise ValueError("sin_mrad and cos_mrad need as many numbers, one for each order from 1 on")
        if any(abs(v) > LARGEST_mrad for v in (*self.sin_mrad, *self.cos_mrad)):
            raise ValueError(f"sin_mrad and cos_mrad must be at most {LARGEST_mrad:g} mrad in size")
        for low, high in self.identified_deg:
            if not low <= high:
                raise ValueError("identified_deg must be pairs [lower, upper] with lower up to upper")
        return self


class JointError(Strict):
    """By how much a joint is off what the rest of its table says.

    ``x``, ``y``, ``z``: its frame is moved in its own axes, z along the joint's axis; ``rx``, ``ry``: then turned, by
    the rotation vector (rx, ry, 0). ``ratio``: by how much more it turns than it says. Its zero is ``zero_error``.
    """

    x: Length | None = None
    y: Length | None = None
    z: Length | None = None
    rx: Angle | None = None
    ry: Angle | None = None
    ratio: Ratio | None = None
    turns_with: tuple[TurnsWith, ...] = ()
    curve: ErrorCurve | None = None

    @model_validator(mode="after")
    def _of_an_arm(self) -> Self:
        shares = [figure.si for figure in (self.ratio, *(one.factor for one in self.turns_with)) if figure is not None]
        for what, unit, most, values in (
            ("x, y and z", "m", LARGEST_m, [f.si for f in (self.x, self.y, self.z) if f is not None]),
            ("rx and ry", "rad", LARGEST_rad, [f.si for f in (self.rx, self.ry) if f is not None]),
            ("ratio and factors", "of a turn", LARGEST_SHARE, shares),
        ):
            if any(abs(v) > most for v in values):
                raise ValueError(
                    f"{what} must be at most {most:g} {unit} in size: errors, not the design's own figures"
                )
        return self


class Positions(Strict):
    """Where errors of the geometry came from: positions of targets, and how far off the arm was before and after.

    RMS of distances; ``left_out_rms_mm``: at readings predicted by the others. ``covariance`` of the ``parameters``
    beside curves, in SI (stiffnesses as compliances): what their doubt makes of a position.
    """

    data: str
    data_sha256: str
    before_rms_mm: float
    rms_mm: float
    left_out_rms_mm: float
    notes: tuple[str, ...] = ()
    parameters: tuple[str, ...] = ()
    covariance: tuple[tuple[Number, ...], ...] = ()

    @model_validator(mode="after")
    def _a_covariance(self) -> Self:
        p = len(self.parameters)
        if len(self.covariance) != p or any(len(row) != p for row in self.covariance):
            raise ValueError("covariance needs a row and a column for each of the parameters")
        V = np.array(self.covariance).reshape(p, p)
        size = np.sqrt(np.maximum(np.diag(V), 1e-300))
        if (
            not np.allclose(V, V.T, rtol=1e-6, atol=0.0)
            or np.linalg.eigvalsh(V / np.outer(size, size)).min(initial=0.0) < -1e-6
        ):
            raise ValueError("covariance must be symmetric, without negative variances")
        return self
