"""The step `diagnose`: what a model is missing by some readings, and the model with it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from doe import Measurements, select_loads
from doe.calibration.run import refuse_cut_cycles
from doe.certainty.doubts import Doubt
from doe.diagnosis.candidates import standing
from doe.diagnosis.diagnose import Diagnosis, Found, without_harm
from doe.diagnosis.diagnose import diagnose as find_missing
from doe.diagnosis.hypotheses import NONE, UNKNOWN, Options
from doe.diagnosis.nested import Nested, check_folds, nested, why_not_nested
from doe.diagnosis.proposals.next_readings import NextReadings, propose, ways_to_measure
from doe.diagnosis.proposals.rivals import open_twins
from doe.diagnosis.scatter import NoisePrior
from doe.diagnosis.setting import Setting, setting_of
from doe.diagnosis.where import Group, HeldOutReadings, hold_out, where, without_history
from doe.estimation.campaign import campaign_of
from doe.estimation.problem import problem
from doe.plausibility.passive_arm import refuse_frozen
from doe.tables.checks import refuse_seen
from doe.tables.loaded import history_of, history_of_part
from fem.arm import Arm
from fem.effects import LOAD_PATH, History, PlacedEffect, build_plain, described_effects
from robots import InputError
from robots.progress import Progress
from robots.schema.quantities import RotationalStiffness
from stiffarm.commands.calibrate import step as calibrating
from stiffarm.commands.calibrate.step import Calibrated
from stiffarm.session.reading_checks import reading_doubts
from stiffarm.session.zones import zone_of

if TYPE_CHECKING:
    from stiffarm.commands.diagnose.command import DiagnoseRequest

CUT = "--loads leaves out loads of its cycles, and friction remembers the largest: give all loads"
# Twins are looked for among the codes that a reader asks about, most probable first.
ASKED = 6


@dataclass(frozen=True)
class Diagnosed:
    """A finished diagnosis with all that is said about it.

    ``used``: the readings it rests on; ``where``: groups by pose, load, direction and phase; ``twins``: by code, those
    that these readings could not tell from it; ``remarks``: what the reader must know of input and choice;
    ``nested``: errors at poses that the whole diagnosis had not seen. ``still_open``: of each effect named, the rivals
    that these readings do not rule out; ``nothing_next``: why no set-ups are proposed although something is open;
    ``other_way``: in what they are other than the readings so far, for these would hardly settle it.
    ``doubts``: what the readings say against themselves.
    """

    request: DiagnoseRequest
    given: Arm
    used: Measurements
    found: Diagnosis
    where: dict[str, tuple[Group, ...]]
    not_testable: dict[str, str]
    twins: dict[str, tuple[str, ...]]
    held_out: HeldOutReadings | None
    remarks: tuple[str, ...]
    proposal: NextReadings | None = None
    calibrated: Calibrated | None = None
    nested: Nested | None = None
    still_open: dict[str, tuple[str, ...]] = field(default_factory=dict)
    nothing_next: str = ""
    other_way: str = ""
    doubts: tuple[Doubt, ...] = ()

    @property
    def odd(self) -> list[int]:
        """Numbers of the readings that hardly count, least first: what the others make of them is far off."""
        weight = self.found.weight
        return [int(k) for k in np.argsort(weight, kind="stable") if not self.found.counts[k]]

    @property
    def tells(self) -> bool:
        """Whether the readings tell anything about the arm."""
        return self.found.verdict != "uninformative"

    @property
    def unseen_rms_mm(self) -> tuple[float, float]:
        """Errors before and after where nothing was chosen or fitted: readings held out, else poses left out."""
        h = self.held_out
        return self.left_out_rms_mm if h is None else (h.rms_before_mm, h.rms_after_mm)

    @property
    def left_out_rms_mm(self) -> tuple[float, float]:
        """Errors before and after at poses left out: of folds, with effects chosen anew in each.

        Where there are no folds: left out one at a time, with effects chosen on all of them.
        """
        if self.nested is not None:
            before = self.nested.rms_before_mm
            return before, before if self.found.rejected else self.nested.rms_after_mm
        return self.found.before.left_out_rms_mm, self.found.after.left_out_rms_mm

    @property
    def in_model(self) -> tuple[Found, ...]:
        """Effects of the new model: those accepted, and those that are provisional."""
        return self.found.found

    @property
    def credible(self) -> tuple[str, ...]:
        """Codes that together hold 95 % of the probability, of every look that found something."""
        if not self.tells:
            return ()
        looks = self.found.rankings[: max(len(self.in_model), 1)]
        accepted = [f.code for f in self.found.effects]
        return tuple(dict.fromkeys([*accepted, *(code for r in looks for code in r.credible())]))

    @property
    def rivals(self) -> tuple[str, ...]:
        """Effects between which the verdict could not choose, most probable first."""
        codes = self.found.rankings[max(len(self.in_model) - 1, 0)].credible()
        return tuple(code for code in codes if code not in (NONE, UNKNOWN))


def diagnose(
    given: Arm,
    table: Measurements,
    asked: DiagnoseRequest,
    *,
    holdout: Measurements | None = None,
    say: Callable[[str], None] = lambda _: None,
    progress: Progress | None = None,
) -> Diagnosed:
    """Ask what a model is missing by the readings of a table; ``holdout``: readings to judge the result by.

    ``say`` hears what was found on the way, ``progress`` how far each look is.

    Raises
    ------
    InputError
        Readings of one pose only, a gauge that stood still, poses held out that are in the table, or fewer readings
        than springs.
    """
    check_folds(asked.folds)
    if holdout is not None:
        refuse_seen(table, holdout)
    refuse_cut_cycles(given.effects, table, asked.loads, "--loads")
    used = select_loads(table, asked.loads)
    refuse_few_poses(used)
    refuse_frozen(given.model, table)
    doubts = reading_doubts(given, used)
    s = _setting(given, used, asked, history_of_part(table, lambda whole: select_loads(whole, asked.loads)))
    if holdout is not None:
        s = replace(s, known=standing(s, problem(s.model, holdout, ()).free.at))
    cut = bool(asked.loads) and used.n < table.n and history_of(table).is_known
    if cut:
        s = without_history(s)
    options = Options(noise=NoisePrior(asked.setup_percent / 100.0))
    found = find_missing(s, options, say, progress)
    anew = _nested(s, used, asked, options, found, say, progress)
    found = _without_harm(found, used, holdout, anew)
    hidden = dict(found.not_testable())
    if cut:
        hidden |= {code: CUT for code, effect in s.known.items() if effect.needs_history}
    twins = found.twins(_asked(found))
    still_open = open_twins(found, twins) if found.verdict == "named" else {}
    proposal, nothing_next, other_way = _proposal(given, found, still_open, asked, say, progress)
    return Diagnosed(
        asked,
        given,
        used,
        found,
        where(found),
        hidden,
        twins,
        None if holdout is None else hold_out(found, used, holdout),
        _remarks(given, asked),
        proposal,
        _calibrated(given, table, asked, found),
        anew,
        still_open,
        nothing_next,
        other_way,
        doubts,
    )


def _without_harm(found: Diagnosis, used: Measurements, holdout: Measurements | None, anew: Nested | None) -> Diagnosis:
    """The diagnosis by what it makes of poses not seen: readings held out, else folds, else one pose at a time."""
    if holdout is not None:
        h = hold_out(found, used, holdout)
        return without_harm(found, h.rms_before_mm, h.rms_after_mm)
    if anew is not None:
        return without_harm(found, anew.rms_before_mm, anew.rms_after_mm)
    return without_harm(found, found.before.left_out_rms_mm, found.after.left_out_rms_mm)


def _nested(
    s: Setting,
    used: Measurements,
    asked: DiagnoseRequest,
    options: Options,
    found: Diagnosis,
    say: Callable[[str], None],
    progress: Progress | None,
) -> Nested | None:
    """The whole diagnosis made anew in every fold; None where there is no such figure."""
    if found.verdict == "uninformative":
        return None
    reason = why_not_nested(used, asked.folds)
    if reason is None:
        return nested(
            s, used, options, folds=asked.folds, seed=asked.seed, counts=found.counts, progress=say, within=progress
        )
    say(f"note: how well the diagnosis predicts poses it has not seen is not known: {reason}")
    return None


def _asked(found: Diagnosis) -> list[str]:
    """Codes whose twins matter: what was found; where it is not settled, the rivals; else the most probable ones."""
    if found.verdict == "uninformative":
        return []
    taken = [f.code for f in found.found]
    if found.verdict != "named":
        codes = [h.code for h in found.rankings[max(len(taken) - 1, 0)].hypotheses if h.code not in (NONE, UNKNOWN)]
        taken += codes[:ASKED]
    return list(dict.fromkeys(taken))


def _proposal(
    given: Arm,
    found: Diagnosis,
    still_open: dict[str, tuple[str, ...]],
    asked: DiagnoseRequest,
    say: Callable[[str], None],
    progress: Progress | None,
) -> tuple[NextReadings | None, str, str]:
    """Set-ups that would settle what is open, why there are none, and in what they are other than readings so far.

    Where set-ups like those so far would probably settle nothing, the best of other loads and other directions.
    """
    settled = found.verdict == "uninformative" or (found.verdict == "named" and not still_open)
    if settled or asked.next_poses == 0:
        return None, "", ""
    zone = zone_of(given.description, asked.floor_mm, asked.keep_out, asked.clearance_mm)
    best: NextReadings | None = None
    hindrance, other_way = "", ""
    say(f"choosing {asked.next_poses} set-ups to tell the remaining candidates apart")
    for way, how in ways_to_measure(found.start).items():
        rng = np.random.default_rng(asked.seed)
        try:
            n = propose(
                found.start,
                found,
                still_open=still_open,
                poses=asked.next_poses,
                zone=zone,
                rng=rng,
                progress=progress,
                **how,
            )
        except InputError as reason:
            hindrance = hindrance or reason.prose
            continue
        if best is None or n.expected.right > best.expected.right:
            best, other_way = n, way
        if found.verdict == "none" or best.is_worth_measuring or not best.could_be_worth_measuring:
            break
    if best is None:
        say(f"note: no readings are proposed: {hindrance}.")
    return best, hindrance if best is None else "", other_way


def _calibrated(given: Arm, table: Measurements, asked: DiagnoseRequest, found: Diagnosis) -> Calibrated | None:
    """The model as it is with the same springs free, as `calibrate` finds them; None where readings tell nothing."""
    joints = found.before.setting.free
    if found.verdict == "uninformative" or not joints:
        return None
    campaign = campaign_of(given.robot.name, tuple(f"{joint}.stiffness" for joint in joints))
    return calibrating.calibrate(given, table, calibrating.Request(campaign, asked.loads))


def _setting(given: Arm, used: Measurements, asked: DiagnoseRequest, history: History) -> Setting:
    """Readings and arm; effects that the model has already are taken as there, their numbers free to follow."""
    description = given.description
    if not description.effect:
        return setting_of(description, given.model, used, own=given.own, free=asked.free, history=history)
    plain = build_plain(description, given.model.link_kind, given.model.load_path)
    has: list[PlacedEffect] = [
        e for e in described_effects(description, plain, given.own) if e.effect.code != LOAD_PATH
    ]
    return setting_of(description, plain, used, accepted=has, own=given.own, free=asked.free, history=history)


def refuse_few_poses(data: Measurements) -> None:
    """Refuse readings of a single pose: whatever is missing there, a spring explains it."""
    poses = len({tuple(row) for row in np.round(data.q, 9).tolist()})
    if poses < 2:
        raise InputError(
            f"{data.source}: poses",
            code="C003",
            value=poses,
            allowed="2 or more, better 9 or more",
            remedy="measure in other poses too: in one pose the springs explain whatever is missing",
        )


def _remarks(given: Arm, asked: DiagnoseRequest) -> tuple[str, ...]:
    out = []
    has = [table.code for table in given.description.effect]
    if has:
        out.append(f"The model has these effects already; their numbers are fitted with the springs: {', '.join(has)}.")
    laws = [
        joint.name
        for joint in given.description.joint
        if joint.stiffness is not None
        and not isinstance(joint.stiffness, RotationalStiffness)
        and (asked.free is None or joint.name in asked.free)
    ]
    if laws:
        out.append(f"Springs that depend on angles are replaced by constant ones: {', '.join(laws)}.")
    return tuple(out)
