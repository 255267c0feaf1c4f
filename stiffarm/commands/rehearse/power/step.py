"""The step of a power analysis: every effect of the catalogue held against a planned sheet."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from doe.diagnosis.candidates import FITTED_ALREADY
from doe.power.chances import SPREAD, Chance, chances, smallest
from doe.power.planned import NORMAL95, Planned
from fem.arm import Arm
from fem.effects.base import EffectParameter
from rehearsal import Arm as WorldArm
from rehearsal.effects import DRAWS
from robots import InputError, require_one_of
from robots.progress import Progress, report_progress
from robots.schema.units import factor
from stiffarm.commands.rehearse.power.changes import by_catalogue, by_world, has_springs, planned
from stiffarm.commands.rehearse.power.more import one_more
from stiffarm.commands.rehearse.sheet import SetUps
from stiffarm.commands.rehearse.step import possible, prepared, set_ups_of

if TYPE_CHECKING:
    from stiffarm.commands.rehearse.command import RehearseRequest

# Usual sizes drawn of each effect, and where sheets are compared.
DRAWN: Final = 24
COMPARED: Final = 8
# Chi-square below which an effect of usual size moves no reading.
NOTHING: Final = 1e-3
# A twin takes the name from what is found where so much is lost.
LOST: Final = 0.25
# Poses below which nothing can be told from a set-up that is off.
FEWEST: Final = 2


@dataclass(frozen=True)
class Prospect:
    """What planned readings would show of one effect.

    ``smallest``: the size of its number ``parameter`` that is found with 80 % (of a stiffness the stiffest), in
    ``unit``, None where none is; ``usual``: the ends of its plausible range; ``found`` and ``named``: chances over
    usual sizes; ``chi2``: median of what a usual size shows; ``accuracy95``: half width of the 95 % interval of a usual
    size, as a share of it; ``twin``: what it would be mistaken for, if anything; ``why_not``: why nothing can be said;
    ``is_fitted``: it is a spring that a calibration fits anyway.
    """

    code: str
    words: str
    parameter: str
    unit: str
    usual: tuple[float, float] | None
    smallest: float | None
    is_stiffness: bool
    found: Chance
    named: Chance
    chi2: float
    accuracy95: float | None
    twin: str
    why_not: str | None
    by_rehearsal: bool
    is_fitted: bool = False

    @property
    def kind(self) -> str:
        """The effect without its place."""
        return self.code.partition(":")[0]


@dataclass(frozen=True)
class SpringProspect:
    """A spring that will be fitted: its stiffness as planned, N m/rad, and the ends of the 95 % interval to expect."""

    joint: str
    stiffness: float
    low: float
    high: float | None


@dataclass(frozen=True)
class Addition:
    """What one more set-up, load or repeat adds: readings, chances in the mean, and the effect that gains most."""

    what: str
    readings: int
    found: float
    named: float
    most: str
    most_gain: float


@dataclass(frozen=True)
class Power:
    """A power analysis.

    ``mean``: chances to be found and named in the mean over all effects that can be judged; ``assumed``: joints whose
    spring is the middle of the arm's class, for want of any in the model.
    """

    given: Arm
    set_ups: SetUps
    draws: int
    prospects: tuple[Prospect, ...]
    springs: tuple[SpringProspect, ...]
    additions: tuple[Addition, ...]
    mean: tuple[float, float]
    assumed: tuple[str, ...] = ()

    @property
    def judged(self) -> list[Prospect]:
        """Effects that the readings could show at all, most surely named first."""
        some = [p for p in self.prospects if p.why_not is None]
        return sorted(some, key=lambda p: (-p.named.value, -p.found.value, p.code))

    @property
    def readings(self) -> int:
        """Number of readings."""
        return self.set_ups.table.n


def power(
    given: Arm,
    asked: RehearseRequest,
    *,
    progress: Progress | None = None,
) -> Power:
    """What a sheet would show: a table's set-ups, the bundled table's, or a campaign.

    Raises
    ------
    InputError
        A model with effects or shell links, a sheet that does not fit or has one pose only, or fewer readings than
        springs.
    """
    world, draws = prepared(given), asked.draws or DRAWN
    set_ups = set_ups_of(given, world, asked)
    _refuse_few(set_ups)
    sheets = one_more(world, set_ups, asked.seed) if asked.one_more else {}
    steps = 3 + len(sheets)
    report_progress(progress, 0, steps)
    whole = _prospects(given, world, set_ups, draws, asked.seed, asked.effects)
    report_progress(progress, 3, steps)
    p, prospects, base = whole
    additions = []
    for k, (what, more) in enumerate(sheets.items(), start=4):
        after = _prospects(given, world, more, min(COMPARED, draws), asked.seed, asked.effects)[2]
        additions.append(_addition(what, more, base, after))
        report_progress(progress, k, steps)
    judged = [one for one in prospects if one.why_not is None]
    mean = tuple(
        float(np.mean([getattr(one, name).value for one in judged])) if judged else 0.0 for name in ("found", "named")
    )
    springs = tuple(_springs(p))
    assumed = () if has_springs(world) else tuple(s.joint for s in springs)
    return Power(given, set_ups, draws, tuple(prospects), springs, tuple(additions), (mean[0], mean[1]), assumed)


def _refuse_few(set_ups: SetUps) -> None:
    poses = len(set_ups.table.pose_groups())
    if poses < FEWEST:
        raise InputError(
            f"{set_ups.table.source}: poses",
            code="C003",
            value=poses,
            allowed=f"{FEWEST} or more",
            remedy="add set-ups: one pose tells nothing apart",
        )


def _prospects(
    given: Arm, world: WorldArm, set_ups: SetUps, draws: int, seed: int, codes: Sequence[str] | None
) -> tuple[Planned, list[Prospect], dict[str, tuple[float, float]]]:
    """Every effect of the catalogue against one sheet; by code its chances over the first :data:`COMPARED` draws."""
    p = planned(given, world, set_ups)
    hidden = [code for code in possible(given, world) if code.partition(":")[0] in DRAWS]
    for code in codes or ():
        require_one_of("effect", code, p.effects, code="M011", remedy="name effects that this arm can have")
    # Whether angles count from another zero is asked of a controller (`robots check`), not of a gauge.
    wanted = [code for code, effect in p.effects.items() if not effect.gross and (codes is None or code in codes)]
    changes, where, start = [], {}, 0
    for code in wanted:
        if code not in p.candidates:
            continue
        by = (
            by_world(given, world, set_ups, p, code, draws, seed)
            if code in hidden
            else (by_catalogue(p, code, draws, seed))
        )
        if by.shape[1]:
            where[code] = slice(start, start + by.shape[1])
            start += by.shape[1]
            changes.append(by)
    explained = p.explained(np.hstack(changes)) if changes else None
    out, means = [], dict[str, tuple[float, float]]()
    for code in wanted:
        if code not in where or explained is None:
            out.append(_none(p, code))
            continue
        mine = where[code]
        if np.median(explained.total[mine]) < NOTHING:
            out.append(_none(p, code))
            continue
        c = chances(p, code, explained, mine)
        size = smallest(p, code, explained, mine)
        found, named = (Chance.of(float(np.mean(x)), s) for x, s in zip((c.found, c.named), SPREAD, strict=True))
        chi2 = float(np.median(explained.total[mine]))
        rival, count = Counter(c.rival).most_common(1)[0]
        twin = rival if found.value - named.value > LOST and count * 2 >= len(c.rival) else ""
        out.append(_prospect(p, code, size, found, named, chi2, twin, code in hidden))
        means[code] = float(np.mean(c.found[:COMPARED])), float(np.mean(c.named[:COMPARED]))
    return p, out, means


def _prospect(
    p: Planned, code: str, size: float | None, found: Chance, named: Chance, chi2: float, twin: str, by_rehearsal: bool
) -> Prospect:
    effect = p.effects[code]
    q = effect.parameters[effect.amplitudes[0]] if effect.amplitudes else None
    return Prospect(
        code,
        effect.words,
        "" if q is None else q.name,
        "" if q is None else q.unit,
        None if q is None else (_shown(q, q.size[0]), _shown(q, q.size[1])),
        None if q is None or size is None else _shown(q, size),
        q is not None and q.scale == "compliance",
        found,
        named,
        chi2,
        NORMAL95 / float(np.sqrt(chi2)) if q is not None and chi2 > 0.0 else None,
        twin,
        None,
        by_rehearsal,
    )


def _shown(q: EffectParameter, size: float) -> float:
    return float(q.value(size) / factor(q.dimension, q.unit))


def _none(p: Planned, code: str) -> Prospect:
    why = p.why_not(code) or "no reading moves with it, or the springs take up all that it does"
    nothing = Chance(0.0, 0.0, 0.0)
    effect = p.effects[code]
    fitted = why == FITTED_ALREADY
    return Prospect(code, effect.words, "", "", None, None, False, nothing, nothing, 0.0, None, "", why, False, fitted)


def _springs(p: Planned) -> list[SpringProspect]:
    out = []
    for joint, k, sd in p.springs():
        half = NORMAL95 * sd
        out.append(SpringProspect(joint, k, k / (1.0 + half), k / (1.0 - half) if half < 1.0 else None))
    return out


def _addition(
    what: str, more: SetUps, before: Mapping[str, tuple[float, float]], after: Mapping[str, tuple[float, float]]
) -> Addition:
    """Chances with more, over the effects that either sheet can judge."""
    codes = sorted({*before, *after})
    gain = np.array([np.subtract(after.get(code, (0.0, 0.0)), before.get(code, (0.0, 0.0))) for code in codes])
    if not len(gain):
        return Addition(what, more.table.n, 0.0, 0.0, "", 0.0)
    top = int(gain[:, 1].argmax())
    found, named = gain.mean(axis=0).tolist()
    return Addition(what, more.table.n, found, named, codes[top], float(gain[top, 1]))
