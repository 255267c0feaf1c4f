"""Whether an imported shell may be trusted: its figures, one try to mend its ring, the verdict; shell beside beam."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import scipy.linalg

from fem import build_model
from fem.elements.couplings import Coupling
from fem.elements.link_cache import cached_superelement
from fem.elements.trust import Trust, trust_in
from meshes import ShellMesh
from meshes.shell_mesh import connected, sides, used_only
from meshes.surfaces.doubts import openings
from meshes.surfaces.link import ImportedLink, MidSurface, Rings
from meshes.surfaces.rings import Interface
from robots import InputError, ModelDescription, Remark
from robots.arrays import Array, Bools

# Share of the surface that holds half of the energy: below the first a link is no shell, below the second it is said;
# and the exponent of the tip's tilt in the wall, above which it is said. A FANUC's upper arm held by too small a ring
# had 0.6 %; sound casings have 3 to 30 % (docs/validation/imported_links.md).
LEAST_SHARE, LOW_SHARE, MOST_EXPONENT = 0.015, 0.03, 1.8
# A ring that half of the energy sits at is made this much larger, so many times.
LARGER, TRIES = 1.5, 2
# Of what an opening does to a link, less than this share is no warning.
TOLD = 0.05
# Shells are softer than their beams by their rings and walls, by up to this factor; beyond, one of the two is no
# model of the link.
MOST_RATIO = 3.0
_HULL = Remark(
    "WARNING: its surface is convex, like a collision hull, so waists, hollows and bosses are missing. A uniform wall "
    "of 0.8 times the usual one corrects the excess stiffness of a hull on average; along one direction it may be off "
    "by a factor of 1.5",
    code="W023",
)


@dataclass(frozen=True)
class Verdict:
    """What became of a shell, and why: "trusted", "warned" or "refused", with the figures it rests on.

    ``mended``: the interface whose ring was made larger, and its radius (m) before and after. ``doubts``: warnings
    about what the surface does not show.
    """

    kind: Literal["trusted", "warned", "refused"]
    trust: Trust
    mended: tuple[str, float, float] | None = None
    doubts: tuple[str, ...] = ()

    @property
    def words(self) -> str:
        """One line."""
        share, exponent = 100.0 * self.trust.half_energy_share, self.trust.wall_exponent
        said = f"half of its strain energy is in {share:.2g} % of its surface, tilt varies as wall^-{exponent:.2g}"
        if self.mended is not None:
            name, before, after = self.mended
            said += f"; ring {name} was therefore enlarged from {1e3 * before:.0f} to {1e3 * after:.0f} mm"
        return said

    @property
    def warnings(self) -> tuple[str, ...]:
        """What to say of it, each beginning with WARNING."""
        place = np.round(1e3 * self.trust.hot).tolist()
        if self.kind == "refused":
            said = Remark(
                f"WARNING: not taken as a shell: {self.words}, around {place} mm. The link is a plain section instead; "
                f"give the ring there a larger --radius, or the link as a solid",
                code="W021",
            )
            return (said, *self.doubts)
        if self.trust.half_energy_share < LOW_SHARE or self.trust.wall_exponent > MOST_EXPONENT:
            bends = self.trust.wall_exponent > MOST_EXPONENT
            why = "walls bend beside a ring" if bends else "a small part carries much of the load"
            said = Remark(
                f"WARNING: {self.words}, around {place} mm: {why}, and the link may be softer than the real one",
                code="W022",
            )
            return (said, *self.doubts)
        return self.doubts


def judged(
    surface: MidSurface,
    interfaces: Mapping[str, Interface],
    rings: Rings,
    points: Array,
    shell: Callable[[Mapping[str, Interface], Rings], ImportedLink],
    hull: bool = False,
) -> tuple[ImportedLink, Verdict]:
    """The shell of a link with the rings given, or with a larger one where that one is what gives way."""
    link = shell(interfaces, rings)
    trust = _trust(link, points)
    mended: tuple[str, float, float] | None = None
    for _ in range(TRIES):
        if trust.half_energy_share >= LEAST_SHARE:
            break
        key = _nearest_ring(link, trust.hot)
        ring = link.figures.rings[key]
        if interfaces[key].axis is None or (interfaces[key].radius is not None and mended is None):
            break
        larger = dict(interfaces) | {key: replace(interfaces[key], radius=LARGER * ring.radius)}
        try:
            other = shell(larger, surface.rings(larger))
        except InputError:
            break
        again = _trust(other, points)
        if again.half_energy_share <= trust.half_energy_share:
            break
        before = ring.radius if mended is None or mended[0] != key else mended[1]
        mended = (key, before, other.figures.rings[key].radius)
        link, trust, interfaces = other, again, larger
    doubts = _doubts(surface, link, points, hull)
    if trust.half_energy_share < LEAST_SHARE:
        return link, Verdict("refused", trust, mended, doubts)
    low = trust.half_energy_share < LOW_SHARE or trust.wall_exponent > MOST_EXPONENT
    return link, Verdict("warned" if low or doubts else "trusted", trust, mended, doubts)


def _doubts(surface: MidSurface, link: ImportedLink, points: Array, hull: bool) -> tuple[str, ...]:
    """Warnings about what the surface does not show, with what that does to the link."""
    said: list[str] = []
    mesh, size = surface.mesh, surface.mesh.size
    off = mesh.departure[0]
    if size < off:
        said.append(
            Remark(
                f"WARNING: the shell deviates from the surface by up to {1e3 * off:.3g} mm on 95 % of it, more than "
                f"the element size ({1e3 * size:.3g} mm): sections are too large or too small by that much",
                code="W024",
            )
        )
    if hull:
        said.append(_HULL)
    held = np.concatenate(list(link.mesh.interfaces.values()))
    found = openings(link.mesh.nodes, link.mesh.triangles, mesh.off, size, held)
    if found:
        most, least = _if_open(link.mesh, np.any([one.faces for one in found], axis=0), points)
        widest = found[0]
        where = f"an opening {1e3 * widest.width:.0f} mm wide around {np.round(1e3 * widest.middle).tolist()} mm"
        said.append(
            f"WARNING: {where} was closed. If the real link is open there, it is {least:.2g} to {most:.2g} times as "
            "compliant, depending on the load"
            if most > 1.0 + TOLD
            else f"{where} was closed; if the real link is open there, it is at most {100 * TOLD:.0f} % more compliant"
        )
    return tuple(said)


def _if_open(mesh: ShellMesh, closing: Bools, points: Array) -> tuple[float, float]:
    """Largest and smallest ratio of the tip's flexibility without some triangles to that with them, over all loads."""
    couplings: Mapping[str, Coupling] = dict.fromkeys(mesh.interfaces, "rigid")
    place = np.full(len(mesh.nodes), -1)
    # A patch may hang by single nodes: the piece that the root is part of counts.
    piece = connected(len(mesh.nodes), sides(mesh.triangles[~closing]))
    kept = ~closing & (piece[mesh.triangles[:, 0]] == np.bincount(piece[mesh.triangles[~closing].ravel()]).argmax())
    nodes, triangles = used_only(mesh.nodes, mesh.triangles[kept])
    place[np.unique(mesh.triangles[kept])] = np.arange(len(nodes))
    rings = {name: place[ring][place[ring] >= 0] for name, ring in mesh.interfaces.items()}
    opened = replace(mesh, nodes=nodes, triangles=triangles, thickness=mesh.thickness[kept], interfaces=rings)
    closed, other = (cached_superelement(one, points, couplings).flexibility[:6, :6] for one in (mesh, opened))
    ratios = scipy.linalg.eigh(other, closed, eigvals_only=True)
    return float(ratios[-1]), float(ratios[0])


