"""Making a map: its blocks here or on a cluster, its figures, then its files."""

from __future__ import annotations

import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fem.arm import Arm
from robots import InputError, content_hash
from robots.progress import Progress
from stiffarm.commands.maps import sweep
from stiffarm.commands.maps.files import DRAWN_UP_TO, Files, write_files
from stiffarm.commands.maps.options import Asked
from stiffarm.commands.maps.request import MapRequest, engine_of, evaluate
from stiffarm.session.caution import caveats, warned
from stiffarm.session.json_text import number
from stiffarm.session.outputs import OutputFolder
from stiffarm.session.parsing import frame_words
from stiffarm.session.stated import stated_table
from surrogate.maps.assembled import counts, figures, map_data
from surrogate.maps.blocks import Engine, run_blocks
from surrogate.maps.cluster import run_on
from surrogate.maps.data import MapData
from surrogate.maps.poses import Extreme, shortfall
from surrogate.maps.quantities import STIFFNESS_ARRAY
from surrogate.maps.store import MapStore

Arrays = Mapping[str, NDArray[np.generic]]

# Points at which an extreme pose is sought again with a denser sample.
CHECKED = 12


@contextmanager
def evaluated(
    given: Arm, request: MapRequest, folder: OutputFolder, files: Files, progress: Progress | None = None
) -> Iterator[tuple[Engine, Arrays]]:
    """A map's blocks, made here or on a cluster: its engine, and its arrays, which are files until the context ends.

    Raises
    ------
    InputError
        A work folder or a cluster that cannot be used; a package that is missing.
    """
    engine = engine_of(request, given.description, given.model)
    # Inside the hidden stage, unless it is to outlive an interrupted run; the stage is emptied of it before the end.
    place = folder.stage / "work" if files.work is None else files.work
    store = MapStore(place, request.key, engine.grid.n, request.block, engine.columns)
    with folder.timed("map"):
        if files.dask is None:
            store.complete(lambda: run_blocks(engine, store, progress))
        else:
            address = files.dask
            store.complete(lambda: run_on(address, evaluate, request.text, store, progress))
    yield engine, store.finished()
    if files.work is None:
        shutil.rmtree(place)


def make_map(
    given: Arm, asked: Asked, folder: OutputFolder, files: Files, progress: Progress | None = None
) -> dict[str, Any]:
    """Make the map and write it; returns names of files and figures, as map.json has them.

    Raises
    ------
    InputError
        No point is reached; else as :func:`evaluated`.
    """
    with evaluated(given, asked.request, folder, files, progress) as (engine, arrays):
        data = map_data(engine, arrays, metadata(given, asked))
        if not np.any(data.reached):
            raise _out_of_reach(given, asked)
        content = statistics(engine, arrays, data, asked)
        warning = caveats(given)
        content["warning"] = warning or None
        content["messages"] += [warning] if warning else []
        content |= stated_table(given.model)
        with folder.timed("files"):
            names, messages = write_files(given, data, folder, files, np.array(asked.request.tool)[:3, 3])
        content["messages"] += messages
        if asked.request.pose is None and STIFFNESS_ARRAY in data.fields and data.layout.n <= DRAWN_UP_TO:
            content |= sweep.figures_of(data)
        content["files"] = [*names, "map.json"]
        folder.write_json("map.json", {"schema": "stiffarm-map/1", **content})
    return content


