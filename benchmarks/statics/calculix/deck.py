"""An input file for CalculiX in the making: nodes, sets, elements, equations, and its text. Units mm, N, MPa.

CalculiX 2.20 reads fields of at most 20 characters and names of at most 80, and it takes a dependent freedom
once: one that stands first in two equations, or is fixed as well, stops it. :class:`Deck` sees to that and
raises RuntimeError where a caller asks for such a thing.
"""

from __future__ import annotations

import re
import textwrap
import unicodedata
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from meshes import ShellMesh
from robots.arrays import Array, Integers

Freedom = tuple[int, int]  # node and direction 1 to 6; 4 to 6 are rotations, which only shell nodes have

PA_PER_MPA = 1e6
# Coefficients below this share of an equation's largest are round-off of products of cosines.
SMALLEST_SHARE = 1e-14
_NAME = re.compile("[A-Z0-9_]{1,80}")
_SPELT = str.maketrans({"ä": "ae", "ö": "oe", "ü": "ue", "Ä": "Ae", "Ö": "Oe", "Ü": "Ue", "ß": "ss"})
_LONGEST_PART = 40
_LONGEST_COMMENT = 110


@dataclass(frozen=True)
class QuadraticMesh:
    """A shell mesh with a node in the middle of each straight edge.

    ``nodes`` (k + e, 3) m: the mesh's k nodes, then the middles; ``edges`` (e, 2) ends of each edge;
    ``triangles`` (m, 6) and ``quads`` (q, 8): corners, then the middles of the sides in turn.
    """

    nodes: Array
    edges: Integers
    triangles: Integers
    quads: Integers

    @property
    def corners(self) -> int:
        """Number of nodes the mesh had before."""
        return len(self.nodes) - len(self.edges)

    def edges_within(self, ring: Integers) -> Integers:
        """Numbers of the edges with both ends in a ring of nodes."""
        inside = np.zeros(self.corners, dtype=bool)
        inside[ring] = True
        return np.flatnonzero(inside[self.edges].all(axis=1))


def with_middles(mesh: ShellMesh) -> QuadraticMesh:
    """Put a node in the middle of every edge of a shell mesh."""
    edges, side = np.unique(np.sort(mesh.edges, axis=1), axis=0, return_inverse=True)
    middles = mesh.nodes[edges].mean(axis=1)
    side = side.ravel() + len(mesh.nodes)
    sides_of_triangles = mesh.triangles.size
    return QuadraticMesh(
        np.vstack([mesh.nodes, middles]),
        edges,
        np.hstack([mesh.triangles, side[:sides_of_triangles].reshape(-1, 3)]),
        np.hstack([mesh.quads, side[sides_of_triangles:].reshape(-1, 4)]),
    )


def safe_name(text: str) -> str:
    """A part of a set's name: at most 40 capitals, digits and underscores; empty if nothing is left."""
    return re.sub("[^A-Z0-9]+", "_", ascii_text(text).upper()).strip("_")[:_LONGEST_PART].rstrip("_")


def ascii_text(text: str) -> str:
    """Printable ASCII on one line: accents are dropped, anything else becomes a question mark."""
    plain = unicodedata.normalize("NFKD", text.translate(_SPELT))
    return "".join(c if c.isascii() and c.isprintable() else "?" for c in plain if not unicodedata.combining(c))


def comment(text: str) -> str:
    """A comment of one line or more: it cannot become a keyword, whatever the text holds."""
    plain = ascii_text(text)
    lines = textwrap.wrap(
        plain, _LONGEST_COMMENT, subsequent_indent="  ", break_long_words=False, break_on_hyphens=False
    )
    return "".join(f"** {line}".rstrip() + "\n" for line in lines or [""])


def number(value: float) -> str:
    """A finite number with twelve digits and a decimal point in at most 20 characters.

    Without the point CalculiX takes a spring's constant for the direction it acts in.
    """
    if not np.isfinite(value):
        raise RuntimeError(f"{value} in a CalculiX input")
    mantissa, e, exponent = f"{value + 0.0:.12g}".partition("e")  # + 0.0: no minus zero
    return f"{mantissa}{'' if '.' in mantissa else '.'}{e}{exponent}"


