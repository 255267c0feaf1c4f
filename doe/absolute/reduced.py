"""Least squares with a frame for each session, reduced block by block to one triangle: memory linear in the poses.

Readings of a session are ``position = R (exp(f) P(u) + t) + noise``; the frame's six variables (f, t) belong to it
alone. A block's rows ``[F J r]`` (frame, the other variables, residual, all in the arm's axes: noise is alike in all
directions) go through a Householder factorisation on top of the session's triangle; the rows under the first six of a
finished session know nothing of its frame and go to the triangle of all sessions. Products of derivatives (normal
equations) are never formed, so no digit is lost to their squared condition. (Golub and Pereyra 1973,
doi:10.1137/0710036, for separable problems; Demmel et al. 2012, doi:10.1137/080731992, for factorisations in blocks.)
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from doe.absolute.turns import rotation
from fem.statics.vectors import cross
from robots.arrays import Array

FRAME = 6


@dataclass(frozen=True)
class Frame:
    """A session's frame: tracker = ``R`` (3, 3) arm + ``t`` (3,) m."""

    R: Array
    t: Array

    def moved(self, step: Array) -> Frame:
        """The frame after a turn and a shift (6,) about the arm's own axes, which come first."""
        return Frame(self.R @ rotation(step[:3]), self.t + self.R @ step[3:])

    def inside(self, position: Array) -> Array:
        """Positions (n, 3) m of the tracker in the arm's axes (3, n)."""
        return np.asarray(self.R.T @ (position - self.t).T)


def frame_columns(P: Array) -> Array:
    """How positions P (3, n) m move with a frame's variables (6, 3, n): turns about the arm's axes, and shifts."""
    out = np.zeros((FRAME, *P.shape))
    for a in range(3):
        unit = np.eye(3)[:, a, None]
        out[a], out[3 + a] = cross(np.broadcast_to(unit, P.shape), P), unit
    return out


def upper(rows: Array) -> Array:
    """The triangle (min(m, c), c) of a Householder factorisation of rows (m, c)."""
    return np.asarray(np.linalg.qr(rows, mode="r"))


def triangle(*rows: Array) -> Array:
    """The triangle of stacked rows (m, c): its products are theirs."""
    stacked = np.vstack(rows)
    return upper(stacked) if len(stacked) > stacked.shape[1] else stacked


def block_rows(F: Array, J: Array, r: Array, root: Array) -> Array:
    """Rows (3 n, 6 + p + 1) of a block from columns (., 3, n) and residuals (3, n), times ``root`` (n,)."""
    out = np.empty((len(F) + len(J) + 1, 3, F.shape[2]))
    out[: len(F)], out[len(F) : -1], out[-1] = F, J, r
    out *= root
    return out.reshape(len(out), -1).T


@dataclass(frozen=True)
class Own:
    """What a session's frame depends on: ``R f + S u = z``; R (6, 6), S (6, p), z (6,)."""

    R: Array
    S: Array
    z: Array

    def step(self, step: Array) -> Array:
        """The frame's step (6,) that goes with a step (p,) of the other variables."""
        return np.asarray(np.linalg.lstsq(self.R, self.z - self.S @ step, rcond=1e-12)[0])

    @property
    def follows(self) -> Array:
        """How the frame moves with the other variables (6, p)."""
        return np.asarray(-np.linalg.lstsq(self.R, self.S, rcond=1e-12)[0])


@dataclass(frozen=True)
class Reduced:
    """``|z - R x|^2 + rest`` for a step x (p,) of the variables that are no frame's; R (p, p); each session's own."""

    R: Array
    z: Array
    rest: float
    own: tuple[Own, ...]


def reduce_sessions(sessions: Sequence[Sequence[Callable[[], Array]]], width: int) -> Reduced:
    """Reduce blocks of rows (m, 6 + p + 1), made one after the other, of each session; ``width`` = p."""
    whole, own = np.zeros((0, width + 1)), []
    for blocks in sessions:
        mine = np.zeros((0, FRAME + width + 1))
        for block in blocks:
            mine = triangle(mine, block())
        padded = np.zeros((max(FRAME - len(mine), 0), mine.shape[1]))
        mine = np.vstack([upper(mine), padded])
        own.append(Own(mine[:FRAME, :FRAME], mine[:FRAME, FRAME:-1], mine[:FRAME, -1]))
        whole = triangle(whole, mine[FRAME:, FRAME:])
    return as_reduced(whole, tuple(own))


def as_reduced(whole: Array, own: tuple[Own, ...]) -> Reduced:
    """The parts of a triangle (., p + 1)."""
    width = whole.shape[1] - 1
    full = np.zeros((max(len(whole), width + 1), width + 1))
    full[: len(whole)] = upper(whole) if len(whole) > width + 1 else whole
    top = upper(full)
    return Reduced(top[:width, :width], top[:width, -1], float(top[width, -1] ** 2), own)
