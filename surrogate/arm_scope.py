"""The scope of a surrogate over some of an arm's joint coordinates."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from fem import ArmModel, deflection
from robots import InputError, Robot, require_one_of
from robots.arrays import Array
from robots.frames import unit_vector
from surrogate.designs import space_filling_design
from surrogate.expansion import TURN
from surrogate.scope import Couplings, Scope

# Poses by which whole turns and the influence of coordinates are judged, and how many are drawn to find such.
_PROBES, _DRAWN = 256, 8192
# Relative change that is rounding, in numbers that went through some hundred operations.
_SAME = 1e-9


def scope_of(
    robot: Robot,
    model_hash: str,
    inputs: Sequence[str],
    *,
    direction: Sequence[float] = (0.0, 0.0, -1.0),
    fixed_deg: Mapping[str, float] | None = None,
    limits_deg: Mapping[str, tuple[float, float]] | None = None,
) -> Scope:
    """The scope of a surrogate over some of the robot's joint coordinates.

    Coordinates that are no inputs stand at ``fixed_deg`` (default 0); couplings are folded accordingly.
    ``limits_deg`` narrows the joint limits.

    Raises
    ------
    InputError
        Unknown coordinate, fixed value outside its limits, direction of length zero.
    """
    columns = [robot.coordinate_index(name) for name in inputs]
    fixed = {name: 0.0 for name in robot.coordinates if name not in inputs} | dict(fixed_deg or {})
    base = np.zeros(robot.dof)
    for name, value in fixed.items():
        index = robot.coordinate_index(name)
        base[index] = np.radians(value)
        low, high = robot.limits[index]
        if name not in inputs and not low <= base[index] <= high:
            raise InputError(
                f"fixed coordinate {name}",
                code="S003",
                value=value,
                allowed=f"{np.degrees(low):g} to {np.degrees(high):g} deg of {robot.name}",
            )
    lower, upper = robot.limits[columns].T.copy()
    for name, (low, high) in (limits_deg or {}).items():
        require_one_of("limits of an input", name, inputs, code="S003")
        i = list(inputs).index(name)
        lower[i], upper[i] = max(lower[i], np.radians(low)), min(upper[i], np.radians(high))
    x, y, z = unit_vector(direction, "load direction").tolist()
    return Scope(
        robot=robot.name,
        model_hash=model_hash,
        load_direction=(x, y, z),
        inputs=tuple(inputs),
        fixed_deg={name: value for name, value in fixed.items() if name not in inputs},
        lower=lower,
        upper=upper,
        couplings=_folded(robot, columns, base),
    )


def _folded(robot: Robot, columns: list[int], base: Array) -> Couplings:
    """The robot's coupled limits over the inputs alone, the fixed coordinates moved into the bounds."""
    kept = [c for c in robot.couplings if np.any(c.factors[columns] != 0.0)]
    if not kept:
        return Couplings.none(len(columns))
    constant = np.zeros(robot.dof)
    constant[:] = base
    constant[columns] = 0.0
    shift = np.array([c.offset + float(c.factors @ constant) for c in kept])
    return Couplings(
        tuple(c.name for c in kept),
        np.array([c.factors[columns] for c in kept]),
        np.array([c.lower for c in kept]) - shift,
        np.array([c.upper for c in kept]) - shift,
    )


def with_whole_turns(scope: Scope, run: Callable[[Array], Array], rng: np.random.Generator) -> Scope:
    """The scope with those inputs marked periodic whose range is more than a turn, and where turns change nothing.

    ``run``: poses (n, k) rad -> (n, ...) of the model. A spring whose law knows turns apart keeps its input unmarked.
    """
    wide = np.flatnonzero(scope.upper - scope.lower > TURN * (1.0 + 1e-9))
    periodic = np.zeros(len(scope.inputs), dtype=np.bool_)
    for i in wide:
        lower, upper = scope.lower.copy(), scope.upper.copy()
        upper[i] = scope.upper[i] - TURN
        Q = space_filling_design(lower, upper, _PROBES, rng, density="uniform")
        turned = Q.copy()
        turned[:, i] += TURN
        here, there = run(Q).reshape(_PROBES, -1), run(turned).reshape(_PROBES, -1)
        periodic[i] = bool(np.all(np.abs(there - here) <= _SAME * np.abs(here).max(axis=1, keepdims=True)))
    return replace(scope, periodic=tuple(bool(p) for p in periodic))


def reduced_box(scope: Scope) -> tuple[Array, Array]:
    """Box (k,) rad in which the runs are drawn: one turn of inputs whose turns do not matter and that are uncoupled."""
    free = np.array(scope.periodic) & ~np.any(scope.couplings.matrix != 0.0, axis=0)
    middle = 0.5 * (scope.lower + scope.upper)
    lower, upper = np.where(free, middle - np.pi, scope.lower), np.where(free, middle + np.pi, scope.upper)
    return np.maximum(lower, scope.lower), np.minimum(upper, scope.upper)


def inputs_that_matter(model: ArmModel, direction: Sequence[float] = (0.0, 0.0, -1.0)) -> tuple[str, ...]:
    """Joint coordinates that the deflection along a load depends on, by random poses; all of an arm that is rigid."""
    robot, rng = model.robot, np.random.default_rng(0)
    low, high = robot.limits.T
    drawn = rng.uniform(low, high, (_DRAWN, robot.dof))
    base = drawn[robot.reachable(drawn)][:_PROBES]
    load = np.concatenate([unit_vector(direction, "load direction"), np.zeros(3)])

    def along(q: Array) -> Array:
        return np.asarray(deflection(model, q, load) @ load)

    if not len(base) or not (here := along(base)).all():
        return robot.coordinates
    out = []
    for column, name in enumerate(robot.coordinates):
        q = base.copy()
        q[:, column] = rng.uniform(low[column], high[column], len(q))
        if np.abs(along(q) / here - 1.0).max() > _SAME:
            out.append(name)
    return tuple(out)


def influence_of_fixed(
    scope: Scope, robot: Robot, full: Callable[[Array], Array], run: Callable[[Array], Array], rng: np.random.Generator
) -> dict[str, float]:
    """Largest relative change of a quantity when one fixed coordinate turns over its limits; sampled.

    ``full``: poses (n, k) -> (n, dof) rad; ``run``: poses (n, dof) -> (n,).
    """
    lower, upper = reduced_box(scope)
    base = full(space_filling_design(lower, upper, _PROBES, rng, density="uniform", couplings=scope.couplings))
    here = run(base)
    out = {}
    for name in scope.fixed_deg:
        column = robot.coordinate_index(name)
        q = base.copy()
        low, high = (float(limit) for limit in robot.limits[column])
        q[:, column] = rng.uniform(low, high, len(q))
        change = np.abs(run(q) / here - 1.0)
        out[name] = float(change.max()) if change.max() > _SAME else 0.0
    return out
