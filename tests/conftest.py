"""What every test shares: the packages under test, a seeded generator, no screen, repeatable examples."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import settings

ROOT = Path(__file__).resolve().parent.parent

# pytest puts this folder on the path, where tests/robots would be found as the package `robots`.
# The root in front of it also makes sure that the tests see this tree, not another installed one.
sys.path.insert(0, str(ROOT))

# Figures are drawn in memory; a machine without a screen must pass too.
os.environ.setdefault("MPLBACKEND", "Agg")
os.environ.setdefault("PYVISTA_OFF_SCREEN", "true")

# No deadline: the first example pays for imports and caches, and a busy machine is no failure.
settings.register_profile("desk", deadline=None)
settings.register_profile("ci", deadline=None, derandomize=True, database=None)
settings.load_profile("ci" if os.environ.get("CI") else "desk")


@pytest.fixture(scope="session", autouse=True)
def _own_cache(tmp_path_factory: pytest.TempPathFactory) -> None:
    """Condensed links are kept in a folder of this run, never the user's; commands run as subprocesses inherit it."""
    os.environ["STIFFARM_CACHE"] = str(tmp_path_factory.mktemp("cache"))


@pytest.fixture
def rng() -> np.random.Generator:
    """A generator with seed 0: each test draws the same numbers, alone or in company."""
    return np.random.default_rng(0)
