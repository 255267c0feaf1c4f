"""Ways to shorten what a test of the command line does not look at: few candidates, few runs, no pictures."""

from __future__ import annotations

import base64
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from matplotlib.figure import Figure

from doe.diagnosis import nested, setting
from fem.effects.catalogue import catalogue
from stiffarm.commands.diagnose import step as diagnosing
from stiffarm.pages import rendering
from surrogate import training

# Families of effects that a quick diagnosis looks among.
FAMILIES = (
    "angle-dependent-stiffness",
    "backlash",
    "drift",
    "friction",
    "joint-compliance",
    "load-path",
    "payload",
)

# A PNG of one white pixel.
PIXEL = base64.b64decode("iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAAAAAA6fptVAAAACklEQVR4nGP4DwABAQEAsTj2FAAAAABJRU5ErkJggg==")


@contextmanager
def quick_diagnosis(*families: str) -> Iterator[None]:
    """Diagnose among few families of effects, in two folds at most: what commands do with the result is the same."""
    wanted = families or FAMILIES

    def few(*given: Any, **more: Any) -> Any:
        return {code: e for code, e in catalogue(*given, **more).items() if code.partition(":")[0] in wanted}

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(setting, "catalogue", few)
        patch.setattr(nested, "SPLIT", 2)
        patch.setattr(diagnosing, "nested", lambda *given, **more: nested.nested(*given, **more | {"folds": 2}))
        yield


@contextmanager
def blank_pictures() -> Iterator[None]:
    """Every picture is one pixel: files and pages are the same, and nothing is drawn."""

    def savefig(_: Figure, target: Any, **__: Any) -> None:
        target.write(PIXEL) if hasattr(target, "write") else Path(target).write_bytes(PIXEL)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Figure, "savefig", savefig)
        patch.setattr(rendering, "show", lambda *_: None)
        yield


@contextmanager
def few_runs() -> Iterator[None]:
    """Judge surrogates by few model runs: what commands do with them is the same."""
    with pytest.MonkeyPatch.context() as patch:
        for name, count in (("CALIBRATION_RUNS", 1500), ("HELD_OUT_UNIFORM", 1500), ("HELD_OUT_BOUNDARY", 64)):
            patch.setattr(training, name, count)
        yield
