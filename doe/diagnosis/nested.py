"""How well a diagnosis predicts poses that it has not seen: the whole of it, once for every part of the poses left out.

Poses left out one at a time with effects chosen on all of them flatter the choice. Here effects are chosen anew, and
all numbers fitted anew, on the poses of the other folds (Stone 1974, doi:10.1111/j.2517-6161.1974.tb00994.x; Varma and
Simon 2006, doi:10.1186/1471-2105-7-91).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from doe.certainty.folds import SPLIT, folds_of, pose_numbers
from doe.diagnosis.candidates import standing
from doe.diagnosis.checks import FEWEST
from doe.diagnosis.diagnose import diagnose
from doe.diagnosis.hypotheses import Options
from doe.diagnosis.setting import Setting, setting_of
from doe.estimation.problem import problem
from doe.tables.loaded import rms_mm
from doe.tables.measurements import Measurements
from fem.effects.situation import History
from robots import InputError
from robots.arrays import Array, Bools, Integers
from robots.progress import Messages, Progress

FOLDS = 5


@dataclass(frozen=True)
class Nested:
    """Errors (m,), read minus predicted, of poses that a fold had not seen; RMS of the translations in mm.

    ``fold`` (m,): in which fold a reading was left out; ``before``: springs alone, ``after``: with what each fold
    found, ``found`` its codes; ``counts`` (m,): readings in the RMS, odd ones are not.
    """

    fold: Integers
    before: Array
    after: Array
    component: Integers
    found: tuple[tuple[str, ...], ...]
    counts: Bools

    @property
    def folds(self) -> int:
        """How many folds there were."""
        return len(self.found)

    @property
    def chosen(self) -> dict[str, int]:
        """In how many folds each effect was found, the most frequent ones first."""
        codes = [code for some in self.found for code in some]
        return {code: codes.count(code) for code in sorted(dict.fromkeys(codes), key=lambda c: -codes.count(c))}

    @property
    def rms_before_mm(self) -> float:
        """RMS of the springs alone."""
        return rms_mm(self.before[self.counts], self.component[self.counts])

    @property
    def rms_after_mm(self) -> float:
        """RMS of the diagnosed models."""
        return rms_mm(self.after[self.counts], self.component[self.counts])


def check_folds(folds: int) -> None:
    """Raise InputError for a number of folds that leaves nothing to learn from."""
    if folds < 0 or folds == 1:
        raise InputError("folds", code="C003", value=folds, allowed="2 or more, 0 for none", remedy="5 is usual")


def why_not_nested(data: Measurements, folds: int) -> str | None:
    """Why there is no such figure for these readings; None if there can be one."""
    if folds == 0:
        return "no folds were asked for"
    poses = len(np.unique(pose_numbers(data.q)))
    return None if poses >= FEWEST else f"{poses} poses are too few to leave any out: {FEWEST} would do"


def nested(
    s: Setting,
    data: Measurements,
    options: Options = Options(),  # noqa: B008 - frozen
    *,
    folds: int = FOLDS,
    seed: int = 0,
    counts: Bools | None = None,
    progress: Messages | None = None,
    within: Progress | None = None,
) -> Nested:
    """Diagnose once for every fold, without its poses, and predict these.

    ``s``: the setting of all readings ``data``, of whose springs and accepted numbers nothing is taken over;
    ``folds``: into which the poses are split at random by ``seed``; fewer than ten poses are left
    out one at a time. ``counts`` (m,): readings that count, by default all.

    Raises
    ------
    InputError
        Too few poses (:func:`why_not_nested`).
    """
    check_folds(folds)
    reason = why_not_nested(data, folds)
    if reason is not None:
        raise InputError("folds", code="C003", value=folds, remedy=reason)
    say = progress or (lambda text: None)
    fold = folds_of(pose_numbers(data.q), folds, seed, SPLIT)
    row, component = np.nonzero(data.used)
    before, after = np.zeros(len(row)), np.zeros(len(row))
    found = []
    for k in range(int(fold.max()) + 1):
        unseen = fold == k
        codes, errors = _one(s, data, unseen, options, within)
        mine = unseen[row]
        before[mine], after[mine] = errors
        found.append(codes)
        say(f"fold {k + 1} of {int(fold.max()) + 1}: {', '.join(codes) or 'nothing found'}")
    good = np.ones(len(row), dtype=bool) if counts is None else counts
    return Nested(fold[row], before, after, component.astype(np.int64), tuple(found), good)


def _one(
    s: Setting, data: Measurements, unseen: Bools, options: Options, within: Progress | None
) -> tuple[tuple[str, ...], tuple[Array, Array]]:
    """What the poses seen ask for, and the errors of springs alone and of the diagnosed model at the others."""
    seen = data.select(~unseen)
    there = setting_of(
        s.description,
        s.model,
        seen,
        accepted=s.accepted,
        free=s.free,
        history=_part(s.history, ~unseen),
        known=s.known,
    )
    # What is not known of the order of all readings is not known of a part of them either.
    there = replace(there, history=replace(there.history, is_known=s.history.is_known))
    p = problem(s.model, data.select(unseen), ())
    there = replace(there, known=standing(there, p.free.at))
    d = diagnose(there, replace(options, for_record=False), within=within)
    codes = tuple(f.code for f in d.found)
    before, after = (
        replace(state.setting, data=p, history=_part(s.history, unseen), errors=np.zeros((len(p), 0))).residual
        for state in (d.before, d.after)
    )
    return codes, (before, after)


def _part(history: History, rows: Bools) -> History:
    return history.take(np.flatnonzero(rows).astype(np.intp))
