"""The page of a diagnosis: the story in sections, its pictures, and the files that go with them."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property, partial
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from doe import write_measurements
from doe.diagnosis.checks import stated
from doe.diagnosis.diagnose import State
from doe.diagnosis.findings.laws import curve_of
from doe.diagnosis.findings.numbers import errors_mm, in_order
from doe.diagnosis.findings.traces import traces_of
from doe.diagnosis.hypotheses import NONE, UNKNOWN, Ranking
from doe.diagnosis.space import gaps, pose_errors_mm, stands
from doe.diagnosis.where import labels_of, least_rms_mm, noise_floor_mm
from fem.arm import Arm
from robots import save_description
from robots.quantities import percent, significant
from stiffarm.commands.calibrate.words import bound_of, noise_parts
from stiffarm.commands.diagnose import space, words
from stiffarm.commands.diagnose.arms import arms_figure
from stiffarm.commands.diagnose.figures import (
    Bar,
    Fit,
    gap_figure,
    law_figure,
    ranking_figure,
    residuals_figure,
    traces_figure,
)
from stiffarm.commands.diagnose.model import springs_of
from stiffarm.commands.diagnose.step import Diagnosed
from stiffarm.pages.dumbbells import dumbbells_figure
from stiffarm.pages.numbers import naturally
from stiffarm.pages.report import Block, Bullets, Fold, Section, Table, Text
from stiffarm.result import Drawing
from stiffarm.result import Table as Values
from stiffarm.session.outputs import OutputFolder
from stiffarm.session.words.directions import set_up_rows
from stiffarm.session.words.noise import floor_name, scatter_name
from stiffarm.session.words.springs import mega
from surrogate.maps.data import MapData

# Candidates drawn: the most probable ones, and nothing missing and something unknown wherever they stand.
DRAWN = 10
# Poses drawn unfolded, in one folded picture, and altogether.
WORST, IN_ONE, MOST_ARMS = 9, 36, 117
# Less probable ones are not named among what else may be missing.
LEAST = 0.01
GAP_FILE = "gap.vtp"


def _drawing(name: str, caption: str, draw: Callable[..., Figure], *given: Any) -> Drawing:
    return Drawing(name, caption, name.replace("_", " "), partial(draw, *given))


class Story:
    """A diagnosis as sections and files.

    ``arm``: with the new model; ``tables``: of its result, by name; ``before``: what names of files begin with.
    """

    def __init__(self, d: Diagnosed, arm: Arm, tables: Sequence[Values], before: str = "") -> None:
        self.d, self.arm, self.before = d, arm, before
        self.tables = {table.name: table for table in tables}

    @cached_property
    def cost(self) -> MapData | None:
        """The map of what leaving the effects out costs; None where none were found."""
        return space.cost_map(self.d, self.arm.description) if self.d.in_model else None

    def write(self, folder: OutputFolder) -> dict[str, Any]:
        """Write the new model, the sheet to fill in, the gap and its cost in space; returns facts for the JSON."""
        d, before, out = self.d, self.before, {}
        space.write_gap(d, folder, f"{before}{GAP_FILE}")
        if d.tells:
            save_description(self.arm.description, folder.path(f"{before}model.toml"))
        if self.cost is not None:
            space.write_cost(self.cost, d, self.arm, folder, before)
            out["cost_of_leaving_out"] = space.cost_facts(self.cost)
        if d.proposal is not None:
            path = folder.path(f"{before}next_readings.csv")
            write_measurements(d.proposal.sheet, path, d.given.robot, to_fill=d.proposal.protocol.columns)
        return out

    def sections(self) -> list[Section]:
        """The whole page."""
        if not self.d.tells:
            return [self.shrunk(), Section("The campaign in space", tuple(self._arms()))]
        return [
            self.ladder(),
            self.where(),
            self.shrunk(),
            self.explained(),
            *([self.laws(), Section("What leaving it out would cost", self.costs())] if self.d.in_model else []),
            self.next_readings(),
            replace(self.not_judged(), folded=True),
            replace(self.how(), folded=True),
        ]

    def ladder(self) -> Section:
        """Each look: what was taken up, how the error fell, how probable it was and is, and what is still in doubt."""
        d = self.d.found
        found, error = in_order(d), errors_mm(d)
        provisional = {f.code for f in d.provisional}
        rows = [("springs alone", significant(error[0]), "", "", "")]
        for k, f in enumerate(found):
            failed = [words.AGAINST[c.code] for c in d.checks if c.passed is False and c.effect == f.code]
            rows.append(
                (
                    f"+ {f.code}" + (" (provisional)" if f.code in provisional else ""),
                    f"{significant(error[k])} → {significant(error[k + 1])}",
                    percent(f.probability),
                    percent(stated(f, d.checks)),
                    "; ".join(failed) or "no check speaks against it",
                )
            )
        rows.append(("nothing more", "", "", "", self._last(len(found))))
        heads = ("accepted", "error (mm)", "then", "now", "still in doubt")
        table = Table("RMS error at poses left out, and probability then and now", heads, tuple(rows), (0, 4))
        if not found:
            text = f"Springs alone leave {significant(error[0])} mm (RMS) at poses left out; no effect was accepted."
            return Section("How it was found, look by look", (Text(text), table, *self._behind(len(found))))
        steps = ", then ".join(f"{f.code} to {significant(e)} mm" for f, e in zip(found, error[1:], strict=True))
        text = (
            f"Springs alone leave {significant(error[0])} mm (RMS) at poses left out one at a time; {steps}. “Then” is "
            "the probability among all candidates when it was accepted, “now” that after its checks."
        )
        names = ["springs alone", *(f"+ {f.code}" for f in found)]
        errors = dict(zip(names, zip([error[0], *error[:-1]], [math.nan, *error[1:]], strict=True), strict=True))
        caption = "The error at poses left out one at a time, all effects known, before and after each was accepted."
        heading = "Look by look: the error at poses left out"
        draw = partial(dumbbells_figure, heading, errors, "RMS error (mm)", lines=self._floor)
        drawn = _drawing("ladder", caption, draw)
        return Section("How it was found, look by look", (drawn, Text(text), table, *self._behind(len(found))))

    @property
    def _floor(self) -> dict[str, float]:
        """What the error cannot fall below, by what it is called, mm."""
        return {floor_name(self.d.found.after.setting.data): noise_floor_mm(self.d.found)}

    def _last(self, taken: int) -> str:
        """What the look after the last effect leaves open."""
        d = self.d.found
        if taken >= len(d.rankings):
            return "nobody looked further: three effects are as many as are looked for"
        last = d.rankings[taken]
        open_ = (
            f"{percent(1.0 - last.of(NONE).probability)} that {'something more' if taken else 'anything'} is missing"
        )
        others = [h for h in last.hypotheses if h.code != NONE][: words.NAMED]
        named = [
            f"{words.NAMES.get(h.code, h.code)} {percent(h.probability)}" for h in others if h.probability >= LEAST
        ]
        doubts = [words.AGAINST[c.code] for c in d.checks if c.passed is False and not c.effect]
        doubts = [text for text in doubts if text != words.AGAINST["nothing-left"]]
        # A number keeps its unit on its line.
        return "; ".join([open_ + (f" ({', '.join(named)})" if named else ""), *doubts]).replace(" %", "\u00a0%")

    def _behind(self, taken: int) -> list[Block]:
        """What the ladder's rows rest on."""
        d = self.d
        blocks: list[Block] = [Bullets(words.remarks(d))]
        if d.nested is not None and taken:
            blocks.append(Text(words.chosen_anew(d.nested)))
        if d.found.provisional:
            codes = ", ".join(f.code for f in d.found.provisional)
            blocks.append(Text(f"In the new model for the time being, marked as provisional: {codes}."))
        if d.found.checks:
            rows = tuple(
                (
                    c.code,
                    c.effect or "all",
                    words.RESULT[c.passed],
                    c.evidence,
                    significant(c.factor, 2) if c.passed is False else "1",
                )
                for c in d.found.checks
            )
            heads = ("check", "of", "result", "evidence", "odds times")
            blocks.append(Table("All checks after the name", heads, rows, (0, 1, 2, 3), folded=True))
        return blocks

    def _arms(self) -> list[Block]:
        """The arm in its measured poses with what was read, simulated and left over; nothing of rotations alone."""
        some = stands(gaps(self.d.found))
        if not some:
            return []
        poses = len(some)
        caption = (
            "Each arm under the load where the model with springs alone was most wrong; arrows are larger than the arm "
            f"by the factors given. {self.before}{GAP_FILE} opens in ParaView with all loads."
        )

        def drawn(name: str, first: int, last: int, heading: str) -> Drawing:
            return _drawing(name, caption, arms_figure, some[first:last], self.d.given.robot, heading, some)

        heading = "Where the arm was when the model was wrong: the worst poses first"
        blocks: list[Block] = [drawn("arms", 0, WORST, heading)]
        rest: list[Block] = []
        for first in range(WORST, min(poses, MOST_ARMS), IN_ONE):
            last = min(first + IN_ONE, MOST_ARMS, poses)
            heading = f"Poses {first + 1} to {last} of {poses} by what is left over"
            rest.append(drawn(f"arms_{first + 1}", first, last, heading))
        if poses > MOST_ARMS:
            rest.append(Text(f"The {poses - MOST_ARMS} poses with the least left over are not drawn."))
        return [*blocks, Fold(f"The other {poses - WORST} poses", tuple(rest))] if rest else blocks

    def where(self) -> Section:
        """Where the disagreement lies: the arm in its poses, errors by pose before and after, shares by group."""
        d = self.d
        blocks = [*self._arms(), Bullets(words.where_sentences(d))]
        if (by_pose := pose_errors_mm(d.found)) and d.in_model:
            caption = "A pose that hardly moves is not explained by what was found."
            what, ends = "RMS error in the fit (mm)", ("springs alone", "with what was found")
            heading = "Each pose before and after, the worst first"
            draw = partial(dumbbells_figure, heading, by_pose, what, below="pose", lines=self._floor, ends=ends)
            blocks.append(_drawing("poses", caption, draw))
        rows = tuple(
            (kind, g.label, str(g.readings), words.share_text(g), significant(g.mean_square))
            for kind, groups in d.where.items()
            if len(groups) > 1
            for g in groups
        )
        text = Text(
            "Residuals of the model with its springs fitted, over the noise of a reading. A mean square above 1 is "
            "more than noise explains; a group's share is its part of all that is beyond the noise, ± one standard "
            "deviation by the uncertainty of the springs and effects found."
        )
        table = Table("By group", ("by", "group", "readings", "share", "mean square"), rows, (0, 1))
        blocks.append(Fold("Shares by pose, load, direction and phase", (text, table)))
        return Section("Poses with the largest error", tuple(blocks))

    def explained(self) -> Section:
        """The traces of what is credible, the ranking of every look that found something, and the twins."""
        d, found = self.d, self.d.found
        blocks: list[Block] = [
            Text(
                f"{len(found.start.known)} physical effects were tried, each fitted together with the springs, against "
                "“nothing is missing” and against something unknown that varies smoothly over poses and loads. A "
                "candidate is probable if it explains the readings with plausible parameters, not because it has many."
            )
        ]
        if (traces := traces_of(found, d.twins, naturally(found.before.setting.data.poses))) is not None:
            caption = (
                "Readings sorted by direction, pose and load. Dots: residuals with springs alone. Line: what the "
                "effect explains of them, with springs refitted. A twin whose trace is the same to within the noise "
                "cannot be separated from it by these readings."
            )
            blocks.append(_drawing("traces", caption, traces_figure, traces))
        taken = [f.code for f in in_order(found)]
        rankings: list[Block] = []
        for k, r in enumerate(found.rankings[: len(taken) + 1]):
            heading = f"And with {', '.join(taken[:k])} in the model" if k else "Candidates of the first look"
            caption = "Probability of each candidate in this look, before any check."
            rankings.append(_drawing(f"ranking_{k + 1}" if k else "ranking", caption, _ranking, r, taken, heading))
        blocks += [self.tables["most_probable"], Fold("All candidates, look by look", tuple(rankings))]
        if d.twins:
            text = Text("Twins, which these readings cannot separate:")
            blocks.append(Fold("What could imitate it", (text, Bullets(words.twin_sentences(d)))))
        return Section("What explains it", tuple(blocks))

    def laws(self) -> Section:
        """The effects of the new model: their laws drawn, their numbers with intervals."""
        d, after = self.d, self.d.found.after
        first = len(after.setting.accepted) - len(d.in_model)
        provisional = {f.code for f in d.found.provisional}
        blocks: list[Block] = [self.tables["parameters"]] if "parameters" in self.tables else []
        for k, f in enumerate(in_order(d.found)):
            said = f"{f.placed.effect.words[0].upper()}{f.placed.effect.words[1:]} ({f.code})"
            blocks.append(Text(f"{said}{' (provisional)' if f.code in provisional else ''}."))
            if (curve := curve_of(after, first + k)) is not None:
                remembers = f.placed.effect.needs_history
                loop = "The way up differs from the way down by what the joint remembers. " if remembers else ""
                caption = (
                    f"{loop}Band: 95 % of the laws that the readings leave possible, springs included. Dots: what "
                    "single readings imply for this joint if the rest is as the model says."
                )
                heading = f"{f.code}: {f.placed.effect.words}"
                blocks.append(_drawing(f"law_{k + 1}", caption, law_figure, curve, heading))
        return Section("What was found, and how well it is known", tuple(blocks))

    def shrunk(self) -> Section:
        """Residuals and the gap, before and after."""
        d, found = self.d, self.d.found

        def pair(before: float, after: float) -> tuple[float, float]:
            return before, after if d.in_model else math.nan

        rows = {"in the fit": pair(found.before.fit_rms_mm, found.after.fit_rms_mm)}
        rows["poses left out one at a time"] = pair(found.before.left_out_rms_mm, found.after.left_out_rms_mm)
        h, n = d.held_out, d.nested
        if n is not None:
            rows["poses not seen, effects chosen anew"] = pair(n.rms_before_mm, n.rms_after_mm)
        if h is not None:
            rows["readings held out"] = pair(h.rms_before_mm, h.rms_after_mm)
        blocks: list[Block] = []
        # Without a second model there is nothing to compare: the sentence says it all.
        if d.in_model:
            caption = "RMS errors. What counts is the error at poses that the fit has not seen."
            given = rows, noise_floor_mm(found), least_rms_mm(found), floor_name(found.after.setting.data)
            blocks.append(_drawing("gap", caption, gap_figure, *given))
        states = {"before": found.before} | ({"after": found.after} if d.in_model else {})
        caption = "Each point is a reading. What is missing shows as a pattern; noise has none."
        drawn = _drawing("residuals", caption, _residuals, d, states)
        blocks.append(Fold("Reading by reading", (drawn,)))
        if h is not None and h.remarks:
            blocks.append(Bullets(h.remarks))
        return Section(words.gap_title(*pair(*d.unseen_rms_mm)), tuple(blocks))

    def costs(self) -> tuple[Block, ...]:
        """What leaving the effects out costs over the workspace; nothing where none was found."""
        return () if self.cost is None else space.cost_blocks(self.cost, self.d.given, self.before)

    def next_readings(self) -> Section:
        """What to measure next, with what it is expected to show."""
        d, n = self.d, self.d.proposal
        blocks: list[Block] = [Text(words.advice(d).text)]
        if n is not None:
            heads = ("set-up", *(f"{c.removesuffix('_deg')} (deg)" for c in d.given.robot.coordinates), "load")
            rows = set_up_rows(n.labels, n.q, n.direction)
            # How probable each name is now stands in the ladder; here only what the set-ups would change.
            changes = tuple(f"{words.sentence(w)}." for w in n.words[1:])
            blocks += [
                Text(words.proposal_text(n)),
                Table("Set-ups to measure next", heads, rows, (0, len(heads) - 1), folded=True),
                Fold("What they are expected to show", (Bullets(changes),)),
            ]
        return Section("What to measure next", tuple(blocks))

    def not_judged(self) -> Section:
        """What these readings cannot judge, by reason."""
        reasons: dict[str, list[str]] = {}
        for code, reason in self.d.not_testable.items():
            kind = reason.split(":")[0] if "chi-square" in reason else reason
            kind = "an effect of usual size would hardly show" if "chi-square by" in reason else kind
            reasons.setdefault(kind, []).append(code)
        title = "What these readings cannot tell"
        if not reasons:
            return Section(title, (Text("Every effect of the catalogue would have shown."),))
        rows = tuple((reason, ", ".join(codes)) for reason, codes in sorted(reasons.items(), key=lambda x: -len(x[1])))
        count = sum(map(len, reasons.values()))
        text = (
            f"{count} of {len(self.d.found.start.known)} effects could not be judged: that they were not found does "
            "not say that they are not there. Other poses, loads, directions or a second axis of the gauge would show "
            "some of them."
        )
        return Section(title, (Text(text), Table("By reason", ("reason", "effects"), rows, (0, 1))))

    def how(self) -> Section:
        """How it was done, with the springs and the whole ranking."""
        found = self.d.found
        springs = tuple(
            (
                s.parameter.place,
                mega(s.value),
                mega(s.interval[0]),
                "no upper limit" if math.isinf(s.interval[1]) else mega(s.interval[1]),
                "rigid fits best" if bound_of(s) else s.status,
            )
            for s in springs_of(self.d)
        )
        p = found.after.setting.data
        sizes = "; ".join(f"{what}: {size}" for what, size in noise_parts(found.after.refit.noise, p))
        name = scatter_name(p)
        noise = f"{name[0].upper()}{name[1:]} by the best explanation. {sizes[0].upper()}{sizes[1:]}."
        blocks: list[Block] = [
            Text(
                "Each candidate's evidence is its probability of giving these readings, averaged over its plausible "
                "numbers and over plausible noise, with a term for set-ups that scatter as a whole. A name is given "
                "only if it also predicts poses left out better than nothing missing does. What was found goes into "
                "the model, and the remaining candidates are tested again. The new model is model.toml; every number "
                "there says where it came from."
            ),
            Text(noise),
            Table(
                "Springs of the new model (1e6 N m/rad)",
                ("joint", "value", "from", "to (95 %)", "status"),
                springs,
                (0, 4),
            ),
            self.tables["candidates"],
        ]
        return Section("How it was done", tuple(blocks))


