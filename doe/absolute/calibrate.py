"""A calibration from absolute readings: estimate, what is identified, what is wrong, how well it predicts."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from doe.absolute.chain import flange_targets
from doe.absolute.fit import Fit, first_values, fit
from doe.absolute.gross import Gross, gross
from doe.absolute.identified import Curve, Finding, Open, curve_words, curves, findings, left_open, unread_words
from doe.absolute.known import known
from doe.absolute.prediction import Predicted, carried_over, folds, left_out, sessions_left_out
from doe.absolute.readings import AbsoluteReadings
from doe.absolute.start import Start, doubt, far_words, started
from doe.absolute.structure import Twin, twins
from doe.absolute.unknowns import USUAL, Layout, unknowns
from doe.absolute.weight import has_weight
from fem import ArmModel
from robots import InputError
from robots.arrays import Array, Bools
from robots.progress import Progress

FOLDS = 10
# Estimates that differ by no more than this share are the same.
ROUNDING = 1e-9


@dataclass(frozen=True)
class Positions:
    """A finished calibration from absolute readings.

    Figures of accuracy leave wrong readings aside, which are named instead. ``before``: frames and targets alone, with
    the arm as described; ``found``: with all that was freed; ``twins``: what no campaign could tell; ``findings``: what
    this one says of each unknown; ``open``: combinations that it leaves open; ``curves`` of the joints' errors;
    ``gross``: readings that are wrong; ``left_out``: readings predicted by those of other poses; ``sessions_out``: by
    those of other sessions, None with one session; ``holdout``: readings that were kept out, with the fit of their
    frames, None without any; ``unweighed``: springs were left out, for nothing is known that weighs.
    """

    before: Fit
    found: Fit
    twins: tuple[Twin, ...]
    findings: tuple[Finding, ...]
    open: tuple[Open, ...]
    curves: tuple[Curve, ...]
    gross: tuple[Gross, ...]
    left_out: Predicted
    sessions_out: Predicted | None
    holdout: tuple[AbsoluteReadings, Predicted, Fit] | None
    unweighed: bool

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
        robot, targets = self.found.model.robot, flange_targets(self.found.layout, self.found.u)
        described = np.linalg.norm(self.before.residual, axis=1)
        out = [
            *doubt(robot, described),
            *far_words(robot, self.found.data.target.names, targets),
            *spring_words(self),
            *(one.words for one in self.gross),
        ]
        out += curve_words(self.curves)
        out += [one.words for one in self.open]
        if self.holdout is not None:
            out += unread_words(self.curves, self.holdout[0].q)
        if not self.found.settled:
            out.append("the estimate had not come to rest: intervals may be too narrow; free less, or add readings")
        return tuple(out)

    def __getitem__(self, name: str) -> Finding:
        for one in self.findings:
            if one.name == name:
                return one
        raise InputError("parameter", code="B003", value=name, allowed=", ".join(one.name for one in self.findings))


def calibrate_positions(
    model: ArmModel,
    data: AbsoluteReadings,
    free: Sequence[str] | None = None,
    *,
    holdout: AbsoluteReadings | None = None,
    robust: bool = True,
    parts: int = FOLDS,
    seed: int = 0,
    progress: Progress | None = None,
) -> Positions:
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
            code="C004",
            value=", ".join(one.name for one in layout.unknowns if one.kind == "spring"),
            allowed="a model whose links declare masses, or readings with a payload (payload_kg)",
            remedy="add masses to the [[link]]s of the model file, or free no springs",
        )
    same = twins(model, data, layout, begin.nominal, seed)
    plain = Layout(tuple(one for one in layout.unknowns if one.kind in ("target", "rail")))
    before = fitted(model, data, plain, begin, robust=robust)
    found = fitted(model, data, layout, begin, same, robust=robust, progress=progress)
    wrong = gross(found)
    check_no_worse(before, found, wrong)
    predicted = left_out(found, folds(data, parts, seed))
    kept = None if holdout is None else (holdout, *carried_over(found, holdout, robust=robust))
    return Positions(
        before,
        found,
        same,
        findings(found),
        left_open(found),
        curves(found),
        wrong,
        predicted,
        sessions_left_out(found, parts, seed, robust=robust) if len(data.session.names) > 1 else None,
        kept,
        free is None and not weighs,
    )


def spring_words(c: Positions) -> Iterator[str]:
    """What whoever trusts springs that were found by weight must know, and why there are none."""
    found, names = c.found, c.found.model.robot.joint_names
    if c.unweighed:
        yield (
            "springs are left out: neither the model nor the table has masses. Give the [[link]]s of the model masses, "
            "or the readings a payload (payload_kg), and they are found too"
        )
    if found.layout.of("spring"):
        yield (
            "gravity is assumed to act along -z of the arm's base: for an arm on a wall, a ceiling or a tilted stand "
            "springs are wrong"
        )
    if not found.moving.of("spring"):
        return
    yield (
        "stiffnesses are only as right as the masses that load them: all masses a tenth too heavy make all "
        "stiffnesses a tenth too high; links count as rigid, their deflection is in the joints' springs"
    )
    curved = {index[0] for _, index in found.layout.of("periodic")}
    bare = [name for j, name in enumerate(names) if j not in curved and np.ptp(found.data.q[:, j]) > 0.0]
    if bare:
        yield (
            f"springs may contain error curves of {', '.join(bare)}, which are not free: such springs can fit these "
            "readings better and the next campaign worse. Free periodic as well, or check with --holdout"
        )
    for f in c.findings:
        if f.name.startswith("base.") and f.value is not None:
            yield (
                f"{f.name} is found from targets on the flange alone, where errors of joints look like a base that "
                "gives way: check it with targets on the base before you use it"
            )


def without_weight(names: Sequence[str]) -> tuple[str, ...]:
    """Names of groups but for springs, of which an arm without masses tells nothing."""
    return tuple(name for name in names if name != "springs")


def check_no_worse(before: Fit, after: Fit, wrong: Sequence[Gross]) -> None:
    """Raise InputError where an estimate misses the readings, wrong ones aside, by more than it did before.

    Where most readings count as wrong, it is the estimate that is.
    """
    rows = [one.row for one in wrong] if 2 * len(wrong) < len(after.data) else []
    first, last = (1e3 * float(np.sqrt(np.mean(np.delete(_square(f), rows)))) for f in (before, after))
    if last > (1.0 + ROUNDING) * first:
        raise InputError(
            "calibration: RMS of the readings",
            code="C008",
            value=f"{last:.6g} mm",
            allowed=f"{first:.6g} mm at most, as before: nothing is written",
            remedy="keep the model as it is, or free less (--free geometry) and add readings",
        )


def _square(f: Fit) -> Array:
    return np.asarray(np.sum(f.residual**2, axis=1))


def fitted(
    model: ArmModel,
    data: AbsoluteReadings,
    layout: Layout,
    begin: Start,
    same: Sequence[Twin] = (),
    *,
    robust: bool,
    progress: Progress | None = None,
) -> Fit:
    """The estimate, with what the model knows and what is not free held at what it is.

    Twins, of ``same``, are not free: they are held where the model has them, or where the start has found them.
    """
    free = layout.without([one.name for one in same])
    there = known(model, free.unknowns)
    for one, value in zip(layout.unknowns, first_values(layout, begin), strict=True):
        if one not in free.unknowns and value != one.start:
            there[replace(one, law="", sd=np.inf)] = float(value)
    held = np.array([*(np.nan for _ in free.unknowns), *there.values()])
    whole = Layout((*free.unknowns, *there))
    return fit(model, data, whole, begin, held=held, robust=robust, progress=progress)
