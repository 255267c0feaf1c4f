"""What differs between results of one kind, by how much, and whether by more than noise."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from stiffarm.face.calls import called
from stiffarm.face.shown import Shown, frame

if TYPE_CHECKING:
    import pandas as pd

    from robots.arrays import Array
    from stiffarm.commands.compare.step import Compared


@dataclass(frozen=True, repr=False)
class Comparison(Shown):
    """Results compared with the first one.

    ``differs``: of each other result the parameters that differ by more than noise; of maps it is empty. ``compared``
    has everything else.
    """

    differs: tuple[tuple[str, ...], ...]
    compared: tuple[Compared, ...]

    def title(self) -> str:
        """The answer, one sentence for each other result."""
        from stiffarm.commands.compare.words import headline

        return " ".join(f"{c.b.name} against {c.a.name}: {headline(c)}" for c in self.compared)

    def to_frame(self) -> pd.DataFrame:
        """One row a parameter, or a map's quantity, of each other result: both values, the change and the verdict.

        ``change``: second over first less one where ``is_share``, else their difference; of maps the median.
        """
        return frame([row for c in self.compared for row in _rows(c)])


def _rows(c: Compared) -> list[dict[str, object]]:
    if c.maps is not None:
        return [
            {
                "second": c.b.name,
                "quantity": q.name,
                "unit": q.unit,
                "first_median": _median(q.a),
                "second_median": _median(q.b),
                "change": _median(q.change),
                "is_share": q.is_share,
                "share_beyond": float("nan") if q.beyond is None else float(q.beyond.mean()),
            }
            for q in c.maps.quantities
        ]
    out: list[dict[str, object]] = []
    for p in c.pairs:
        row: dict[str, object] = {"second": c.b.name, "parameter": p.name, "unit": p.unit}
        for name, one in (("first", p.a), ("second", p.b)):
            ends = (None, None, None) if one is None else (one.value, one.low, one.high)
            row |= {
                f"{name}_{part}": float("nan") if v is None else v
                for part, v in zip(("value", "low", "high"), ends, strict=True)
            }
        out.append(row | {"change": p.change, "is_share": p.is_share, "p": p.p, "verdict": p.verdict})
    return out


def _median(values: Array) -> float:
    known = sorted(values[values == values].tolist())
    return known[len(known) // 2] if known else float("nan")


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
    (('j2.stiffness',),)
    """
    from stiffarm.commands.compare.step import compare as compared

    with called():
        found = compared([Path(one) for one in results])
    return Comparison(tuple(tuple(p.name for p in c.beyond) for c in found), tuple(found))
