"""report.html of an index by gamma: which gamma is best, what it costs, how the index lies over the part."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from fem.arm import Arm
from robots.quantities import relative, significant
from stiffarm.commands.maps.index.figures import price_words
from stiffarm.pages.arm_uncertainty import half_widths
from stiffarm.pages.report import Answer, Block, KeyFigure, Note, Picture, Section, Table, Text, write_page
from stiffarm.session.outputs import OutputFolder

if TYPE_CHECKING:
    from stiffarm.commands.maps.index.files import IndexMap

# Poses that the interval of the stiffness is looked at, spread over the map.
JUDGED = 200


def write_report(made: IndexMap, given: Arm, folder: OutputFolder, content: Mapping[str, Any], normal: Any) -> None:
    """Write report.html beside the pictures that are in the folder. ``normal`` (3,): of the surface, base axes."""
    title = f"{made.shown.name} of the {given.description.title.split(' (')[0]} by gamma"
    pictures = {
        name: Picture(folder.path(name), *words) for name, words in _PICTURES.items() if name in content["files"]
    }
    first = pictures.get("gamma_trade_off.png") or pictures.get("index_map.png")
    sections = [
        Section(heading, (pictures[name],))
        for heading, name in _ORDER
        if name in pictures and pictures[name] is not first
    ]
    answer = Answer(_sure(made, given, normal), _todo(content), first, tuple(_warnings(content)))
    sections += [_by_gamma(content), _method(content)]
    write_page(
        folder,
        title,
        _lede(made, content),
        _key(made, content),
        sections,
        "which gamma, and what does it cost?",
        answer=answer,
    )


_PICTURES = {
    "index_map.png": (
        "The index over the part at some angles gamma; then with each point at its own gamma, within a few per cent of "
        "its best; then that gamma. Hatched: out of reach. index_map.csv has every point at every gamma.",
        "maps of the index",
    ),
    "gamma_trade_off.png": (
        "Each mark is one gamma: how good it is, and how many points it reaches. No other gamma beats those on the "
        "line in both. A gamma that misses the soft points looks better than it is.",
        "index against reach",
    ),
    "gamma_statistics.png": (
        "Mean, scatter and reach against gamma. Dashed: only over the points that every gamma reaches, for a fair "
        "comparison.",
        "statistics against gamma",
    ),
}
_ORDER = (
    ("Over the part", "index_map.png"),
    ("What a gamma costs", "gamma_trade_off.png"),
    ("Against gamma", "gamma_statistics.png"),
)


def _unit(content: Mapping[str, Any]) -> str:
    return "" if content["unit"] == "1" else f" {content['unit']}"


def _lede(made: IndexMap, content: Mapping[str, Any]) -> str:
    if made.choice is None:
        return f"No single gamma is best: {content['why_no_best_gamma']}."
    words = price_words(made.traded, made.choice, made.shown).replace("\n", " ")
    return f"Best gamma for the {made.choice.aim} of {made.shown.name}: {words}."


def _key(made: IndexMap, content: Mapping[str, Any]) -> list[KeyFigure]:
    unit, out = _unit(content), list[KeyFigure]()
    best = content["best_gamma"]
    if best is not None:
        out.append(
            KeyFigure(f"{significant(best['value'], 4)}{unit}", f"{best['aim']} at gamma {best['gamma_deg']:g} deg")
        )
        (row,) = [one for one in content["by_gamma"] if one["gamma_deg"] == best["gamma_deg"]]
        least = row["reached"]["largest" if made.found.objective.minimised else "smallest"]
        if least is not None:
            out.append(KeyFigure(f"{significant(least, 4)}{unit}", "worst point of the map at that gamma"))
    share = content["points_reached"] / content["points"]
    out.append(KeyFigure(relative(share), f"of {content['points']} points reached at some gamma"))
    every = content["points_every_gamma_reaches"] / content["points"]
    out.append(KeyFigure(relative(every), "reached at every gamma"))
    return out


def _sure(made: IndexMap, given: Arm, normal: Any) -> str:
    rows = np.flatnonzero(np.asarray(made.data.reached))
    rows = rows[:: max(1, len(rows) // JUDGED)]
    half = half_widths(given, np.asarray(made.data.q[rows]), np.asarray(normal, dtype=np.float64))
    said = "all postures were found" if made.found.sure else "postures were searched for, and some may be missing"
    if half is None:
        return f"No interval: the model does not say how sure its springs are; {said}."
    low, high = np.quantile(half, [0.5, 0.95])
    return (
        f"Stiffness along the normal is known to ± {relative(float(low))} or better at half of the points and to "
        f"± {relative(float(high))} or better at 95 % of them (95 % intervals from the model's calibration); {said}."
    )


def _todo(content: Mapping[str, Any]) -> str:
    if content["best_gamma"] is None:
        return "Move or shrink the workpiece, change the tool, or allow points out of reach: `--partly`."
    best = content["best_gamma"]
    if best["points_reached"] < content["workpiece_points"]:
        return (
            "This gamma does not reach all points of the map. Give the part with --workpiece to find the best gamma "
            "that reaches all of the part."
        )
    if len(content["trade_off"]) > 1:
        return "A stiffer gamma misses some points. If you do not need them, leave them out of --workpiece."
    return "Use this gamma for the whole part, or let `stiffarm posture` choose gamma point by point along a path."


def _warnings(content: Mapping[str, Any]) -> list[str]:
    return [text for text in content["messages"] if text != content["warning"]]


def _by_gamma(content: Mapping[str, Any]) -> Section:
    rows = []
    for one in content["by_gamma"]:
        of = one["reached"]
        figures = [of["mean"], of["standard_deviation"], of["smallest"], one["common"]["mean"]]
        rows.append(
            (
                f"{one['gamma_deg']:g}",
                relative(one["share_reached"]),
                *("" if v is None else f"{v:.4g}" for v in figures),
            )
        )
    unit = _unit(content).strip()
    columns = ("gamma, deg", "reached", "mean", "standard deviation", "smallest", "mean, points that all reach")
    caption = f"{content['quantity']}{f', {unit}' if unit else ''}, over the points that each gamma reaches"
    return Section("Every gamma", (Table(caption, columns, tuple(rows), ()),), folded=True)


def _method(content: Mapping[str, Any]) -> Section:
    facts = [(key.replace("_", " "), str(content[key])) for key in _FACTS if key in content]
    blocks: list[Block] = [
        Text(
            "Each point has the best branch of the inverse kinematics within joint limits at each gamma. Mean, "
            "standard deviation and peak to valley are those of Gao 2024 (doi:10.1109/ACCESS.2024.3435911), "
            "Figs. 10 and 11."
        ),
        Table("What the map is of", ("", ""), tuple(facts), (0, 1)),
        Note("Not checked: collisions, and the motion from point to point."),
    ]
    return Section("How it was found", tuple(blocks), folded=True)


_FACTS = (
    "tool_on_flange",
    "part_in_base",
    "normal",
    "tool_axis",
    "gamma_counts_from",
    "force_N",
    "links",
    "load_path",
)
