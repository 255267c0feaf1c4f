"""What is known of bundled readings beyond their table: readings in doubt, remarks of their source."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass

import numpy as np

from doe.tables.reading import bundled_data


@dataclass(frozen=True)
class DoubtfulReadings:
    """Readings that may be wrong: at these poses and loads (N), for the reason in ``note``."""

    poses: tuple[str, ...]
    loads_N: tuple[float, ...]  # noqa: N815 - the unit's letter
    note: str

    def holds(self, pose: str, load_N: float) -> bool:
        """Whether a reading is one of these."""
        return pose in self.poses and bool(np.isclose(load_N, self.loads_N, rtol=0.01).any())


@dataclass(frozen=True)
class ReadingNotes:
    """Remarks on bundled readings, each a text for one place of a report, empty where there is none.

    ``doubted``: on the ``doubts``; ``measured``: on the readings; ``first_model``: on links with rigid joints;
    ``effects``, ``ranking``: on what each spring does.
    """

    doubts: tuple[DoubtfulReadings, ...] = ()
    doubted: str = ""
    measured: str = ""
    first_model: str = ""
    effects: str = ""
    ranking: str = ""


def bundled_notes(name: str) -> ReadingNotes:
    """The notes on the readings bundled for a robot, by the robot's name; empty ones if there are none.

    Raises
    ------
    InputError
        No measurements are bundled for that name.
    """
    file = bundled_data(name).with_suffix(".toml")
    if not file.is_file():
        return ReadingNotes()
    content = tomllib.loads(file.read_text(encoding="utf-8"))
    doubts = [DoubtfulReadings(tuple(d["poses"]), tuple(d["loads_N"]), d["note"]) for d in content.pop("doubts", ())]
    return ReadingNotes(tuple(doubts), **content)
