"""How much of what is hidden the springs cannot take up, by the true noise."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from .arms import turns
from .noise import SESSION_ZERO, has_sessions, read_axes, sds
from .spec import Row, Spec

Array = NDArray[np.float64]
UNSEEN = 1e-9


def spring_motions(spec: Spec, rows: list[Row]) -> Array:
    """What the point moves by for every compliance of 1 rad/(N m), (n, 3, joints), as the table states it."""
    arm, out = spec.of, []
    for r in rows:
        stand = arm.stand(r.angles)
        moves, _ = turns(arm, stand, r.point)
        about = stand.axes.copy()
        if spec.path == "parallelogram":
            # The third drive turns the forearm against the carousel, so the second moves it without turning it.
            moves[1], about[1] = moves[1] - moves[2], about[1] - about[2]
        torques = moves @ r.force + about @ r.moment
        out.append(moves.T * torques)
    return np.array(out)


def excess(spec: Spec, rows: list[Row], alone: Array, whole: Array) -> float:
    """Smallest chi-square of true readings ``alone`` (n, 3) with the springs that the model has free and none below 0.

    Noise is that of the set's readings ``whole`` (n, 3). What is in common to a set-up's readings or to a session's is
    one more unknown with a variance of its own, which is the same as a full covariance.
    """
    axes = read_axes(spec)
    sd = sds(spec, rows, whole)[:, axes].ravel()
    free = [i for i, k in enumerate(spec.stated) if k]
    springs = spring_motions(spec, rows)[:, axes][:, :, free].reshape(len(sd), -1)
    common = []
    if spec.scatter:
        for visit in sorted({r.visit for r in rows}):
            of = np.array([r.visit == visit for r in rows])[:, None]
            common.append((spec.scatter * whole[:, axes] * of).ravel())
    if has_sessions(spec):
        for session in sorted({r.session for r in rows}):
            of = np.array([r.session == session for r in rows])[:, None]
            common += [(SESSION_ZERO * of * (np.array(axes) == k)).ravel() for k in axes]
    shared = np.array(common).reshape(-1, len(sd)).T
    # What a spring's readings come to by its stated stiffness: a joint without a lever moves them by round-off only.
    sizes = np.linalg.norm(springs / sd[:, None], axis=0)
    seen = sizes / np.array(spec.stated)[free] > UNSEEN * np.linalg.norm(whole[:, axes].ravel() / sd)
    springs, scale = springs[:, seen], sizes[seen]
    A = np.hstack([springs / scale, shared]) / sd[:, None]
    A = np.vstack([A, np.hstack([np.zeros((shared.shape[1], len(scale))), np.eye(shared.shape[1])])])
    y = np.concatenate([alone[:, axes].ravel() / sd, np.zeros(shared.shape[1])])
    # Only the triangle is left to be solved: thousands of readings become a hundred rows.
    R = np.asarray(np.linalg.qr(np.hstack([A, y[:, None]]), mode="r"))
    low = np.concatenate([np.zeros(len(scale)), np.full(shared.shape[1], -np.inf)])
    found = lsq_linear(R[:, :-1], R[:, -1], (low, np.full(len(low), np.inf)), tol=1e-14)
    return float(2 * found.cost)
