"""Learning a surrogate as commands do it: with a progress bar, every basis kept, what is uncertain carried along."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from doe.certainty.propagation import ParameterUncertainty, parameter_uncertainty, propagate
from fem import ArmModel, compliance
from machining import INDICES
from machining.stiffness.indices import evaluate
from robots import InputError, ModelDescription, Remark, content_hash
from robots.arrays import Array
from robots.constants import DOWN
from robots.quantities import relative
from robots.robot import middle_pose
from stiffarm.session.console import progress, say
from stiffarm.session.stated import stated_at, stated_words
from surrogate import Quantity, Task, Trained, scope_of, task_of, train

STIFFNESS = "stiffness"
# A held-out RMS error that no stiffness should be trusted with.
POOR = 0.1
# Fixed coordinates that change the quantity by less are not worth a word.
_WORTH_A_WORD = 1e-6


def quantities() -> tuple[str, ...]:
    """What a surrogate can be of: the stiffness along the load (and with it the whole compliance), or an index."""
    return (STIFFNESS, *INDICES)


def index_quantity(
    model: ArmModel, name: str, normal: Array | None, force: Array | None
) -> tuple[Quantity, Callable[[Array], Array]]:
    """An index of the machining package as a quantity of poses (n, dof).

    Raises
    ------
    InputError
        No such index, or the normal or force that it needs is missing.
    """
    if name not in INDICES:
        raise InputError(
            "--quantity", code="A001", value=name, allowed=", ".join(quantities()), remedy="choose one of them"
        )
    index = INDICES[name]
    for need, given in (("normal", normal), ("force", force)):
        if need in index.uses and given is None:
            raise InputError(
                f"--quantity {name} without --{need}",
                code="A003",
                allowed="a vector in base axes",
                remedy=f"add --{need} 0,0,1",
            )

    def values(q: Array) -> Array:
        return evaluate(name, compliance(model, q)[:, :3, :3], normal, force)

    with_what = "".join(
        f", {need} ({', '.join(f'{v + 0.0:.6g}' for v in given)})"
        for need, given in (("normal", normal), ("force", force))
        if need in index.uses and given is not None
    )
    return Quantity(name, "N/m" if index.degree else "1", f"{name}, {index.formula}{with_what}"), values


def learning_task(
    description: ModelDescription,
    model: ArmModel,
    inputs: tuple[str, ...],
    rng: np.random.Generator,
    *,
    fixed_deg: dict[str, float] | None = None,
    direction: tuple[float, float, float] = DOWN,
    scalar: tuple[Quantity, Callable[[Array], Array]] | None = None,
) -> Task:
    """What to learn of a described arm, with the uncertainty of its calibration where the model file has one."""
    scope = scope_of(model.robot, content_hash(description), inputs, direction=direction, fixed_deg=fixed_deg)
    more: dict[str, Any] = {}
    known = parameter_uncertainty(description) if scalar is None else None
    if known is not None:
        more = _uncertain(model, known, np.array(scope.load_direction))
    said = stated_words(model)
    notes = (f"{model.link_kind} links, {model.load_path} load path", *([said] if said else []))
    return task_of(model, scope, rng, scalar=scalar, notes=notes, at_load=stated_at(model), **more)


def _uncertain(model: ArmModel, known: ParameterUncertainty, direction: Array) -> dict[str, Any]:
    """Relative changes of the compliance by independent unit changes of the parameters: |z| is the relative sd."""
    values, vectors = np.linalg.eigh(known.widened)
    root = vectors * np.sqrt(np.maximum(values, 0.0))

    def gradients(q: Array) -> tuple[Array, Array]:
        found = propagate(model, known, q, direction)
        return np.asarray(found.gradient @ root), found.open_share

    middle = middle_pose(model.robot)[None]
    try:
        names = propagate(model, known, middle, direction).open_names
    except InputError as error:
        say(f"note: the surrogate goes without the calibration's uncertainty: {error.prose}.", code="W013")
        return {}
    return {"gradients": gradients, "parameters": tuple(known.names), "undetermined": names}


def learn(
    description: ModelDescription,
    model: ArmModel,
    inputs: tuple[str, ...],
    seed: int,
    label: str = "",
    *,
    fixed_deg: dict[str, float] | None = None,
    direction: tuple[float, float, float] = DOWN,
    scalar: tuple[Quantity, Callable[[Array], Array]] | None = None,
    **options: Any,
) -> Trained:
    """Train a surrogate; ``options`` are those of :func:`surrogate.train`; ``label`` says which model it is of."""
    rng = np.random.default_rng(seed)
    with progress(f"surrogate of {label}" if label else "surrogate") as bar:
        task = learning_task(description, model, inputs, rng, fixed_deg=fixed_deg, direction=direction, scalar=scalar)
        return train(task, rng, progress=bar, **options)


def remarks_of(trained: Trained) -> list[str]:
    """What a user of the surrogate must know: that it is poor, what was not fitted, what is held and would matter."""
    error, out = trained.best.errors, list[str]()
    if error.rms_relative > POOR:
        own = f"its error is {relative(error.rms_relative)} RMS"
        out.append(Remark(f"a poor surrogate: {own}; try another --basis or more --runs", code="W011"))
    out += [f"{name} not fitted: {why}" for name, why in trained.refused.items()]
    for name, change in trained.best.fixed_influence.items():
        if change > _WORTH_A_WORD:
            text = (
                f"{name} is fixed at {trained.best.fixed_deg[name]:g} deg, but would change the "
                f"{trained.best.quantity.name} by up to {relative(change)}; make it one of --inputs if it moves"
            )
            out.append(Remark(text, code="W012"))
    return out
