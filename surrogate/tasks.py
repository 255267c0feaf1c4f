"""What a surrogate is to learn: of which arm, over which joint angles, which quantity, and how the model is run."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from fem import ArmModel, compliance, directional_stiffness
from fem.statics.stated import StatedAt
from robots.arrays import Array, in_blocks
from surrogate.arm_scope import influence_of_fixed, reduced_box, with_whole_turns
from surrogate.asking import full_poses
from surrogate.designs import Density, space_filling_design
from surrogate.model import Quantity
from surrogate.scope import Scope

Scalar = Callable[[Array], Array]

RUNS_A_BLOCK = 2048


@dataclass(frozen=True, eq=False)
class Task:
    """What is to be learned: of which arm, over which inputs, and how the model is run.

    ``run``: poses (n, k) rad -> the quantity (n,). ``gradients``: poses (n, dof) -> relative change (n, p) of the
    quantity by independent unit changes of the calibrated ``parameters``, and the share (n, m) by which each of those
    ``undetermined`` may change it.
    """

    model: ArmModel
    scope: Scope
    quantity: Quantity
    run: Scalar
    notes: tuple[str, ...] = ()
    at_load: StatedAt | None = None
    gradients: Callable[[Array], tuple[Array, Array]] | None = None
    parameters: tuple[str, ...] = ()
    undetermined: tuple[str, ...] = ()
    fixed_influence: Mapping[str, float] = field(default_factory=dict)

    def full(self, Q: Array) -> Array:
        """Poses of all joints (n, dof) rad."""
        return full_poses(self.model.robot, self.scope, Q)

    def design(self, n: int, density: Density, rng: np.random.Generator) -> Array:
        """Poses (n, k) rad; runs to fit come from one turn of inputs whose turns do not matter."""
        box = (self.scope.lower, self.scope.upper) if density == "boundary" else reduced_box(self.scope)
        return space_filling_design(
            *box, n, rng, density=density, couplings=self.scope.couplings, names=self.scope.inputs
        )

    def over_domain(self, n: int, rng: np.random.Generator) -> Array:
        """Uniform, independent poses (n, k) rad over the whole domain, all turns of it."""
        scope = self.scope
        return space_filling_design(
            scope.lower, scope.upper, n, rng, density="random", couplings=scope.couplings, names=scope.inputs
        )


def task_of(
    model: ArmModel,
    scope: Scope,
    rng: np.random.Generator,
    *,
    scalar: tuple[Quantity, Scalar] | None = None,
    **more: Any,
) -> Task:
    """The learning task of an arm: compliance along the scope's load, or ``scalar``: a quantity of poses (n, dof).

    Finds out which inputs' whole turns do not matter, and how much the fixed coordinates would.
    """

    def full(Q: Array) -> Array:
        return full_poses(model.robot, scope, Q)

    along = np.array(scope.load_direction)
    quantity, function = scalar or (Quantity(), lambda q: 1.0 / directional_stiffness(model, q, along))
    # The factored basis learns the whole matrix, so turns must not matter to any of it.
    whole: Scalar = (lambda Q: compliance(model, full(Q))) if scalar is None else (lambda Q: function(full(Q)))
    scope = with_whole_turns(scope, whole, rng)
    influence = influence_of_fixed(scope, model.robot, full, function, rng)
    return Task(model, scope, quantity, lambda Q: _in_blocks(function, full(Q)), fixed_influence=influence, **more)


def _in_blocks(function: Scalar, q: Array) -> Array:
    return np.concatenate([function(q[rows]) for rows in in_blocks(len(q), RUNS_A_BLOCK)])