def _trust(link: ImportedLink, points: Array) -> Trust:
    return trust_in(link.mesh, points, dict.fromkeys(link.mesh.interfaces, "rigid"))


def _nearest_ring(link: ImportedLink, place: Array) -> str:
    """The interface whose ring is nearest to a place."""
    nodes, rings = link.mesh.nodes, link.figures.rings
    return min(rings, key=lambda name: float(np.linalg.norm(nodes[rings[name].nodes] - place, axis=1).min()))


@dataclass(frozen=True)
class TipCompliance:
    """Largest tip displacement for a unit force (m/N), root held, of a link as shell and as beam."""

    shell: float
    beam: float

    @property
    def ratio(self) -> float:
        """Shell over beam; infinite for a rigid beam."""
        return self.shell / self.beam if self.beam > 0.0 else float("inf")

    def warning(self) -> str | None:
        """What to say where the two differ by more than ``MOST_RATIO``."""
        if 1.0 / MOST_RATIO <= self.ratio <= MOST_RATIO:
            return None
        softer = self.ratio > 1.0
        times = self.ratio if softer else 1.0 / self.ratio
        why = (
            "its walls deflect around the joints, or lie far from the line between them"
            if softer
            else "the beam's section stands for only part of the casing"
        )
        return Remark(
            f"WARNING: its tip is {times:.3g} times as compliant as a {'shell' if softer else 'beam'} "
            f"({1e9 * (self.shell if softer else self.beam):.3g} um/kN) than as a {'beam' if softer else 'shell'} "
            f"({1e9 * (self.beam if softer else self.shell):.3g} um/kN): {why}; look at its rings and wall, "
            f"and compare both with --links",
            code="W025",
        )


def tip_compliances(description: ModelDescription, names: tuple[str, ...]) -> dict[str, TipCompliance]:
    """Of the links of these names, by condensing each as a shell and as a beam.

    The shells come from the cache, or are left there for the commands that follow. Raises InputError where a model
    cannot be built.
    """
    chosen = description.model_copy(update={"link": [link for link in description.link if link.name in names]})
    shells, beams = (build_model(chosen, kind).links for kind in ("shell", "beam"))
    found = {}
    for shell, beam in zip(shells, beams, strict=True):
        first = 6 * (shell.element.interfaces.index("tip") - 1)
        block = slice(first, first + 3)
        at = [float(np.linalg.eigvalsh(part.element.flexibility[block, block])[-1]) for part in (shell, beam)]
        found[shell.name] = TipCompliance(*at)
    return found
