"""Learning a surrogate as commands do it: with a progress bar, every basis kept."""

from __future__ import annotations

from typing import Any

from fem import ArmModel
from robots import ModelDescription
from stiffarm import steps
from stiffarm.console import progress, say
from stiffarm.outputs import OutputFolder
from surrogate import Trained, save_surrogate


def learn(
    description: ModelDescription,
    model: ArmModel,
    inputs: tuple[str, ...],
    seed: int,
    folder: OutputFolder,
    stem: str = "surrogate",
    label: str = "",
    **options: Any,
) -> Trained:
    """Train a surrogate, say how good it is, and save every basis tried as ``<stem>_<basis>.json``.

    ``options`` are those of :func:`stiffarm.steps.learn`; ``label`` says which model it is of.
    """
    what = f"surrogate of {label}" if label else "surrogate"
    with progress(what) as bar:
        trained = steps.learn(description, model, inputs, seed, progress=bar, **options)
    for one in trained.surrogates:
        save_surrogate(one, folder.path(f"{stem}_{one.basis.name}.json"))
    error = trained.best.errors
    say(f"{what}: {error.basis}, held-out relative error {error.rms_relative:.1e} RMS, {error.max_relative:.1e} worst")
    return trained
