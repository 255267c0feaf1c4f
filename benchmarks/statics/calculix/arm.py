"""The whole shell arm in one pose as an input for CalculiX 2.20, so that an independent code can check our solution.

Shells: quads become S8R, triangles S6, with the mid-side nodes on straight edges, so that both codes see the same
facets. Everything else is linear equations between freedoms; nothing is penalised:

- *Rings*: CalculiX turns shells into solids and gives a shell node rotations only where the elements around it
  disagree about the normal. Thin beams along the ring, too soft to count, make them do so. Without the beams the
  wall is hinged to a rigid ring, some 3 % too soft in short links, and a distributing ring pulls at the faces of the
  wall, ever softer on finer meshes.
- *Rigid ring*: a RIGID BODY for the displacements, equations for the rotations.
- *Distributing ring*: its weighted mean motion is the interface's, by equations.
- *Joint*: the root of the next link follows the tip of the one before; each direction in which the joint gives way is
  a scalar freedom with a SPRING1. Bodies without a shell carry motions on.
- *Parallelogram*: the elbow's scalar freedom has no spring; the bar is a scalar freedom equal to the change of the
  pins' distance.

Equations nest (a ring follows its interface, that follows the link below), which CalculiX resolves by itself. But no
freedom may depend twice, and what follows hundreds of others makes whatever follows it do so as well: of a
distributing ring six freedoms, chosen by :func:`fem.elements.couplings.giving_way`, follow the interface and the ring's
rest.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from benchmarks.statics.calculix.deck import Deck, Freedom, ascii_text, number, safe_name
from benchmarks.statics.calculix.links import Motion, add_link, follow
from fem.compiled.compliance import deflection
from fem.model import ArmModel, LinkPart
from fem.reference.chain import Springs, build_chain
from fem.reference.shell_arm import all_links, mesh_of, one_pose
from robots import InputError
from robots.arrays import Array
from robots.constants import M_TO_MM
from robots.kinematics import forward_kinematics, tool_position

# Names of the six directions of a joint, the base or the tool.
DIRECTIONS = ("X", "Y", "Z", "RX", "RY", "RZ")
# What the names of sets begin with; axes and bearings with J.
KINDS = {"elbow": "ELBOW", "housing": "H", "law": "LAW"}


@dataclass(frozen=True)
class ArmDeck:
    """A CalculiX input and what it should give.

    ``sets``: meaning of each set by name. ``tool``: numbers of the tool point's node and rotation node.
    ``displacement`` (6,): what :func:`fem.deflection` gives for the tool point, m and rad, base axes.
    """

    text: str
    sets: dict[str, str]
    tool: tuple[int, int]
    displacement: Array
    nodes: int
    elements: int
    equations: int


@dataclass
class _Arm:
    """The deck while it grows: links written so far, nodes of scalar freedoms."""

    model: ArmModel
    deck: Deck = field(default_factory=Deck)
    links: int = 0
    scalars: list[int] = field(default_factory=list)

    def ground(self) -> Motion:
        return Motion((), np.zeros((6, 0)))

    def carried(self, motion: Motion, r: Array) -> Motion:
        return motion.carried(r[0])

    def linked(self, link: LinkPart, root: Motion, R: Array, origin: Array) -> dict[str, Motion]:
        self.links += 1
        return add_link(self.deck, link, self.links, root, R[0], origin[0])

    def scalar(self, name: str, what: str, at: Array, stiffness: float | None) -> Freedom:
        """A node at ``at`` (3,) m whose direction 1 is a relative motion, with its spring (N/mm, N mm/rad)."""
        freedom = self.deck.scalar(M_TO_MM * at, name, f"direction 1 is {what}", stiffness)
        self.scalars.append(freedom[0])
        return freedom

    def sprung(self, motion: Motion, springs: Springs) -> Motion:
        """A scalar freedom for each direction, whose spring is in SI; none where the direction is free."""
        name, at = self._name(springs), springs.at[0]
        if springs.where in ("axis", "elbow"):
            return self._turned(motion, springs, name, at)
        given = np.broadcast_to(springs.directions, (1, *springs.directions.shape[-2:]))[0]
        columns = zip(given.T, springs.turned[0].T, springs.stiffness[0].tolist(), strict=True)
        for k, (direction, column, stiffness) in enumerate(columns):
            shift = not direction[3:].any()
            label = DIRECTIONS[int(np.argmax(direction))] if np.sum(direction != 0.0) == 1 else f"S{k + 1}"
            unit, scale = ("mm", 1.0 / M_TO_MM) if shift else ("rad", M_TO_MM)
            way = column if shift else column * ([M_TO_MM] * 3 + [1.0] * 3)
            what = f"relative motion {label.lower()} ({unit}) of {name.lower()}, its own axes"
            motion = motion.plus(self.scalar(f"{name}_{label}", what, at, scale * stiffness), way)
        return motion

    def _turned(self, motion: Motion, springs: Springs, name: str, at: Array) -> Motion:
        """A turn about a joint's axis."""
        assert springs.joint is not None
        free = springs.where == "elbow"
        what = f"the turn (rad) about the axis of joint {ascii_text(self.model.joints[springs.joint].name)}"
        what += "; it is free, for the actuator sits at the crank" if free else ""
        freedom = self.scalar(name, what, at, None if free else M_TO_MM * float(springs.stiffness[0, 0]))
        return motion.plus(freedom, springs.turned[0, :, 0])

    def _name(self, springs: Springs) -> str:
        if springs.joint is None:
            return springs.where.upper()
        return _name(KINDS.get(springs.where, "J"), springs.joint + 1, self.model.joints[springs.joint].name)


