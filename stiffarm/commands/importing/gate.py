"""Whether an imported shell may be trusted: its figures, one try to mend its ring, and the verdict."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from fem.elements.trust import Trust, trust_in
from meshes.surfaces.link import ImportedLink, MidSurface, Rings
from meshes.surfaces.rings import Interface
from robots import InputError
from robots.arrays import Array

# Share of the surface that holds half of the energy: below the first a link is no shell, below the second it is said;
# and the exponent of the tip's tilt in the wall, above which it is said. A FANUC's upper arm held by too small a ring
# had 0.6 %; sound casings have 3 to 30 % (docs/validation/imported_links.md).
LEAST_SHARE, LOW_SHARE, MOST_EXPONENT = 0.015, 0.03, 1.8
# A ring that half of the energy sits at is made this much larger, so many times.
LARGER, TRIES = 1.5, 2


@dataclass(frozen=True)
class Verdict:
    """What became of a shell, and why: "trusted", "warned" or "refused", with the figures it rests on.

    ``mended``: the interface whose ring was made larger, and its radius (m) before and after.
    """

    kind: Literal["trusted", "warned", "refused"]
    trust: Trust
    mended: tuple[str, float, float] | None = None

    @property
    def words(self) -> str:
        """One line."""
        share, exponent = 100.0 * self.trust.half_energy_share, self.trust.wall_exponent
        said = f"half of its strain energy sits in {share:.2g} % of its surface, tilt goes with wall^-{exponent:.2g}"
        if self.mended is not None:
            name, before, after = self.mended
            said += f"; ring {name} was made larger for it, {1e3 * before:.0f} to {1e3 * after:.0f} mm"
        return said

    @property
    def warning(self) -> str | None:
        """What to say of it, None where nothing is."""
        if self.kind == "trusted":
            return None
        place = np.round(1e3 * self.trust.hot).tolist()
        if self.kind == "refused":
            return (
                f"WARNING: not taken as a shell: {self.words}, around {place} mm. The link is a plain section instead; "
                f"give the ring there a larger --radius, or the link as a solid"
            )
        why = "walls bend beside a ring" if self.trust.wall_exponent > MOST_EXPONENT else "a small part carries much"
        return f"WARNING: {self.words}, around {place} mm: {why}, and the link may be softer than it is in truth"


def judged(
    name: str,
    surface: MidSurface,
    interfaces: Mapping[str, Interface],
    rings: Rings,
    points: Array,
    shell: Callable[[Mapping[str, Interface], Rings], ImportedLink],
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
    if trust.half_energy_share < LEAST_SHARE:
        return link, Verdict("refused", trust, mended)
    low = trust.half_energy_share < LOW_SHARE or trust.wall_exponent > MOST_EXPONENT
    return link, Verdict("warned" if low else "trusted", trust, mended)


def _trust(link: ImportedLink, points: Array) -> Trust:
    return trust_in(link.mesh, points, dict.fromkeys(link.mesh.interfaces, "rigid"))


def _nearest_ring(link: ImportedLink, place: Array) -> str:
    """The interface whose ring is nearest to a place."""
    nodes, rings = link.mesh.nodes, link.figures.rings
    return min(rings, key=lambda name: float(np.linalg.norm(nodes[rings[name].nodes] - place, axis=1).min()))
