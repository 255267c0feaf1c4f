"""What several tests of `calibrate` begin with."""

from __future__ import annotations

from pathlib import Path

import pytest
from small_robot import write_readings, write_urdf


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a URDF, readings of eight poses, and of four others."""
    folder = tmp_path_factory.mktemp("small")
    urdf = write_urdf(folder / "small.urdf")
    write_readings(urdf, folder / "readings.csv")
    write_readings(urdf, folder / "others.csv", 4, seed=1)
    return folder
