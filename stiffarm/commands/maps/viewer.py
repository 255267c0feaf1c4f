"""The map as one page that opens without a network: turn it, cut it, pick a point and see the robot there."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from fem import ArmModel
from fem.statics.budget import part_kinds
from robots import InputError, ModelDescription, content_hash, singularity_distance
from robots.arrays import Array, Bools
from robots.constants import NORMAL_95
from robots.inverse.singularities import NEAR_SINGULAR
from robots.robot import Robot, middle_pose
from stiffarm import __version__
from stiffarm.pages.bars import part_colours
from stiffarm.pages.parts import chain_data, column_matrix, packed, render_page
from stiffarm.pages.robot_drawing import ROBOT_COLOURS, DrawnBody, framed_bodies
from stiffarm.pages.style import OKABE_ITO, STIFFNESS_COLOURS
from surrogate.maps.data import Field, Layout, MapData, figures
from surrogate.portable import evaluator_script

# More points than these are thinned: about 120 bytes each in the file.
MOST_POINTS: Final = 200_000
# Significant digits that the page shows of a quantity, and that survive its storage in single precision.
DIGITS: Final = 5
# Metres that a point may lie under the floor, or under the base's skin, and still be at it.
FLOOR: Final = 1e-6
# Parts that nowhere reach this share show as 0.0 %.
_LEAST_SHARE = 5e-4
_NO_SHARE = 0xFFFF
_CATEGORY_COLOURS = tuple(OKABE_ITO[c] for c in ("blue", "orange", "green", "vermillion", "sky", "purple", "yellow"))
# Of links, bar and crank along the chain, apart from each other and from the joints' colours (three of them from Paul
# Tol's "muted" scheme): on a map they lie side by side, where greys could not be told apart.
_STRUCTURE_COLOURS = ("#7B848D", "#882255", "#F0E442", "#332288", "#222222", "#999933", "#D5D9DD", "#6F4E37")
_SCRIPTS = (
    "page_matrices.js",
    "map_viewer_data.js",
    "map_viewer_scene.js",
    "map_viewer_whatif.js",
    "map_viewer_beside.js",
    "map_viewer_shapes.js",
    "map_viewer_draw.js",
    "map_viewer_labels.js",
    "map_viewer_panel.js",
)


def viewer_page(
    data: MapData,
    description: ModelDescription,
    model: ArmModel,
    *,
    title: str,
    what_if: Mapping[str, Any] | None = None,
) -> str:
    """The page as HTML text; what comes from files is escaped.

    Parameters
    ----------
    data : the map; of more than ``MOST_POINTS`` points every second, third ... along its axes is kept, and said so
    description, model : of the robot that the map was made with: its shape, and its kinematics and parts
    what_if : of :func:`stiffarm.commands.maps.what_if.what_if_data`, for sliders of the springs and the ellipsoid

    A map that has 'uncertainty_percent' has intervals: with 1.96 times it as the share e of the compliance, the
    stiffness K lies between K/(1+e) and K/(1-e).

    Raises
    ------
    InputError
        Another robot's map, or no point at all that the robot reaches.
    """
    kept = thinned(data)
    remarks = _thinned_words(data.layout, kept.layout)
    return render_page(
        "map_viewer.html.j2",
        viewer_data(kept, description, model, title=title, what_if=what_if),
        _SCRIPTS,
        evaluator_script(),
        title=title,
        robot=description.title,
        quantities=_summaries(data),
        about=[*data.metadata.items()],
        notes=remarks,
        thinned=remarks,
        hash=content_hash(description),
        version=__version__,
        load=_load(data),
        digits=DIGITS,
        near=NEAR_SINGULAR,
        caution=data.metadata.get("warning", ""),
    )


def viewer_data(
    data: MapData,
    description: ModelDescription,
    model: ArmModel,
    *,
    title: str = "",
    what_if: Mapping[str, Any] | None = None,
) -> dict[str, Any]:
    """Everything that the page shows; arrays as base64, little end first. Arguments as of :func:`viewer_page`."""
    robot = model.robot
    _check(data, description, model)
    layout, shown = data.layout, _shown_parts(data)
    kinds = part_kinds(model, data.parts)
    colours = part_colours(data.parts, kinds, _STRUCTURE_COLOURS)
    uncertainty = data.fields.get("uncertainty_percent")
    bodies = framed_bodies(description, robot)
    return {
        "robot": {"name": description.name, "title": description.title},
        "title": title,
        "warning": data.metadata.get("warning", ""),
        **(what_if or {"surrogate": None, "springs": [], "direction": [0.0, 0.0, -1.0]}),
        "left_out": packed(_left_out(data.points, bodies), "<u1"),
        "chain": chain_data(robot),
        "tool": column_matrix(robot.T_flange_tool),
        "bodies": [
            {
                "name": body.name,
                "role": body.role,
                "frame": body.frame,
                "colour": ROBOT_COLOURS[body.role],
                "v": packed(body.mesh.vertices, "<f4"),
                "t": packed(body.mesh.faces, "<u4"),
            }
            for body in bodies
        ],
        "rest": middle_pose(robot).tolist(),
        "coordinates": list(data.coordinates),
        "limits": robot.limits.tolist(),
        "n": layout.n,
        "kind": layout.kind,
        "axes": [{"name": a.name, "unit": a.unit, "values": a.values.tolist()} for a in layout.axes],
        "points": [column(x) for x in data.points.T],
        "q": [column(x) for x in data.q.T],
        "reached": packed(data.reached, "<u1"),
        "near_singular": packed(_near_singular(data, robot), "<u1"),
        "fields": [_field(name, f, colours) for name, f in data.fields.items()],
        "error": None if uncertainty is None else column(NORMAL_95 / 100.0 * uncertainty.values),
        "error_of": stiffness_field(data),
        "parts": [{"name": data.parts[i], "kind": kinds[i], "colour": colours[data.parts[i]]} for i in shown],
        "shares": _shares(data, shown),
        "digits": DIGITS,
        "colours": packed(np.round(255.0 * STIFFNESS_COLOURS(np.linspace(0.0, 1.0, 256))[:, :3]), "<u1"),
    }


def thinned(data: MapData, most: int = MOST_POINTS) -> MapData:
    """The map that the page holds: every k-th point along the axes of a large one.

    The steps of an axis stay even, so slices and cells stay what they are.
    """
    layout = data.layout
    strides = [1] * len(layout.axes)
    sizes = list(layout.shape)
    while np.prod(sizes, dtype=np.int64) > most:
        axis = int(np.argmax(sizes))
        strides[axis] += 1
        sizes[axis] = -(-layout.shape[axis] // strides[axis])
    if max(strides) == 1:
        return data
    # What does not divide evenly is lost on both sides alike.
    picks = [np.arange((m - 1) % s // 2, m, s) for m, s in zip(layout.shape, strides, strict=True)]
    axes = tuple(replace(a, values=a.values[k]) for a, k in zip(layout.axes, picks, strict=True))
    rows = np.ravel_multi_index(np.meshgrid(*picks, indexing="ij"), layout.shape).ravel()
    return replace(
        data,
        layout=replace(layout, axes=axes),
        points=data.points[rows],
        q=data.q[rows],
        reached=data.reached[rows],
        fields={name: replace(f, values=f.values[rows]) for name, f in data.fields.items()},
        shares=None if data.shares is None else data.shares[rows],
    )


def column(values: Array) -> dict[str, str]:
    """A column (n,) of numbers: an index into its distinct values in full where they are few, else single precision.

    Of single-precision numbers ``DIGITS`` significant digits are those of ``values``.
    """
    distinct, index = np.unique(values, return_inverse=True)
    if len(distinct) <= min(0x10000, max(256, len(values) // 8)):
        kind = "u1" if len(distinct) <= 0x100 else "u2"
        return {"kind": kind, "data": packed(index, f"<{kind}"), "table": packed(distinct, "<f8")}
    return {"kind": "f4", "data": packed(single(values), "<f4")}


def single(values: Array, digits: int = DIGITS) -> NDArray[np.float32]:
    """Values (n,) as float32 that round to the same ``digits`` significant digits."""
    out = values.astype(np.float32)
    size = np.abs(values)
    usable = np.isfinite(values) & (size > 1e-30) & (size < 1e30)
    scaled = size[usable] / 10.0 ** (np.floor(np.log10(size[usable])) - (digits - 1))
    # float32 moves five digits by up to 0.006 of the last one; only ties nearer than that can tip over.
    for i in np.flatnonzero(usable)[np.abs(scaled % 1.0 - 0.5) < 0.02]:
        wanted = f"{values[i]:.{digits - 1}e}"
        if f"{float(out[i]):.{digits - 1}e}" != wanted:
            out[i] = np.nextafter(out[i], np.float32(wanted))
    return out


def stiffness_field(data: MapData) -> int | None:
    """Number of the field that an error bar belongs to: the first one in N/mm."""
    return next((i for i, f in enumerate(data.fields.values()) if f.unit == "N/mm"), None)


def _check(data: MapData, description: ModelDescription, model: ArmModel) -> None:
    names = tuple(joint.coordinate for joint in description.joint)
    for what, given in (("model", model.robot.coordinates), ("map", data.coordinates)):
        if given != names:
            raise InputError(
                f"map page: joint coordinates of the {what}",
                code="B002",
                value=", ".join(given),
                allowed=", ".join(names),
                remedy=f"give the description and the {what} of one robot",
            )
    if not np.any(data.reached):
        raise InputError("map page: points that the robot reaches", code="B002", value=0, allowed="at least one")
    if not data.fields:
        raise InputError("map page: quantities", code="B002", value=0, allowed="at least one")


def _near_singular(data: MapData, robot: Robot) -> Bools:
    """The map's own flag, or the same one computed here."""
    own = data.fields.get("near_singular")
    if own is not None:
        return np.asarray(own.values == 1.0)
    near = np.zeros(len(data.q), dtype=bool)
    posed = data.reached & np.isfinite(data.q).all(axis=1)
    near[posed] = singularity_distance(robot, data.q[posed]).sigma_min < NEAR_SINGULAR
    return near


