"""Making a map: its blocks here or on a cluster, its figures, then its files."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from fem.arm import Arm
from robots import InputError
from robots.progress import Progress
from robots.quantities import rounded
from stiffarm.commands.maps.files import DRAWN_UP_TO, Files, write_files
from stiffarm.commands.maps.request import MapJob, MapRequest, evaluate
from stiffarm.session.caution import caveats
from stiffarm.session.outputs import OutputFolder
from stiffarm.session.stated import stated_table
from surrogate.maps.blocks import Engine
from surrogate.maps.cluster import run_on
from surrogate.maps.data import Layout, MapData, figures
from surrogate.maps.mesh import grid_cells
from surrogate.maps.poses import Extreme, shortfall
from surrogate.maps.quantities import STIFFNESS_ARRAY

# Points at which an extreme pose is sought again with a denser sample.
CHECKED = 12


def evaluated(
    given: Arm, asked: MapRequest, folder: OutputFolder, files: Files, progress: Progress | None = None
) -> tuple[Engine, MapData]:
    """A map, its blocks made here or on a cluster, and its engine; ``given``: the arm of :meth:`MapRequest.stated`.

    Raises
    ------
    InputError
        A work folder or a cluster that cannot be used; a package that is missing.
    """
    engine = asked.engine(given)
    store = engine.store() if files.work is None else engine.store(asked.key(given), files.work)
    make = None if files.dask is None else partial(run_on, files.dask, evaluate, MapJob.of(asked, given))
    with folder.timed("map"):
        return engine, engine.computed(asked.metadata(given, engine), progress, store, make)


def make_map(
    given: Arm, asked: MapRequest, folder: OutputFolder, files: Files, progress: Progress | None = None
) -> dict[str, Any]:
    """Make the map and write it; returns names of files and figures, as map.json has them.

    Raises
    ------
    InputError
        No point is reached; else as :func:`evaluated`.
    """
    engine, data = evaluated(given, asked, folder, files, progress)
    if not np.any(data.reached):
        raise _out_of_reach(given, asked, data.layout)
    content = statistics(engine, data, asked)
    warning = caveats(given)
    content["warning"] = warning or None
    content["messages"] += [warning] if warning else []
    content |= stated_table(given.model)
    with folder.timed("files"):
        names, messages = write_files(given, data, folder, files, asked.frame(given.robot)[:3, 3])
    content["messages"] += messages
    if asked.kind == "joints" and STIFFNESS_ARRAY in data.fields and data.layout.n <= DRAWN_UP_TO:
        of = content["quantities"][STIFFNESS_ARRAY]
        most = of.get("max_near_singular", of["max"])
        content["cells"] = len(grid_cells(data.layout, data.reached)[0])
        content["stiffness_N_per_mm"] = {"min": of["min"], "median": of["median"], "max": most}
    content["files"] = [*names, "map.json"]
    folder.write_json("map.json", {"schema": "stiffarm-map/1", **content})
    return content


def statistics(engine: Engine, data: MapData, asked: MapRequest) -> dict[str, Any]:
    """Figures of a map for map.json and the screen."""
    n, reached = data.layout.n, int(np.count_nonzero(data.reached))
    note = asked.note(engine.quantities.model.robot)
    messages = [] if note is None else [note]
    unsure = 0 if data.sure is None else n - int(np.count_nonzero(data.sure))
    if note is None and unsure:
        messages.append(f"at {unsure} points the search may have missed a branch of the inverse kinematics")
    out: dict[str, Any] = {
        "grid": data.layout.kind,
        "axes": [
            {"name": a.name, "unit": a.unit, "first": a.values[0], "last": a.values[-1], "count": len(a.values)}
            for a in data.layout.axes
        ],
        "held_mm": dict(data.layout.held),
        "pose": asked.pose_words,
        "grid_points": n,
        "points": reached,
        "share_reached": rounded(reached / n),
        "quantities": {},
        "messages": messages,
    }
    for name, field in data.fields.items():
        if field.categories:
            known = field.values[field.values >= 0.0].astype(np.int64)
            found = np.bincount(known, minlength=len(field.categories))
            out["quantities"][name] = {
                "label": field.label,
                "share_of_points": {c: rounded(k / reached) for c, k in zip(field.categories, found, strict=True)},
            }
            continue
        of = figures(field.values)
        if of is None:
            continue
        highest = of
        if field.unit == "N/mm":
            highest = figures(np.where(data.regular(), field.values, np.nan)) or of
        out["quantities"][name] = {
            "label": field.label,
            "unit": field.unit,
            "points": of.count,
            "min": rounded(of.least),
            "median": rounded(of.median),
            "max": rounded(highest.greatest),
            "median_of_points": of.count,
            "least_at": _place(data, of.row_of_least),
            "greatest_at": _place(data, highest.row_of_greatest),
        }
        if highest.greatest < of.greatest:
            out["quantities"][name]["max_near_singular"] = rounded(of.greatest)
    if isinstance(engine.rule, Extreme) and engine.arm is not None:
        out["search_check"] = _search_check(engine, engine.rule, data)
    return out


def _search_check(engine: Engine, rule: Extreme, data: MapData) -> dict[str, Any]:
    """By how much a denser search beats the map's at some of its points."""
    assert engine.arm is not None  # noqa: S101 - a rule has an arm
    step, found = max(1, data.layout.n // (64 * CHECKED)), np.zeros(0)
    rows = step * np.flatnonzero(data.reached[::step])
    if len(rows):
        rows = rows[np.linspace(0, len(rows) - 1, min(CHECKED, len(rows))).astype(int)]
        found = shortfall(rule, engine.arm, data.points[rows], data.q[rows], np.random.default_rng(engine.seed))
        found = found[np.isfinite(found)]
    worst = rounded(100.0 * float(found.max())) if len(found) else None
    return {"points": len(found), "worst_shortfall_percent": worst}


def _place(data: MapData, row: int) -> dict[str, Any]:
    q = np.degrees(np.asarray(data.q[row]))
    return {
        "row": row,
        **{f"{name}_mm": rounded(1e3 * float(v)) for name, v in zip("xyz", data.points[row], strict=True)},
        **{name: rounded(float(v)) for name, v in zip(data.coordinates, q, strict=True)},
    }


def _out_of_reach(given: Arm, asked: MapRequest, grid: Layout) -> InputError:
    if asked.kind == "joints":
        return InputError(
            f"map of {given.robot.name}: no pose of the sweep can be taken", code="S012", remedy="use other --layers"
        )
    pose = "" if asked.any_orientation else f" with {asked.pose_words.split(', best')[0]}"
    return InputError(
        f"no point of the {grid.kind} can be reached{pose}",
        code="S012",
        value=f"{grid.n} points",
        allowed=f"within the reach of {given.robot.name}, about {asked.reach(given.robot).words}",
        remedy="move or widen the grid" + (", or let the orientation be free: --pose stiffest" if pose else ""),
    )
