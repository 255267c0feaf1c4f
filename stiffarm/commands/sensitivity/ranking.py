"""What every sensitivity study answers: which parameter leads, what hardly matters, over which ranges."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

from doe import Measurements
from fem.arm import Arm
from robots.arrays import Array
from robots.quantities import percent
from stiffarm.pages.report import Bullets, Fold, KeyFigure, Section, Text, data_words
from stiffarm.result import Drawing, Result, Table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# A picture of more panels cannot be read.
MOST_PANELS = 6
# Parameters below this share of the variance or the effects need not be known well.
NOTHING = 0.01


def ranking(
    given: Arm,
    data: Measurements,
    names: Sequence[str],
    share: Array,
    first: Sequence[str],
    ranges: tuple[str, ...],
    how: str,
    pose_by_pose: Callable[[], Figure],
    tables: tuple[Table, ...],
    facts: Mapping[str, Any],
) -> Result:
    """The result of a study.

    ``share`` (o, p): of each parameter at each loaded pose; ``first`` (o,): the one that leads there.
    """
    mean = dict(zip(names, share.mean(axis=0).tolist(), strict=True))
    order = sorted(mean, key=lambda name: -mean[name])
    leads, count = Counter(first), len(first)
    small = [name for name in order if mean[name] < NOTHING]
    sure = f"These are the model's own answers, without readings; they hold over its ranges: {ranges[0]}"
    wanted = ", ".join([name for name in order if name not in small][:4])
    next_words = f"Identify {wanted} first: `stiffarm plan MODEL --poses 6`."
    if small:
        next_words += (
            f" {len(small)} of {len(order)} parameters hardly matter here ({', '.join(small[:4])}): leave them as they "
            "are."
        )
    in_percent = {name: 100.0 * value for name, value in mean.items()}
    ranked = partial(_shares, in_percent)
    some = f"{MOST_PANELS} of {count} poses; the table has all." if count > MOST_PANELS else "Pose by pose."
    return Result(
        name="sensitivity",
        title=given.description.title.split(" (")[0],
        question="which parameter moves the tool most?",
        answer=f"{order[0]} moves the tool most, in {leads[order[0]]} of {count} loaded poses.",
        how_sure=sure + (f", and {len(ranges) - 1} more." if len(ranges) > 1 else "."),
        what_next=next_words,
        facts={
            "robot": given.robot.name,
            "load_path": given.model.load_path,
            "links": given.model.link_kind,
            **facts,
        },
        tables=tables,
        drawings=(
            Drawing("shares", "Mean over the loaded poses; what is small is together.", "shares", ranked),
            Drawing("sensitivity", some, "sensitivity pose by pose", pose_by_pose),
        ),
        key=tuple(
            KeyFigure(percent(mean[name]), f"{name}; first in {leads[name]} of {count} poses") for name in order[:4]
        ),
        sections=(Section("How it was done", (Text(how), Fold("Ranges", (Bullets(ranges),))), folded=True),),
        arm=given,
        made_of=data_words(data),
    )


def _shares(in_percent: Mapping[str, float]) -> Figure:
    from stiffarm.pages.bars import ranked_figure

    return ranked_figure("Share of what moves the tool", in_percent, "share, mean over the poses (%)")