def statistics(engine: Engine, arrays: Arrays, data: MapData, asked: Asked) -> dict[str, Any]:
    """Figures of a map for map.json and the screen."""
    n, reached = data.layout.n, int(np.count_nonzero(data.reached))
    unsure = n - int(np.count_nonzero(arrays["sure"]))
    messages = [] if asked.note is None else [asked.note]
    if asked.note is None and unsure:
        messages.append(f"at {unsure} points the search may have missed a branch of the inverse kinematics")
    out: dict[str, Any] = {
        "grid": data.layout.kind,
        "axes": [
            {"name": a.name, "unit": a.unit, "first": a.values[0], "last": a.values[-1], "count": len(a.values)}
            for a in data.layout.axes
        ],
        "held_mm": dict(asked.grid.held),
        "pose": asked.pose_words,
        "grid_points": n,
        "points": reached,
        "share_reached": number(reached / n),
        "quantities": {},
        "messages": messages,
    }
    for name, field in data.fields.items():
        if field.categories:
            found = counts(field.values, len(field.categories))
            out["quantities"][name] = {
                "label": field.label,
                "share_of_points": {c: number(k / reached) for c, k in zip(field.categories, found, strict=True)},
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
            "min": number(of.least),
            "median": number(of.median),
            "max": number(highest.greatest),
            "median_of_points": of.median_of,
            "least_at": _place(data, of.row_of_least),
            "greatest_at": _place(data, highest.row_of_greatest),
        }
        if highest.greatest < of.greatest:
            out["quantities"][name]["max_near_singular"] = number(of.greatest)
    if isinstance(engine.rule, Extreme) and engine.arm is not None:
        out["search_check"] = _search_check(engine, engine.rule, data)
    return out


def _search_check(engine: Engine, rule: Extreme, data: MapData) -> dict[str, Any]:
    """By how much a denser search beats the map's at some of its points."""
    assert engine.arm is not None  # noqa: S101 - a rule has an arm
    step = max(1, data.layout.n // (64 * CHECKED))
    rows = np.flatnonzero(np.asarray(data.reached[::step]))
    rows = step * rows[np.linspace(0, len(rows) - 1, min(CHECKED, len(rows))).astype(int)] if len(rows) else rows
    if not len(rows):
        return {"points": 0, "worst_shortfall_percent": None}
    found = shortfall(
        rule, engine.arm, np.asarray(data.points[rows]), np.asarray(data.q[rows]), np.random.default_rng(engine.seed)
    )
    found = found[np.isfinite(found)]
    if not len(found):
        return {"points": 0, "worst_shortfall_percent": None}
    return {"points": len(found), "worst_shortfall_percent": number(100.0 * float(found.max()))}


def _place(data: MapData, row: int) -> dict[str, Any]:
    q = np.degrees(np.asarray(data.q[row]))
    return {
        "row": row,
        **{f"{name}_mm": number(1e3 * float(v)) for name, v in zip("xyz", data.points[row], strict=True)},
        **{name: number(float(v)) for name, v in zip(data.coordinates, q, strict=True)},
    }


def metadata(given: Arm, asked: Asked) -> dict[str, str]:
    """What the map is of, in words by name, as its files say it."""
    request = asked.request
    words = " ".join(f"{v + 0.0:.6g}" for v in request.direction)
    out = {
        "robot": given.robot.name,
        "model_hash": content_hash(given.description),
        "load": f"force along {words} (base axes)",
        "load_direction": words,
        "pose": asked.pose_words,
        "stiffness_from": "model",
        "links": given.model.link_kind,
        "load_path": given.model.load_path,
        "normal": " ".join(f"{v + 0.0:.6g}" for v in request.normal),
        "tool_on_flange": frame_words(np.array(request.tool)),
        "not_looked_at": "collisions; the way from point to point",
    }
    return out | warned(given) | {f"at_{name}": f"{v:g} mm" for name, v in asked.grid.held.items()}


def _out_of_reach(given: Arm, asked: Asked) -> InputError:
    if asked.request.pose is None:
        return InputError(
            f"map of {given.robot.name}: no pose of the sweep can be taken", code="S012", remedy="use other --layers"
        )
    free = asked.request.pose["rule"] in ("stiffest", "softest")
    pose = "" if free else f" with {asked.pose_words.split(', best')[0]}"
    return InputError(
        f"no point of the {asked.grid.kind} can be reached{pose}",
        code="S012",
        value=f"{asked.grid.n} points",
        allowed=f"within the reach of {given.robot.name}, about {asked.reach.words}",
        remedy="move or widen the grid" + (", or let the orientation be free: --pose stiffest" if pose else ""),
    )
