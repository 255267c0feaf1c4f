"""How well a calibration predicts: each pose from all the others, and poses kept out of it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from doe import Measurements
from doe.calibration.run import Calibration, run_campaign
from doe.certainty.left_out import moving_with
from doe.certainty.predictive import Coverage, half_width95
from doe.certainty.uncertainty import null_directions
from doe.estimation.campaign import Campaign
from doe.estimation.estimate import Estimate
from doe.estimation.problem import Problem, problem
from doe.tables.loaded import history_of, rms_mm
from fem import ArmModel
from fem.effects import History, Maker, PlacedEffect
from robots import InputError, ModelDescription
from robots.arrays import Array
from robots.progress import Progress

# Angles this far (deg) beyond a law's range are beyond it, less is rounding.
_ROUNDING_DEG = 1e-6


@dataclass(frozen=True)
class Holdout:
    """Readings kept out of the calibration: ``error`` (m,) read minus predicted, NaN at poses in ``blind``.

    ``expected`` (m,): standard deviation by the noise found, ``half_width95`` (m,) of the prediction's interval, both
    NaN where studies pose by pose found no noise; ``blind``: why the calibrated model cannot predict a pose;
    ``beyond``: poses outside the angles that its laws were made for.
    """

    data: Measurements
    system: Problem
    error: Array
    expected: Array
    half_width95: Array
    blind: dict[str, str]
    beyond: tuple[str, ...]

    @property
    def rms_mm(self) -> float:
        """RMS error of the translations predicted."""
        known = ~np.isnan(self.error)
        return rms_mm(self.error[known], self.system.component[known])

    @property
    def coverage(self) -> Coverage:
        """How many of the readings predicted lie in their intervals."""
        return Coverage.of(self.error, self.half_width95)


def left_out(
    description: ModelDescription,
    build: Callable[[ModelDescription], ArmModel],
    used: Measurements,
    campaign: Campaign,
    found: Calibration,
    count: Progress | None,
    own: Sequence[Maker] = (),
    history: History | None = None,
    spacing: str = "log",
) -> tuple[Array, Array, dict[str, str]]:
    """Errors (m,) of each pose predicted by all stages run again without it, and half widths (m,) of their intervals.

    The third value: why poses are not predicted. ``history`` of the readings ``used``.
    """
    whole, labels, history = found.overall, np.array(used.pose, dtype=str), history or history_of(used)
    error, half, reasons = np.full(len(whole), np.nan), np.full(len(whole), np.nan), dict[str, str]()
    for k, label in enumerate(whole.poses):
        if count is not None:
            count(k, len(whole.poses))
        fewer = [s.model_copy(update={"poses": tuple(q for q in s.poses if q != label)}) for s in campaign.stage]
        lost = [a.name for a, b in zip(campaign.stage, fewer, strict=True) if a.poses and not b.poses]
        if lost:
            reasons[label] = f"stage {lost[0]} has no other pose"
            continue
        without = campaign.model_copy(update={"stage": tuple(fewer)})
        try:
            then = history.take(np.flatnonzero(labels != label))
            rest = run_campaign(
                description, build, used.select(labels != label), without, own=own, history=then, spacing=spacing
            )
        except InputError as reason:
            reasons[label] = reason.prose
            continue
        mine = used.select(labels == label)
        blind = _blind(rest, mine)
        if blind:
            reasons[label] = f"without pose {label} the readings do not determine {', '.join(blind)}"
            continue
        then = history.take(np.flatnonzero(labels == label))
        error[whole.pose == k], system = prediction_error(rest.model, mine, rest.effects, then)
        half[whole.pose == k] = _half_widths(rest, mine, system)
    return error, half, reasons


def _half_widths(found: Calibration, data: Measurements, system: Problem) -> Array:
    """Half widths (m,) of the 95 % intervals of readings ``data`` predicted by a calibration; NaN without a noise.

    Of several stages each adds what its parameters' covariance makes of the readings, and the last one's noise counts.
    """
    if not found.stages:
        return np.full(len(system), np.nan)
    parts, J = np.zeros(len(system)), np.zeros((len(system), 0))
    for stage in found.stages:
        J = _derivatives(stage.estimate, data)
        parts += np.einsum("ni,ij,nj->n", J, stage.certainty.covariance, J)
    last = found.stages[-1]
    f = system.evaluate(np.zeros(0))[0]
    return half_width95(last.estimate, system, f, parts, last.certainty.covariance, J)


def _derivatives(e: Estimate, data: Measurements) -> Array:
    """Derivatives (m, p) of readings ``data`` by the variables of an estimate."""
    free = e.problem.free
    return problem(free.model, data, free.parameters, free.laws, free.walls, free.effects).evaluate(e.u)[1]


def prediction_error(
    model: ArmModel, data: Measurements, effects: Sequence[PlacedEffect] = (), history: History | None = None
) -> tuple[Array, Problem]:
    """Errors (m,) read minus predicted of all readings, and the readings; ``history``: by default the table's."""
    system = problem(model, data, (), effects=effects, history=history)
    return system.value - system.evaluate(np.zeros(0))[0], system


def _blind(found: Calibration, data: Measurements) -> list[str]:
    """Numbers that no stage determined and that readings of ``data`` move with."""
    out: list[str] = []
    for stage in found.stages:
        e = stage.estimate
        out += moving_with(e.problem, _derivatives(e, data), e.seen, null_directions(e.rows, e.seen))
    return out


def held_out(found: Calibration, data: Measurements) -> Holdout:
    """Predict readings that the calibration has not seen; poses that hang on what it does not determine are named."""
    error, system = prediction_error(found.model, data, found.effects)
    blind = {}
    for k, label in enumerate(system.poses):
        names = _blind(found, data.select(np.array(data.pose, dtype=str) == label))
        if names:
            blind[label] = f"the calibration does not determine {', '.join(names)}"
            error[system.pose == k] = np.nan
    expected = np.full(len(system), np.nan)
    if found.stages:
        expected = found.stages[-1].estimate.noise.spread(system, system.evaluate(np.zeros(0))[0])
    half = _half_widths(found, data, system)
    return Holdout(data, system, error, expected, half, blind, _beyond(found, data))


def _beyond(found: Calibration, data: Measurements) -> tuple[str, ...]:
    """Poses with angles that a law put through springs pose by pose was not made for."""
    out = np.zeros(data.n, dtype=np.bool_)
    for law in (law for s in found.studies for law in s.laws.values()):
        columns = [found.model.robot.coordinate_index(name) for name in law.inputs]
        off = np.abs(np.degrees(data.q[:, columns]) - np.array(law.centre_deg))
        out |= (off > np.array(law.half_range_deg) + _ROUNDING_DEG).any(axis=1)
    return tuple(dict.fromkeys(label for label, far in zip(data.pose, out, strict=True) if far))
