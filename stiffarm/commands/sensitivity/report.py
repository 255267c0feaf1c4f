"""report.html of `sensitivity`: which parameter moves the tool most, pose by pose, and over what ranges."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from doe import Measurements, PoseEffects
from doe.planning.screening import variance_shares
from fem.arm import Arm
from robots.arrays import Array
from stiffarm.commands.sensitivity import screening as screenings
from stiffarm.commands.sensitivity.figures import morris_figure, sensitivity_figure, shares_figure
from stiffarm.commands.sensitivity.screening import Study
from stiffarm.pages.bars import ranked_figure
from stiffarm.pages.blocks import Pictures
from stiffarm.pages.figure_parts import naturally
from stiffarm.pages.numbers import ranged
from stiffarm.pages.report import (
    Answer,
    Bullets,
    Fold,
    KeyFigure,
    Picture,
    Section,
    Table,
    Text,
    data_words,
    write_page,
)
from stiffarm.pages.style import save_png
from stiffarm.session.outputs import OutputFolder

QUESTION = "which parameter moves the tool most?"
# A picture of more panels cannot be read.
MOST_PANELS = 6
# Parameters below this share of the variance or the effects need not be known well.
NOTHING = 0.01


def write_factorial_report(
    given: Arm, data: Measurements, effects: Sequence[PoseEffects], levels: tuple[float, float], folder: OutputFolder
) -> None:
    """The page of the factorial."""
    size = {joint: float(np.mean([abs(e.effect_mm[k]) for e in effects])) for k, joint in enumerate(effects[0].joints)}
    total = sum(size.values())
    shares = {joint: value / total for joint, value in size.items()} if total else dict.fromkeys(size, 0.0)
    first = [e.ranking[0] for e in effects]
    path = given.model.load_path
    rows = tuple(
        (e.pose, f"d{'xyz'[e.component]}", *(f"{v:+.3f}" for v in e.effect_mm), " > ".join(e.ranking))
        for e in sorted(effects, key=lambda e: naturally([x.pose for x in effects]).index(e.pose))
    )
    heads = ("pose", "read", *(f"{joint} (mm)" for joint in effects[0].joints), "ranking")
    ranges = (f"every spring from {ranged(*levels)} N m/rad",)
    how = (
        f"Two-level full factorial of {', '.join(effects[0].joints)}, {path} load path. The deflection is a sum over "
        "springs, so there are no interactions. Positive: a stiffer spring lowers the deflection."
    )
    figure = sensitivity_figure({path: effects[:MOST_PANELS]}, levels)
    table = Table("Effect of stiffening one joint", heads, rows, text_columns=(0, 1, len(heads) - 1))
    _write(given, data, shares, first, [e.pose for e in effects], ranges, how, figure, table, folder)


def write_screening_report(given: Arm, data: Measurements, study: Study, folder: OutputFolder) -> None:
    """The page of a screening."""
    f, names = study.found, [p.name for p in study.parameters]
    size: Array = {
        "sobol": f.total,
        "morris": f.mean_effect / np.maximum(f.mean_effect.sum(axis=1, keepdims=True), 1e-300),
        "derivative": variance_shares(f.derivative),
    }[study.method]
    shares = dict(zip(names, np.nan_to_num(size).mean(axis=0).tolist(), strict=True))
    first = [names[int(k)] for k in np.nan_to_num(size).argmax(axis=1)]
    title, heads, rows = screenings.table(study)
    ranges = tuple(f"{p.name} from {screenings.range_text(p)}" for p in study.parameters)
    how = f"{study.method.capitalize()} study of d{study.component} with {f.runs} runs of the model, seed {study.seed}."
    shown = screenings.few(study, MOST_PANELS)
    what = f"d{study.component}" if len(study.component) == 1 else study.component
    figure = (
        morris_figure(shown.found, shown.names, what, *study.factor_unit)
        if study.method == "morris"
        else shares_figure(shown.found, shown.names, what)
    )
    cells = tuple(tuple(row) for row in rows)
    _write(
        given, data, shares, first, list(study.names), ranges, how, figure, Table(title, tuple(heads), cells), folder
    )


def _write(
    given: Arm,
    data: Measurements,
    shares: dict[str, float],
    first: Sequence[str],
    poses: Sequence[str],
    ranges: tuple[str, ...],
    how: str,
    figure: Figure,
    table: Table,
    folder: OutputFolder,
) -> None:
    pictures = Pictures(folder)
    order = sorted(shares, key=lambda name: -shares[name])
    leads = Counter(first)
    count = len(first)
    lede = f"{order[0]} moves the tool most, in {leads[order[0]]} of {count} loaded poses."
    key = [KeyFigure(_percent(shares[name]), f"{name}; first in {leads[name]} of {count} poses") for name in order[:4]]
    small = [name for name in order if shares[name] < NOTHING]
    sure = f"These are the model's own answers, without readings; they hold over its ranges: {ranges[0]}"
    sure += f", and {len(ranges) - 1} more." if len(ranges) > 1 else "."
    wanted = ", ".join([name for name in order if name not in small][:4])
    todo = f"Identify {wanted} first: `stiffarm plan {given.robot.name} --poses 6`."
    if small:
        some = ", ".join(small[:4])
        todo += f" {len(small)} of {len(order)} parameters hardly matter here ({some}): leave them as they are."
    caption = "Mean over the loaded poses; what is small is together."
    percent = {name: 100.0 * value for name, value in shares.items()}
    figure_all = ranked_figure("Share of what moves the tool", percent, "share, mean over the poses (%)")
    answer = Answer(sure, todo, pictures.add(figure_all, "shares", caption))
    save_png(figure, folder.path("sensitivity.png"))
    some = f"{MOST_PANELS} of {len(poses)} poses; the table has all." if len(poses) > MOST_PANELS else "Pose by pose."
    drawn = Picture(folder.path("sensitivity.png"), some, "sensitivity pose by pose")
    method = (Text(how), Fold("Ranges", (Bullets(ranges),)), Text("All of it is in sensitivity.json."))
    sections = [
        Section("Pose by pose", (drawn, Fold("All poses as a table", (table,)))),
        Section("How it was done", method, folded=True),
    ]
    title = given.description.title.split(" (")[0]
    write_page(folder, title, lede, key, sections, QUESTION, data_words(data), answer)


def _percent(share: float) -> str:
    return f"{100.0 * share:.0f}\u00a0%" if share >= 0.005 else "below 1\u00a0%"
