"""What instruments and people write, made a measurement table: the same as `stiffarm readings`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np

from doe.instruments.convert import Converted, convert
from robots import InputError
from stiffarm.commands.readings.step import save, settings_of
from stiffarm.face.arms import Arm
from stiffarm.face.calls import called
from stiffarm.face.shown import Shown, frame

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, repr=False)
class ConvertedReadings(Shown):
    """A measurement table made of files. ``save`` writes it, with the mapping for the next file of this layout.

    ``kind``: "deflections" (for :func:`stiffarm.read_readings`) or "positions" (for
    :func:`stiffarm.calibrate_positions`); ``meanings``: what each column was taken as; ``notes``: remarks.
    """

    kind: str
    meanings: Mapping[str, str]
    notes: tuple[str, ...]
    converted: Converted

    def __len__(self) -> int:
        return len(self.converted.rows)

    def title(self) -> str:
        """The files, and how many readings of which kind they hold."""
        return f"{self.converted.source}: {len(self)} readings, {self.kind}"

    def to_frame(self) -> pd.DataFrame:
        """The table, one row a reading; NaN where a number was not read."""
        ranges = self.converted.ranges()
        cells = zip(*self.converted.rows, strict=True)
        return frame(
            {
                name: np.array([float(cell) if cell else np.nan for cell in column]) if name in ranges else list(column)
                for name, column in zip(self.converted.header, cells, strict=True)
            }
        )

    def save(self, file: str | Path, *, replace: bool = False) -> Path:
        """Write the table (CSV), and beside it FILE.mapping.toml; returns the table's path.

        ``replace``: an existing table moves to previous/TIME beside it.

        Raises
        ------
        InputError
            The file exists already and may not be replaced, or cannot be written.
        """
        with called():
            save(self.converted, Path(file), first=True, replace=replace)
        return Path(file)


def convert_readings(
    files: str | Path | Sequence[str | Path],
    *,
    arm: Arm | None = None,
    mapping: str | Path | None = None,
    columns: Mapping[str, str] | None = None,
    kind: Literal["deflections", "positions"] | None = None,
    units: Sequence[str] = (),
    fill: Mapping[str, str] | None = None,
    sigma_mm: float | None = None,
    axes: str | None = None,
    target: str | None = None,
    join: Literal["pose", "order"] | None = None,
    names: Sequence[str] = (),
    header: int | None = None,
    rows: tuple[int, int] | None = None,
    sheets: Sequence[str] = (),
    encoding: str | None = None,
    separator: str | None = None,
    decimal: Literal["point", "comma"] | None = None,
) -> ConvertedReadings:
    r"""Make a measurement table of exports of trackers, controllers' logs and sheets filled in by hand.

    Parameters
    ----------
    files : text with any separator, or XLSX; joint angles may be in a file of their own
    arm : that was measured: its joint names are used, and its limits are checked
    mapping : mapping file that an earlier conversion wrote
    columns : what columns hold, as {"Dial 1": "dz um before", "Load": "hung kg", "Note": "ignore"}
    kind : the table to make; default: what the columns hold
    units : of columns that name none, as ["mm", "deg"]
    fill : values for all rows that no file holds, as {"session": "day 1", "hung": "20 kg"}
    sigma_mm : standard deviation of one reading of a coordinate
    axes : of an instrument whose positions are subtracted: "base", "A,B,C", its orientation in the base frame, deg, or
        "found", from the positions without a load, with ``arm``
    target : the one whose readings are used
    join : how joint angles find the readings of another file
    names, header, rows : names of columns without any; line of the names; first and last line of the readings
    sheets : of a workbook
    encoding, separator, decimal : of texts; default: found

    Raises
    ------
    InputError
        Whatever cannot be read or is not sure, with what settles it.

    Examples
    --------
    >>> import tempfile, pathlib
    >>> import stiffarm as sa
    >>> file = pathlib.Path(tempfile.mkdtemp()) / "dial.txt"
    >>> head, *read = "J1;J2;J3;Load;Dial before;Dial after", "0;-90;30;20;1,000;0,705", "10;-80;40;20;1,000;0,612"
    >>> _ = file.write_text("\n".join([head, *read]))
    >>> columns = {"Load": "hung kg", "Dial before": "dz mm before", "Dial after": "dz mm after"}
    >>> made = sa.convert_readings(file, columns=columns, units=["deg"])
    >>> made.to_frame()["dz_mm"].tolist()
    [-0.295, -0.388]
    """
    several = [files] if isinstance(files, str | Path) else list(files)
    if rows is not None and not 0 < rows[0] <= rows[1]:
        raise InputError("rows", code="B003", value=rows, allowed="first and last line, counted from 1")
    with called():
        robot = None if arm is None else arm.robot
        asked = settings_of(
            None if mapping is None else Path(mapping),
            columns or {},
            fill or {},
            robot,
            kind=kind,
            units=tuple(units),
            sigma_mm=sigma_mm,
            axes=axes,
            target=target,
            join=join,
            names=tuple(names),
            header=header,
            rows=rows,
            sheets=tuple(sheets),
            encoding=encoding,
            separator=separator,
            decimal=decimal,
        )
        made = convert([Path(file) for file in several], asked, robot)
    meanings = {column.name: str(column.meaning) for column in made.columns}
    return ConvertedReadings(made.kind, meanings, made.notes, made)
