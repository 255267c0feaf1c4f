"""What differs between results of one kind, by how much, and whether by more than noise."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from stiffarm.face.calls import called
from stiffarm.face.shown import Shown, frame

if TYPE_CHECKING:
    import pandas as pd

    from stiffarm.commands.compare.step import Compared


@dataclass(frozen=True, repr=False)
class Comparison(Shown):
    """Results compared with the first one.

    ``differs``: of each other result the numbers that differ by more than noise; of maps it is empty. ``compared`` has
    everything else.
    """

    differs: tuple[tuple[str, ...], ...]
    compared: tuple[Compared, ...]

    def title(self) -> str:
        """The answer, one sentence for each other result."""
        from stiffarm.commands.compare.words import headline

        return " ".join(f"{c.b.name} against {c.a.name}: {headline(c)}" for c in self.compared)

    def to_frame(self) -> pd.DataFrame:
        """One row a number, or a map's quantity, of each other result: both values, the change and the verdict."""
        from stiffarm.commands.compare import words

        heads, rows = ("second", *words.HEADS), list[tuple[str, ...]]()
        for c in self.compared:
            if c.maps is not None:
                heads = ("second", *words.MAP_HEADS)
                rows += [(c.b.name, *words.map_row(q)) for q in c.maps.quantities]
            else:
                rows += [(c.b.name, *words.row(p)) for p in c.pairs]
        return frame({name: [row[k] for row in rows] for k, name in enumerate(heads)})


def compare(*results: str | Path) -> Comparison:
    """Compare calibrations, diagnoses, maps or placements: folders of results, their JSON files, models or maps.

    Parameters
    ----------
    results : two or more of one kind and one robot; all are compared with the first

    Raises
    ------
    InputError
        Things that cannot be compared: of different kinds, robots, quantities or units.

    Examples
    --------
    >>> import stiffarm as sa, tempfile
    >>> arm, folder = sa.load("xr701", links="rigid"), tempfile.mkdtemp()
    >>> data = sa.read_readings(sa.bundled("xr701"), arm)
    >>> for k, path in enumerate(("parallelogram", "serial")):
    ...     given = sa.load("xr701", links="rigid", load_path=path)
    ...     _ = sa.calibrate(given, data, free=["j2.stiffness", "j3.stiffness"]).arm.save(f"{folder}/{k}.toml")
    >>> sa.compare(f"{folder}/0.toml", f"{folder}/1.toml").differs
    (('j2.stiffness', 'j3.stiffness'),)
    """
    from stiffarm.commands.compare.step import compare as compared

    with called():
        found = compared([Path(one) for one in results])
    return Comparison(tuple(tuple(p.name for p in c.beyond) for c in found), tuple(found))