def _ranking(r: Ranking, taken: list[str], heading: str) -> Figure:
    shown = [h for k, h in enumerate(r.hypotheses) if k < DRAWN or h.code in (NONE, UNKNOWN)]
    kinds = {NONE: NONE, UNKNOWN: UNKNOWN} | dict.fromkeys(taken, "chosen")
    return ranking_figure([Bar(h.code, h.probability, kinds.get(h.code, "effect")) for h in shown], heading)


def _residuals(d: Diagnosed, states: Mapping[str, State]) -> Figure:
    """Translations in mm; rotations only where nothing else was read."""
    fits = []
    for name, state in states.items():
        p = state.setting.data
        linear = p.component < 3
        mine = np.flatnonzero((linear if linear.any() else ~linear) & d.found.counts)
        labels = labels_of(state.setting)
        noise = noise_floor_mm(d.found) if linear.any() else state.refit.noise.white[1] * 1e3
        order = sorted(dict.fromkeys(labels["load"]), key=lambda text: float(text.split()[0]))
        mine = mine[np.argsort([order.index(labels["load"][i]) for i in mine], kind="stable")]
        of = {kind: [labels[kind][i] for i in mine] for kind in ("pose", "load", "phase")}
        read, simulated = 1e3 * p.value[mine], 1e3 * state.setting.prediction[mine]
        fits.append(Fit(name, read, simulated, noise, **of, unit="mm" if linear.any() else "mrad"))
    return residuals_figure(fits)