def _left_out(points: Array, bodies: Sequence[DrawnBody]) -> NDArray[np.uint8]:
    """Points (n, 3) m that no tool gets to: 1 under the floor that the base stands on, 2 inside the base; else 0.

    Bodies are convex, so a point is inside where it lies behind all their faces.
    """
    out = np.zeros(len(points), dtype=np.uint8)
    known = np.isfinite(points).all(axis=1)
    out[known & (points[:, 2] < -FLOOR)] = 1
    for body in (body for body in bodies if body.frame == 0):
        hull = ConvexHull(np.asarray(body.mesh.vertices)).equations
        inside = np.zeros(len(points), dtype=np.bool_)
        inside[known] = (points[known] @ hull[:, :3].T + hull[:, 3] < -FLOOR).all(axis=1)
        out[inside] = 2
    return out


def _field(name: str, f: Field, colours: dict[str, str]) -> dict[str, Any]:
    values = np.asarray(f.values, dtype=np.float64)
    return {
        "name": name,
        "label": f.label,
        "unit": f.unit,
        "categories": [
            {"name": c, "colour": colours.get(c, _CATEGORY_COLOURS[i % len(_CATEGORY_COLOURS)])}
            for i, c in enumerate(f.categories)
        ],
        # Warm is stiff: 1 where a large value is stiff, -1 where it is soft, 0 where it is neither.
        "stiff": 1 if f.unit.startswith(("N/", "kN/", "N m/")) else -1 if f.unit.endswith(("/N", "/kN", "/N m")) else 0,
        "values": column(np.where(values < 0.0, np.nan, values) if f.categories else values),
    }


