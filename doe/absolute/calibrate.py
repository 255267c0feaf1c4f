"""A calibration from absolute readings: estimate, what is identified, what is wrong, how well it predicts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from doe.absolute.fit import Fit, fit
from doe.absolute.gross import Gross, gross
from doe.absolute.identified import Curve, Finding, Open, curve_words, curves, findings, left_open, unread_words
from doe.absolute.known import known
from doe.absolute.prediction import Predicted, carried_over, folds, left_out
from doe.absolute.readings import AbsoluteReadings
from doe.absolute.start import Start, started
from doe.absolute.structure import Twin, twins
from doe.absolute.unknowns import USUAL, Layout, unknowns
from doe.absolute.weight import has_weight
from fem import ArmModel
from robots import InputError
from robots.arrays import Array, Bools
from robots.progress import Progress

FOLDS = 10
# Fewer readings than this are left out one by one.
FEW = 40


@dataclass(frozen=True)
class Positions:
    """A finished calibration from absolute readings.

    Figures of accuracy leave wrong readings aside, which are named instead. ``before``: frames and targets alone, with
    the arm as described; ``found``: with all that was freed; ``twins``: what no campaign could tell; ``findings``: what
    this one says of each unknown; ``open``: combinations that it leaves open; ``curves`` of the joints' errors;
    ``gross``: readings that are wrong; ``left_out``: readings predicted by the others; ``holdout``: readings that were
    kept out, with the fit of their frames, None without any.
    """

    before: Fit
    found: Fit
    twins: tuple[Twin, ...]
    findings: tuple[Finding, ...]
    open: tuple[Open, ...]
    curves: tuple[Curve, ...]
    gross: tuple[Gross, ...]
    left_out: Predicted
    holdout: tuple[AbsoluteReadings, Predicted, Fit] | None

    @property
    def right(self) -> Bools:
        """Which readings (n,) are not wrong."""
        out = np.ones(len(self.found.data), dtype=np.bool_)
        out[[one.row for one in self.gross]] = False
        return out

    def distances(self) -> dict[str, Array]:
        """Distances (m,) m of the readings that are not wrong: ``before``, ``after`` and ``left out``."""
        every = {"before": self.before.residual, "after": self.found.residual, "left out": self.left_out.error}
        return {name: np.linalg.norm(error[self.right], axis=1) for name, error in every.items()}

    @property
    def remarks(self) -> tuple[str, ...]:
        """What the reader must know, in words."""
        out = [*self.found.start.doubt(self.found.model.robot), *(one.words for one in self.gross)]
        out += curve_words(self.curves)
        out += [one.words for one in self.open]
        if self.holdout is not None:
            out += unread_words(self.curves, self.holdout[0].q)
        if not self.found.settled:
            out.append("the estimate had not come to rest: intervals may be too narrow; free less, or add readings")
        if any(one.kind == "spring" for one in self.found.moving.unknowns):
            out.append(
                "stiffnesses are only as right as the masses that load them: all masses a tenth too heavy make all "
                "stiffnesses a tenth too high; links count as rigid, their deflection is in the joints' springs"
            )
        return tuple(out)

    def __getitem__(self, name: str) -> Finding:
        for one in self.findings:
            if one.name == name:
                return one
        raise InputError("parameter", value=name, allowed=", ".join(one.name for one in self.findings))


def calibrate_positions(
    model: ArmModel, data: AbsoluteReadings, free: Sequence[str] | None = None, *,
    holdout: AbsoluteReadings | None = None, robust: bool = True, parts: int = FOLDS, seed: int = 0,
    progress: Progress | None = None,
) -> Positions:  # fmt: skip
    """Estimate frames and what is ``free`` (:mod:`doe.absolute.unknowns`; usual: geometry, springs, periodic, rail).

    Springs need masses: where the model declares none and no payload hangs, they are left out of the usual ones.

    Raises
    ------
    InputError
        An unknown name, springs asked for without any weight, or too few readings.
    """
    weighs = has_weight(model, data.payloads)
    usual = USUAL if weighs else without_weight(USUAL)
    names = list(usual if free is None else free)
    begin = started(model.robot, data, seed)
    layout = Layout(unknowns(model.robot, data, names))
    if not weighs and layout.of("spring"):
        raise InputError(
            f"springs of {model.robot.name} under its own weight",
            value=", ".join(one.name for one in layout.unknowns if one.kind == "spring"),
            allowed="a model whose links declare masses, or readings with a payload (payload_kg)",
            remedy="add masses to the [[link]]s of the model file, or free no springs",
        )
    same = twins(model, data, layout, begin.nominal, seed)
    layout = layout.without([one.name for one in same])
    plain = Layout(tuple(unknowns(model.robot, data, _rail(data))))
    before = fitted(model, data, plain, begin, robust=robust)
    found = fitted(model, data, layout, begin, robust=robust, progress=progress)
    predicted = left_out(found, folds(len(data), len(data) if len(data) < FEW else parts, seed))
    kept = None if holdout is None else (holdout, *carried_over(found, holdout, robust=robust))
    return Positions(
        before, found, same, findings(found), left_open(found), curves(found), gross(found), predicted, kept
    )  # fmt: skip


def without_weight(names: Sequence[str]) -> tuple[str, ...]:
    """Names of groups but for springs, of which an arm without masses tells nothing."""
    return tuple(name for name in names if name != "springs")


def fitted(
    model: ArmModel, data: AbsoluteReadings, layout: Layout, begin: Start, *, robust: bool,
    progress: Progress | None = None,
) -> Fit:  # fmt: skip
    """The estimate, with what the model knows and what is not free held at what it is."""
    there = known(model, layout.unknowns)
    held = np.array([*(np.nan for _ in layout.unknowns), *there.values()])
    whole = Layout((*layout.unknowns, *there))
    return fit(model, data, whole, begin, held=held, robust=robust, progress=progress)


def _rail(data: AbsoluteReadings) -> tuple[str, ...]:
    return ("rail",) if data.has_rail else ()
