"""A training's surrogates beside what one would take instead, on the same runs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from robots import InputError
from robots.arrays import Array
from robots.files.csv_text import records_text
from robots.progress import Progress
from stiffarm.session.json_text import number
from surrogate import Surrogate, Trained, predict
from surrogate.expansion import Expansion
from surrogate.model import COMPLIANCE
from surrogate.peer_comparison import PeerResult, compare_with_peers
from surrogate.peer_estimators import OwnCandidate


def compare(trained: Trained, progress: Progress | None = None) -> list[dict[str, Any]]:
    """Fit the other methods on the training's runs and judge them on its held-out runs; rows, ours first.

    Raises
    ------
    InputError
        A surrogate of another quantity than the compliance.
    """
    best = trained.best
    if best.quantity.name != COMPLIANCE:
        raise InputError("--compare with --quantity", value=best.quantity.name, allowed="stiffness")
    held, training = trained.held_out, trained.training

    def count(done: int, total: int, _: str) -> None:
        if progress is not None:
            progress(done, total)

    rows = compare_with_peers(
        training.Q,
        training.value,
        held.Q,
        held.value,
        boundary=np.arange(len(held.Q)) >= trained.uniform,
        own={f"ours, {s.basis}": _own(s, trained.seconds[s.basis]) for s in trained.surrogates},
        progress=count,
    )
    return [_row(row) for row in rows]


def _own(one: Surrogate, seconds: float) -> OwnCandidate:
    bars = one.bars
    assert bars is not None  # noqa: S101 - training has judged it

    def interval(fitted: Any, Q: Array) -> tuple[Array, Array]:
        c, half = predict(one, Q), bars.half_width(Q)
        # The bars are of |predicted / true - 1|.
        return c / (1.0 + half), np.divide(c, 1.0 - half, out=np.full_like(c, np.inf), where=half < 1.0)

    laws = () if one.factor is None else one.factor.weights
    return OwnCandidate(
        f"stiffarm: {one.basis} {one.degree}",
        lambda Q, y: one,
        lambda fitted, Q: predict(one, Q),
        lambda fitted: _bytes(one.expansion) + sum(_bytes(law) for law in laws),
        interval,
        lambda fitted: _bytes(bars.leverage) + _bytes(bars.scale),
        seconds,
        lambda fitted: one.errors.n_train,
    )


def _bytes(e: Expansion) -> int:
    """Of its numbers: coefficients and families in double precision, a byte for each function of a term."""
    return 8 * e.coefficients.size + e.terms.size + 8 * sum(f.matrix.size for f in e.families)


def _row(found: PeerResult) -> dict[str, Any]:
    row: dict[str, Any] = {"method": found.name, "what": found.title, "ours": found.own, "chosen": found.chosen}
    row |= {
        "runs_fitted": found.n_train,
        "fit_s": number(found.fit_s),
        "seconds_for_1e5_queries": number(found.query_s),
    }
    for where, errors in (("interior", found.uniform), ("boundary", found.boundary)):
        values = {} if errors is None else asdict(errors)
        row |= {f"{where}_{name}": _maybe(values.get(name)) for name in ("rms", "worst", "coverage")}
    row |= {
        "bytes": None if found.size is None else found.size.values,
        "messages": list(found.messages),
        "refused": found.refused,
    }
    return row


def _maybe(value: float | None) -> float | None:
    return number(value) if value is not None and np.isfinite(value) else None


def table(rows: Sequence[dict[str, Any]]) -> str:
    """The rows as CSV."""
    flat = [row | {"messages": "; ".join(row["messages"])} for row in rows]
    return records_text(flat)
