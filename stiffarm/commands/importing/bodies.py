"""The bodies of a URDF: their names and surfaces, which can become links, and why the others stay rigid."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from meshes.beams import body_index, body_tip
from meshes.surfaces.bodies import BodySurface, body_surface, link_interfaces
from meshes.surfaces.reading import check_scale
from meshes.surfaces.seats import ALONG
from robots import InputError, Robot
from robots.arrays import Array
from robots.urdf.reading import UrdfRobot, Visual
from stiffarm.commands.importing.request import ImportRequest

# Joints this near to each other, over the longest way between two, have a wrist body between them.
SHORT = 0.08
# Of the way from root to tip, that a body's shapes must span.
LEAST_COVER = 0.3
# Bodies are as large as their joints are apart, give or take; beyond, the unit of length is in doubt.
SPAN_RATIO = (0.1, 12.0)
NAMES_OF_PARTS = ("base", "tool", "bar", "crank")
INTERFACES = ("root", "tip", "pin")


@dataclass(frozen=True)
class Bodies:
    """Bodies of a robot in order from the base.

    ``names``: of their links. ``surfaces``: by body, kinds of meshes in the order in which they are tried. ``faults``:
    by body, what is wrong with shapes that are none of these. ``rigid``: why a body is no link. ``lost``: mesh
    files that are not there, and have no other in their place.
    """

    order: tuple[str, ...]
    names: dict[str, str]
    surfaces: dict[str, dict[str, BodySurface]]
    faults: dict[str, tuple[InputError, ...]]
    rigid: dict[str, str]
    lost: tuple[InputError, ...] = ()

    @property
    def links(self) -> tuple[str, ...]:
        """Bodies to make links of."""
        return tuple(body for body in self.order if body not in self.rigid)

    def seen(self, index: int) -> BodySurface | None:
        """The first surface of a body by its number, for its neighbours; None where it has none."""
        found = self.surfaces.get(self.order[index], {}) if 0 <= index < len(self.order) else {}
        return next(iter(found.values()), None)


def bodies_of(urdf: UrdfRobot, robot: Robot, asked: ImportRequest) -> Bodies:
    """Read the shapes of all bodies and sort them out.

    Raises
    ------
    InputError
        Names in the request that no link has.
    """
    kinds = ("visual", "collision") if asked.meshes == "auto" else (asked.meshes,)
    shapes = {"visual": urdf.visuals, "collision": urdf.collisions}
    names = link_names(robot, {body: v for kind in reversed(kinds) for body, v in shapes[kind].items()})
    _check_names(names, asked, urdf, kinds)
    order = ("base", *robot.joint_names)
    surfaces: dict[str, dict[str, BodySurface]] = {body: {} for body in order}
    faults: dict[str, tuple[InputError, ...]] = dict.fromkeys(order, ())
    for body in order:
        for kind in kinds:
            faults[body] += tuple(error for link, error in _missing(urdf, kind, asked) if link == names[body])
            if body not in shapes[kind]:
                continue
            try:
                surface = body_surface(shapes[kind][body])
                if not {names[body], body} & set(asked.rigid or ()):
                    _check_scale(robot, body, names[body], surface)
                surfaces[body][kind] = surface
            except InputError as error:
                if not {names[body], body} & set(asked.rigid or ()):
                    faults[body] += (error,)
    rigid = _staying_rigid(robot, names, surfaces, asked, kinds)
    rigid = {body: why for body, why in rigid.items() if surfaces[body] or not faults[body]}
    found = {visual.link for kind in kinds for several in shapes[kind].values() for visual in several}
    lost = {link: error for kind in kinds for link, error in _missing(urdf, kind, asked) if link not in found}
    return Bodies(order, names, surfaces, faults, rigid, tuple(lost.values()))


def link_names(robot: Robot, shapes: Mapping[str, Sequence[Visual]]) -> dict[str, str]:
    """Names of the bodies' links: the URDF's own where the model has no other part of that name."""
    taken = {*robot.joint_names, *NAMES_OF_PARTS}
    names: dict[str, str] = {}
    for body in ("base", *robot.joint_names):
        own = next((visual.link for visual in shapes.get(body, ()) if visual.link), body)
        while own in taken:
            own = f"{own}_link"
        taken.add(own)
        names[body] = own
    return names


def _check_names(names: Mapping[str, str], asked: ImportRequest, urdf: UrdfRobot, kinds: Sequence[str]) -> None:
    known = {*names, *names.values(), *(link for kind in kinds for link, _ in urdf.missing.get(kind, ()))}
    at = {f"{name}.{end}" for name in known for end in INTERFACES}
    named = (
        ("--wall", asked.wall or (), known),
        ("--rigid", asked.rigid or (), known),
        ("--radius", asked.radius or (), known | at),
    )
    for option, given, allowed in named:
        for name in given:
            if name not in allowed:
                raise InputError(
                    f"{option}: link",
                    code="L010",
                    value=name,
                    allowed=", ".join(names.values()),
                    remedy="name links as the URDF",
                )


def _missing(urdf: UrdfRobot, kind: str, asked: ImportRequest) -> list[tuple[str, InputError]]:
    """Links of the URDF whose mesh files of a kind are not there, and what to say of each."""
    remedy = "put the file there, or set ROS_PACKAGE_PATH to the folder of the package"
    return [
        (link, InputError(note, code="L001", remedy=remedy))
        for link, note in urdf.missing.get(kind, ())
        if link not in (asked.rigid or ())
    ]


def expected_span(robot: Robot, body: str) -> float:
    """How large a body should be (m): as its joints are apart, where that is not much less than for others."""
    longest = max(float(np.linalg.norm(T[:3, 3])) for T in robot.T_pre)
    return max(float(np.linalg.norm(body_tip(robot, body_index(robot, body)))), 0.25 * longest)


def _check_scale(robot: Robot, body: str, name: str, surface: BodySurface) -> None:
    """Refuse shapes in a wrong unit: small ones would else pass as too short to matter."""
    try:
        check_scale(name, surface.nodes, np.zeros((1, 3)), expected_span(robot, body), SPAN_RATIO)
    except InputError as error:
        remedy = f"{error.remedy}; in a URDF that is <mesh ... scale=...>"
        raise InputError(
            error.what, code=error.code, value=error.value, allowed=error.allowed, remedy=remedy
        ) from error


def _staying_rigid(
    robot: Robot,
    names: Mapping[str, str],
    surfaces: Mapping[str, Mapping[str, BodySurface]],
    asked: ImportRequest,
    kinds: Sequence[str],
) -> dict[str, str]:
    """Bodies that become no link, and why."""
    ends = {body: link_interfaces(robot, i) for i, body in enumerate(surfaces)}
    tips = {body: both["tip"].point for body, both in ends.items()}
    longest = max(float(np.linalg.norm(tip)) for tip in tips.values())
    rigid = {}
    for body, found in surfaces.items():
        span = float(np.linalg.norm(tips[body]))
        covers = [_cover(one.nodes, tips[body], ends[body]["root"].axis) for one in found.values() if span > 0.0]
        if {names[body], body} & set(asked.rigid or ()):
            rigid[body] = "asked for"
        elif not found:
            rigid[body] = f"no {' or '.join(kinds)} mesh"
        elif span <= SHORT * longest:
            rigid[body] = f"root and tip only {1e3 * span:.3g} mm apart"
        elif max(covers) < LEAST_COVER:
            rigid[body] = f"its shapes span {100 * max(covers):.0f} % of the way from root to tip"
    return rigid


def _cover(nodes: Array, tip: Array, axis: Array | None) -> float:
    """Share of the way from the origin to ``tip`` that the nodes span.

    A joint whose axis runs along the way may have its origin anywhere on it: the way then begins where the nodes do.
    """
    share = nodes @ tip / (tip @ tip)
    first, last = max(float(share.min()), 0.0), min(float(share.max()), 1.0)
    along = axis is not None and abs(float(axis @ tip)) >= ALONG * float(np.linalg.norm(axis) * np.linalg.norm(tip))
    return max(last - first, 0.0) / (max(1.0 - first, 1e-9) if along else 1.0)