def arm_deck(
    model: ArmModel, q: ArrayLike, wrench: ArrayLike, point: ArrayLike | None = None, *, title: Sequence[str] = ()
) -> ArmDeck:
    """Write the shell arm in one pose under one load.

    Parameters
    ----------
    model : built with ``links="shell"`` or ``"solid"``, either load path
    q : (dof,) rad; limits are not checked here
    wrench : (6,) force N and moment N m in base axes at the tool point
    point : (3,) m in the flange frame instead of the model's tool point
    title : lines for the header: which model, which pose

    Raises
    ------
    InputError
        Links that are not shells, more than one pose or load, values that are not finite, a flat parallelogram, or
        an interface whose ring has no edges.
    """
    pose, loads, at = one_pose(model, q, wrench, point)
    if len(loads) != 1:
        raise InputError("loads of a CalculiX input", code="M003", value=len(loads), allowed="one")
    if not model.links:
        raise InputError(f"links of {model.robot.name}", code="M003", value=model.link_kind, allowed="shell, solid")
    for link in all_links(model):
        mesh_of(link)
    expected = deflection(model, pose, loads, at)[0]
    frames = forward_kinematics(model.robot, pose)
    position = tool_position(model.robot, frames, at)
    arm = _Arm(model)
    chain = build_chain(model, frames, pose, position, arm)
    p = model.robot.parallelogram
    if chain.pins is not None and p is not None:
        _bar(arm, *chain.pins, chain.span[0], frames.p[0, p.crank_about + 1])
    tool = _tool(arm.deck, chain.tool, position[0])
    if arm.scalars:
        arm.deck.node_set(arm.scalars, "SCALARS", "the scalar freedoms of joints and bar")
    header = [*title, *_header(arm.deck, loads[0], expected)]
    text = arm.deck.text(header, _step(arm, loads[0], tool))
    deck = arm.deck
    return ArmDeck(text, deck.sets, tool, expected, deck.nodes_made, deck.elements_made, deck.equations_made)


def _name(kind: str, number: int, name: str) -> str:
    """Name of a set: the number keeps apart what looks alike once it is spelt in ASCII."""
    return f"{kind}{number}_{safe_name(name)}".rstrip("_")


def _bar(arm: _Arm, crank: Motion, pin: Motion, span: Array, at: Array) -> None:
    """The bar between its pins: its elongation has a spring, or is zero if the bar is rigid."""
    assert arm.model.bar is not None
    u = np.concatenate([span / np.linalg.norm(span), np.zeros(3)])
    elongation = pin.along(u)
    for freedom, coefficient in crank.along(-u).items():
        elongation[freedom] = elongation.get(freedom, 0.0) + coefficient
    compliance = arm.model.bar.compliance
    if compliance > 0.0:
        what = "the elongation (mm) of the parallelogram's bar"
        arm.deck.equation(arm.scalar("BAR", what, at, 1.0 / (M_TO_MM * compliance)), elongation)
        return
    pivot = max((f for f in elongation if not arm.deck.depends(f)), key=lambda f: abs(elongation[f]))
    arm.deck.equation(pivot, {f: -c / elongation[pivot] for f, c in elongation.items() if f != pivot})


def _tool(deck: Deck, motion: Motion, position: Array) -> tuple[int, int]:
    at = M_TO_MM * position[None]
    node = int(deck.nodes(at, "TOOL", "the tool point, where the load acts; directions 1 to 3: displacement (mm)")[0])
    rotation = int(deck.nodes(at, "TOOL_ROT", "the same; directions 1 to 3: rotation (rad)")[0])
    follow(deck, node, rotation, motion)
    return node, rotation


def _header(deck: Deck, wrench: Array, expected: Array) -> Iterator[str]:
    """What the file holds and what stiffarm's own solution is."""
    yield ""
    yield "Units: mm, N, MPa, rad. Axes: the robot's base (X forward, Z up). Run it with: ccx arm"
    force, moment = (", ".join(f"{v:g}" for v in part) for part in (wrench[:3], wrench[3:]))
    yield f"Load at the tool point: force ({force}) N, moment ({moment}) N m, base axes. Linear static."
    yield ""
    yield "What stiffarm's own solution gives for the tool point (arm.dat: node sets TOOL and TOOL_ROT):"
    yield "displacement (mm): " + " ".join(f"{M_TO_MM * v:.6g}" for v in expected[:3])
    yield "rotation (rad):    " + " ".join(f"{v:.6g}" for v in expected[3:])
    yield ""
    yield f"{deck.nodes_made} nodes, {deck.elements_made} elements. What each set is:"
    for name, what in deck.sets.items():
        yield f"{name}: {what}"
    yield ""


def _step(arm: _Arm, wrench: Array, tool: tuple[int, int]) -> Iterator[str]:
    yield "*CLOAD"
    for i, value in enumerate(wrench.tolist()):
        if value != 0.0:
            yield f"{tool[0]},{i + 1},{number(value)}" if i < 3 else f"{tool[1]},{i - 2},{number(M_TO_MM * value)}"
    for name in ("TOOL", "TOOL_ROT", *(["SCALARS"] if arm.scalars else [])):
        yield f"*NODE PRINT,NSET={name}"
        yield "U"
    yield "*NODE FILE"
    yield "U"
    yield "*EL FILE"
    yield "S"