def _shown_parts(data: MapData) -> list[int]:
    shares = np.zeros((0, 0)) if data.shares is None else data.shares
    return [i for i in range(shares.shape[1]) if np.any(shares[:, i] >= _LEAST_SHARE)]


def _shares(data: MapData, shown: list[int]) -> str:
    """Shares in tenths of a per cent, as the page writes them; (n, shown parts)."""
    if data.shares is None or not shown:
        return ""
    tenths = np.rint(1e3 * data.shares[:, shown])
    return packed(np.where(np.isfinite(tenths), tenths, _NO_SHARE), "<u2")


def _thinned_words(whole: Layout, kept: Layout) -> list[str]:
    if kept.n == whole.n:
        return []
    steps = [
        f"{len(b.values)} of {len(a.values)} along {a.name.removesuffix('_deg')}"
        for a, b in zip(whole.axes, kept.axes, strict=True)
        if len(b.values) < len(a.values)
    ]
    return [f"This page holds {kept.n:,} of the map's {whole.n:,} points, evenly thinned: {', '.join(steps)}."]


def _summaries(data: MapData) -> list[tuple[str, ...]]:
    """Least, median and largest value of each quantity that is a number, as text without any script."""
    numbers = [f for f in data.fields.values() if not f.categories]
    found = [(f, figures(np.where(data.reached, f.values, np.nan))) for f in numbers]
    return [(f.label, *(f"{x:.5g}" for x in (of.least, of.median, of.greatest)), f.unit) for f, of in found if of]


def _load(data: MapData) -> str:
    """What the map's metadata says of the load first."""
    words = [str(w) for name, w in data.metadata.items() if "load" in name.lower() and "path" not in name.lower()]
    return words[0] if words else ""