class Deck:
    """What stands in the input file; numbers of nodes and elements start at 1 and run through.

    ``sets``: name and meaning of each node set, element set and section, in the order they were made.
    """

    def __init__(self) -> None:
        self.sets: dict[str, str] = {}
        self.nodes_made = 0
        self.elements_made = 0
        self.equations_made = 0
        self._dependent: set[Freedom] = set()
        self._nodes: list[str] = []
        self._elements: list[str] = []
        self._named: list[str] = []
        self._properties: list[str] = []
        self._materials: dict[tuple[float, float], str] = {}
        self._ties: list[str] = []
        self._fixed: list[str] = []

    def nodes(self, points: Array, name: str, what: str) -> Integers:
        """Add nodes at ``points`` (k, 3) mm as a node set; returns their numbers (k,)."""
        self._name(name, f"{_span('node', self.nodes_made + 1, len(points))}: {what}")
        numbers = self.nodes_made + 1 + np.arange(len(points))
        self.nodes_made += len(points)
        rows = (f"{n},{number(x)},{number(y)},{number(z)}\n" for n, (x, y, z) in zip(numbers, points, strict=True))
        self._nodes += [f"*NODE,NSET={name}\n", *rows]
        return numbers

    def node_set(self, numbers: Iterable[int], name: str, what: str) -> None:
        """Name a set of nodes."""
        self._name(name, f"node set: {what}")
        self._named += [f"*NSET,NSET={name}\n", _rows(list(numbers))]

    def elements(self, kind: str, nodes: Integers, name: str, what: str) -> None:
        """Add elements of a CalculiX type from their nodes' numbers (e, n) as an element set."""
        first = self.elements_made + 1
        self._name(name, f"{_span('element', first, len(nodes))} ({kind}): {what}")
        self.elements_made += len(nodes)
        lines = (",".join(map(str, [first + i, *row])) + "\n" for i, row in enumerate(nodes.tolist()))
        self._elements += [f"*ELEMENT,TYPE={kind},ELSET={name}\n", *lines]

    def element_set(self, members: Sequence[str], name: str, what: str) -> None:
        """Name a set of elements that other sets make up."""
        self._name(name, f"element set: {what}")
        self._named += [f"*ELSET,ELSET={name}\n", "".join(f"{member},\n" for member in members)]

    def material(self, youngs_modulus: float, poissons_ratio: float) -> str:
        """Name of the material with that modulus (Pa) and ratio; equal ones are shared."""
        return self._materials.setdefault((youngs_modulus, poissons_ratio), f"MATERIAL{len(self._materials) + 1}")

    def section(self, keyword: str, *lines: str) -> None:
        """Add a section or a spring's constant: a keyword line and its data lines."""
        self._properties.append("".join(f"{line}\n" for line in (keyword, *lines)))

    def scalar(self, at: Array, name: str, what: str, stiffness: float | None) -> Freedom:
        """Add a node at ``at`` (3,) mm for one scalar freedom, its direction 1, with a spring (N/mm, N mm/rad)."""
        node = int(self.nodes(at[None], name, what)[0])
        if stiffness is not None:
            self.elements("SPRING1", np.array([[node]]), f"K_{name}", f"spring of {name}, k = {number(stiffness)}")
            self.section(f"*SPRING,ELSET=K_{name}", "1", number(stiffness))
            # CalculiX counts all three directions of an element's nodes.
            self.equation((node, 2), {})
            self.equation((node, 3), {})
        return node, 1

    def rigid_body(self, ring: str, nodes: Iterable[int], reference: int, rotation: int) -> None:
        """Let a set's nodes move, displacements only, as a rigid body with the reference and rotation nodes."""
        self._ties.append(f"*RIGID BODY,NSET={ring},REF NODE={reference},ROT NODE={rotation}\n")
        for node in nodes:
            for direction in (1, 2, 3):
                self._depend((node, direction))

    def equation(self, dependent: Freedom, terms: Mapping[Freedom, float]) -> None:
        """``u(dependent) = sum of coefficient u(freedom)``; without terms the freedom is fixed."""
        self._depend(dependent)
        largest = max((abs(c) for c in terms.values()), default=0.0)
        kept = {f: c for f, c in terms.items() if abs(c) > SMALLEST_SHARE * largest}
        if not kept:
            self._fixed.append(f"{dependent[0]},{dependent[1]},{dependent[1]}\n")
            return
        self.equations_made += 1
        entries = [(dependent, 1.0), *((f, -c) for f, c in kept.items())]
        text = [f"{node},{direction},{number(c)}" for (node, direction), c in entries]
        lines = (",".join(text[i : i + 4]) + "\n" for i in range(0, len(text), 4))
        self._ties.append(f"*EQUATION\n{len(text)}\n{''.join(lines)}")

    def depends(self, freedom: Freedom) -> bool:
        """Whether a freedom is fixed or follows others already."""
        return freedom in self._dependent

    def text(self, header: Iterable[str], step: Iterable[str]) -> str:
        """The whole file: comments, model, one linear static step of the given lines."""
        materials = (
            f"*MATERIAL,NAME={name}\n*ELASTIC\n{number(E / PA_PER_MPA)},{number(nu)}\n"
            for (E, nu), name in self._materials.items()
        )
        parts = [
            *map(comment, header),
            *self._nodes,
            *self._elements,
            *self._named,
            *materials,
            *self._properties,
            *self._ties,
            "*BOUNDARY\n" if self._fixed else "",
            *self._fixed,
            "*STEP\n*STATIC\n",
            *(f"{line}\n" for line in step),
            "*END STEP\n",
        ]
        return "".join(parts)

    def _name(self, name: str, what: str) -> None:
        if not _NAME.fullmatch(name) or name in self.sets:
            raise RuntimeError(f"{name!r} cannot name a set: it is taken, too long or has other than A-Z, 0-9, _")
        self.sets[name] = what

    def _depend(self, freedom: Freedom) -> None:
        if freedom in self._dependent:
            raise RuntimeError(f"node {freedom[0]}, direction {freedom[1]} would depend twice")
        self._dependent.add(freedom)


def _span(what: str, first: int, count: int) -> str:
    return f"{what} {first}" if count == 1 else f"{what}s {first} to {first + count - 1}"


def _rows(numbers: Sequence[int]) -> str:
    return "".join(",".join(map(str, numbers[i : i + 12])) + ",\n" for i in range(0, len(numbers), 12))
