"""Calibration: parameters of an arm from readings, with their intervals, and the calibrated arm."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from doe.certainty.uncertainty import ParameterEstimate
from robots import InputError
from stiffarm.face.arms import Arm, Picture, as_face
from stiffarm.face.calls import called, numbers, words_of
from stiffarm.face.readings import AnyReadings, table_of
from stiffarm.face.shown import Shown, frame
from stiffarm.session.words.loads import loads_words

if TYPE_CHECKING:
    import pandas as pd

    from doe.certainty.doubts import Doubt
    from stiffarm.commands.calibrate.step import Calibrated


@dataclass(frozen=True)
class Identified:
    """A parameter with what the readings say about it.

    ``value`` in ``unit``, None where it is not identified or stands at a bound; ``interval95``: its 95 % interval in
    the same unit, inf where the readings do not exclude a rigid part, NaN where nothing can be said; ``status``:
    "determined", "one-sided", "at bound" or "not identified"; of springs at one pose (the staged scheme, whose laws
    go through them) "matched" or "not matched", without an interval.
    """

    name: str
    value: float | None
    unit: str
    interval95: tuple[float, float]
    status: str


@dataclass(frozen=True, repr=False)
class Calibration(Shown):
    """A finished calibration. ``calibration["j2.stiffness"]`` is one of its parameters.

    ``arm``: the calibrated arm; ``rms_mm``: what it leaves of the readings; ``left_out_rms_mm``: the error at poses
    predicted by a calibration that has not seen them; ``holdout_rms_mm``: at readings kept out, None without any;
    ``free``, ``at_bound``, ``identified``: how many parameters were free, stand at a bound, are identified;
    ``remarks``: what the reader must know. ``found`` has everything else.
    """

    arm: Arm
    parameters: tuple[Identified, ...]
    rms_mm: float
    left_out_rms_mm: float
    holdout_rms_mm: float | None
    remarks: tuple[str, ...]
    found: Calibrated

    @property
    def loads_N(self) -> tuple[float, ...]:  # noqa: N802 - the unit as the shop writes it
        """Loads of the readings used, each once."""
        return self.found.data.levels_N

    @property
    def free(self) -> int:
        """How many parameters were free."""
        return self.found.found.count.free

    @property
    def at_bound(self) -> int:
        """How many parameters stand at an end of their range."""
        return self.found.found.count.at_bound

    @property
    def doubts(self) -> tuple[Doubt, ...]:
        """What the readings say against it: each with ``code``, ``words`` and ``p_value``; the words are remarks."""
        return self.found.doubts

    @property
    def identified(self) -> int:
        """How many parameters the readings determine, at least from one side."""
        return self.found.found.count.identified

    def __getitem__(self, name: str) -> Identified:
        for parameter in self.parameters:
            if parameter.name == name:
                return parameter
        raise InputError("parameter", code="B003", value=name, allowed=", ".join(p.name for p in self.parameters))

    def title(self) -> str:
        """Robot, errors, and how many parameters were free, at a bound and identified."""
        return (
            f"Calibration of {self.arm.name} under {loads_words(self.loads_N)}: RMS {self.rms_mm:.4f} mm, poses left "
            f"out {self.left_out_rms_mm:.4f} mm; {self.free} parameters free, {self.at_bound} at a bound, "
            f"{self.identified} identified"
        )

    def to_frame(self) -> pd.DataFrame:
        """One row a parameter: name, value, unit, ends of the 95 % interval, status."""
        return frame(
            {
                "parameter": [p.name for p in self.parameters],
                "value": [float("nan") if p.value is None else p.value for p in self.parameters],
                "unit": [p.unit for p in self.parameters],
                "low95": [p.interval95[0] for p in self.parameters],
                "high95": [p.interval95[1] for p in self.parameters],
                "status": [p.status for p in self.parameters],
            }
        )

    def plot(self, file: str | Path | None = None) -> Picture:
        """Draw the intervals of the parameters; ``file``: a PNG to write."""
        from stiffarm.commands.calibrate.figures.identifiability import intervals_figure

        if not self.found.stages:
            raise InputError(
                "plot of springs pose by pose", code="B003", allowed="a calibration with intervals: scheme='global'"
            )
        return Picture.of(intervals_figure({"": self.found.stages[-1].result.certainty.estimates})).kept(file)


def calibrate(
    arm: Arm,
    readings: AnyReadings,
    *,
    free: Sequence[str] | str | None = None,
    scheme: Literal["staged", "global"] | None = None,
    campaign: str | Path | None = None,
    loads_N: Sequence[float] | float | None = None,
    holdout: AnyReadings | None = None,
    robust: bool = True,
    bootstrap: int = 0,
    seed: int = 0,
) -> Calibration:
    """Find parameters of an arm from measured deflections.

    Parameters
    ----------
    arm : the arm before; it is not changed
    readings : measured deflections (:func:`stiffarm.read_readings`)
    free : names of the free parameters, as "j2.stiffness" or "base.ry"
    scheme : "staged", the published scheme, or "global", all parameters at once; default: staged where a scheme is
        bundled with the robot and neither ``free`` nor ``campaign`` is given
    campaign : a calibration TOML instead of ``free``
    loads_N : load magnitudes to use, N, all if empty; default: those of the robot's scheme for its bundled readings,
        else all
    holdout : readings that the calibration does not see, to judge it by
    robust : outliers lose weight
    bootstrap : how often to draw poses with replacement
    seed : of the random numbers

    Raises
    ------
    InputError
        Readings that tell nothing or are too few, or a parameter that the arm does not have.

    Examples
    --------
    >>> import stiffarm as sa
    >>> arm = sa.load("xr701")
    >>> data = sa.read_readings(sa.bundled("xr701"), arm)
    >>> cal = sa.calibrate(arm, data, free=["j2.stiffness", "j3.stiffness"])
    >>> cal["j2.stiffness"].status
    'determined'
    """
    from stiffarm.commands.calibrate import general, step

    if campaign is not None and free is not None:
        raise InputError("free and campaign: one of them at a time", code="B003", remedy="leave one of them out")
    names = words_of(free, "free")
    file = None if campaign is None else Path(campaign)
    loads = numbers(loads_N, "loads_N")
    with called():
        staged = general.is_staged(scheme, arm, None, named=names is not None or file is not None)
        table = table_of(readings, arm)
        plan = general.plan_of(arm, table, None, staged=staged)
        options = general.Options(
            free=names,
            campaign=file,
            loads=loads,
            staged=staged,
            robust=robust,
            bootstrap=bootstrap,
            seed=seed,
            diagnose="stiffarm.diagnose(arm, readings)",
        )
        request = general.request_of(arm, table, plan, options)
        found = step.calibrate(arm, table, request, holdout=None if holdout is None else table_of(holdout, arm))
        made = arm.of(found.description, arm.model.link_kind, arm.model.load_path, arm.own)
    estimates = [e for s in found.found.stages for e in s.certainty.estimates]
    parameters = (*_at_poses(found), *map(_identified, estimates))
    return Calibration(
        as_face(made),
        parameters,
        found.found.rms_mm,
        found.left_out_rms_mm,
        None if found.holdout is None else found.holdout.rms_mm,
        found.remarks,
        found,
    )


def _identified(e: ParameterEstimate) -> Identified:
    value = e.value if e.status in ("determined", "one-sided") else None
    return Identified(e.parameter.name, value, e.parameter.unit, e.interval, e.status)


def _at_poses(found: Calibrated) -> Iterator[Identified]:
    """Springs of the staged scheme's studies, pose by pose."""
    for fit in (fit for study in found.found.studies for fit in study.fits):
        for joint, stiffness in zip(fit.joints, fit.stiffness, strict=True):
            status = "matched" if fit.matched else "not matched"
            name = f"{joint}.stiffness at pose {fit.pose}"
            yield Identified(name, float(stiffness), "N m/rad", (math.nan, math.nan), status)
