"""Bases over joint angles for ln(stiffness): the stiffness stays positive whatever the weights."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from robots.arrays import Array, Integers


class Basis(Protocol):
    """Functions of the pose that ln(stiffness) is a combination of."""

    @property
    def size(self) -> int:
        """How many functions."""
        ...

    def __call__(self, q: Array) -> Array:
        """Values (n, size) at poses q (n, dof) rad."""
        ...


@dataclass(frozen=True)
class PolynomialBasis:
    """Monomials in scaled angles: ``columns`` of the pose, ``centre``, ``half_range`` rad, ``exponents`` (t, i)."""

    columns: tuple[int, ...]
    centre: Array
    half_range: Array
    exponents: Integers

    @property
    def size(self) -> int:
        """See :class:`Basis`."""
        return len(self.exponents)

    def __call__(self, q: Array) -> Array:
        """See :class:`Basis`."""
        u = (q[:, list(self.columns)] - self.centre) / self.half_range
        return np.asarray(np.prod(u[:, None, :] ** self.exponents[None], axis=2))


@dataclass(frozen=True)
class FourierBasis:
    """``1, cos q, sin q, ... cos m q, sin m q`` of the angle in one column."""

    column: int
    order: int

    @property
    def size(self) -> int:
        """See :class:`Basis`."""
        return 2 * self.order + 1

    def __call__(self, q: Array) -> Array:
        """See :class:`Basis`."""
        angles = q[:, self.column, None] * np.arange(1, self.order + 1)
        waves = np.stack([np.cos(angles), np.sin(angles)], axis=2).reshape(len(q), -1)
        return np.hstack([np.ones((len(q), 1)), waves])


@dataclass(frozen=True)
class TableBasis:
    """Piecewise linear between ``nodes`` (t,) rad, in rising order, of the angle in one column."""

    column: int
    nodes: Array

    @property
    def size(self) -> int:
        """See :class:`Basis`."""
        return len(self.nodes)

    def __call__(self, q: Array) -> Array:
        """See :class:`Basis`."""
        eye = np.eye(self.size)
        return np.stack([np.interp(q[:, self.column], self.nodes, row) for row in eye], axis=1)
