"""report.html of stiffness indices at poses: how soft the tool is at worst, along what, and which part gives way."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from fem import compliance_budget
from fem.arm import Arm
from machining import INDICES
from stiffarm.commands.index.figures import MOST_POSES, ellipsoid_figure
from stiffarm.commands.index.results import IndexAnswer, alone_words, cell
from stiffarm.pages.arm_uncertainty import half_widths
from stiffarm.pages.blocks import percent
from stiffarm.pages.numbers import ranged, significant
from stiffarm.pages.report import Answer, Fold, KeyFigure, Picture, Section, Table, Text, write_page
from stiffarm.pages.style import save_png
from stiffarm.session.outputs import OutputFolder
from stiffarm.session.stated import stiffness_interval

# Poses of a page's table; files have all.
LISTED = 60


def write_report(folder: OutputFolder, content: Mapping[str, Any], found: IndexAnswer, given: Arm) -> None:
    """Draw ellipsoid.png and write report.html.

    ``content``: of :func:`stiffarm.commands.index.results.payload`.
    """
    asked = found.question
    path = folder.path("ellipsoid.png")
    save_png(ellipsoid_figure(found.compliance[:MOST_POSES], asked.labels[:MOST_POSES], asked.normal), path)
    title = f"Stiffness of the {given.description.title.split(' (')[0]} at {_poses(len(asked.q))}"
    picture = Picture(path, _CAPTION, "stiffness by direction of the force")
    sections = [_table(content, found), _axes(content), _method(content, found)]
    sure, interval = _sure(given, found)
    answer = Answer(sure, _todo(found), picture)
    write_page(
        folder,
        title,
        _lede(found),
        _key(given, found, interval),
        sections,
        "how stiff is it in each direction?",
        answer=answer,
    )


_CAPTION = (
    "Force that it takes to move the tool by 1 mm, by the force's direction, in three planes of the base frame. Blue: "
    "1 mm in any direction; orange, dashed: 1 mm along the force itself."
)


def _poses(n: int) -> str:
    return "one pose" if n == 1 else f"{n} poses"


def _weakest(found: IndexAnswer) -> int:
    """The pose whose weakest direction is the softest."""
    return int(np.argmin(found.ellipsoid.semi_axes[:, 0]))


def _direction(vector: np.ndarray[Any, Any]) -> str:
    return ", ".join(f"{v + 0.0:.2f}" for v in vector)


def _lede(found: IndexAnswer) -> str:
    i, axes = _weakest(found), found.ellipsoid
    soft, stiff = 1e-3 * axes.semi_axes[i, 0], 1e-3 * axes.semi_axes[i, 2]
    where = "" if len(found.question.q) == 1 else f" (pose {found.question.labels[i]}, the softest)"
    return (
        f"The tool deflects most along {_direction(axes.axes[i, :, 0])} in base axes{where}: "
        f"{significant(soft, 4)} N/mm, against {significant(stiff, 4)} N/mm in the stiffest direction."
    )


def _key(given: Arm, found: IndexAnswer, interval: str) -> list[KeyFigure]:
    i, axes = _weakest(found), found.ellipsoid
    soft = 1e-3 * float(axes.semi_axes[i, 0])
    load = np.concatenate([axes.axes[i, :, 0], np.zeros(3)])
    budget = compliance_budget(given.model, found.question.q[i : i + 1], load, found.question.tip)
    part = int(budget.share[0].argmax())
    out = [
        KeyFigure(f"{significant(soft, 4)} N/mm", "weakest direction", interval),
        KeyFigure(f"{budget.parts[part]}, {percent(float(budget.share[0, part]))}", "deflects most there"),
    ]
    if "k_fs" in found.values:
        k = 1e-3 * np.asarray(found.values["k_fs"])
        words = f"{significant(float(k.min()), 4)} N/mm"
        alone = ""
        if found.joints_alone is not None:
            least = 1e-3 * float(np.asarray(found.joints_alone["k_fs"])[int(k.argmin())])
            alone = f"{significant(least, 4)} N/mm with rigid links, as its paper has it"
        out.append(KeyFigure(words, "k_fs: least force along the normal for 1 mm in any direction", alone))
    if len(axes.semi_axes) > 1:
        best = 1e-3 * float(axes.semi_axes[:, 0].max())
        out.append(KeyFigure(f"{significant(best, 4)} N/mm", "weakest direction of the stiffest pose"))
    return out


def _sure(given: Arm, found: IndexAnswer) -> tuple[str, str]:
    """What the page says of its certainty, and the interval of its first figure."""
    i, axes = _weakest(found), found.ellipsoid
    half = half_widths(given, found.question.q[i : i + 1], axes.axes[i, :, 0], found.question.tip)
    if half is None:
        return "No interval: the model does not say how sure its springs are.", ""
    ends = stiffness_interval(1e-3 * float(axes.semi_axes[i, 0]), float(half[0]))
    words = f"95 %: {ranged(*ends, 'N/mm')}"
    return "95 % intervals rest on the covariance of the model's calibration; static stiffness only.", words


def _todo(found: IndexAnswer) -> str:
    near = found.singular < 0.05
    if near.any():
        labels = ", ".join(label for label, one in zip(found.question.labels, near, strict=True) if one)
        return f"Pose {labels} is close to a singularity: keep programs away from it. `stiffarm posture` finds others."
    if len(found.question.q) == 1:
        return "Compare other postures at this point with `stiffarm posture`, and other points with `stiffarm map`."
    return "Choose the pose that is stiffest along your force; index.csv lists all of them."


def _table(content: Mapping[str, Any], found: IndexAnswer) -> Section:
    poses = content["poses"]
    caption = "; ".join(words for words in ("Indices at the poses", alone_words(found)) if words)
    names = list(poses[0]["indices"])
    shown = poses[:LISTED]
    few = len(shown) <= 6
    columns = ("index", *(f"pose {p['pose']}" for p in shown)) if few else ("pose", *map(_named, names))
    if few:
        rows = tuple((_named(name), *(cell(p, name) for p in shown)) for name in names)
    else:
        rows = tuple((str(p["pose"]), *(cell(p, name) for name in names)) for p in shown)
    left = [Text(f"{len(poses) - LISTED} more poses are in index.csv.")] if len(poses) > LISTED else []
    return Section("Indices", (Table(caption, columns, rows), *left))


def _axes(content: Mapping[str, Any]) -> Section:
    rows = []
    for p in content["poses"][:LISTED]:
        for name, axis in zip(("weakest", "middle", "stiffest"), p["ellipsoid"], strict=True):
            direction = _direction(np.array(axis["direction"]))
            rows.append((f"pose {p['pose']}, {name}", _cell(axis["stiffness_N_per_mm"]), direction))
    columns = ("axis", "stiffness, N/mm", "direction in base axes")
    return Section(
        "Stiffness by direction", (Table("Axes of the ellipsoid", columns, tuple(rows), (0, 2)),), folded=True
    )


def _method(content: Mapping[str, Any], found: IndexAnswer) -> Section:
    rows = tuple((name, index.formula) for name, index in INDICES.items())
    asked = found.question
    words = (
        f"Tool tip on the flange {', '.join(f'{1e3 * v:g}' for v in asked.tip)} mm; surface normal "
        f"{_direction(asked.normal)}; "
        + ("no force given" if asked.force is None else f"force {_direction(asked.force)} N")
        + ("; unloaded arm." if asked.load is None else "; the stiffness that the load takes away is counted.")
    )
    left = [Text(f"Not computed: {', '.join(content['not_computed'])} (they need --force).")]
    table = Fold("What each index is", (Table("Formulas", ("index", "formula"), rows, (0, 1)),))
    return Section("How it was found", (Text(words), *(left if content["not_computed"] else []), table), folded=True)


def _named(key: str) -> str:
    return f"{key.removesuffix('_N_per_mm')}, N/mm" if key.endswith("_N_per_mm") else key


def _cell(value: float | None) -> str:
    return "infinite" if value is None else significant(value, 4)
