"""What a training found, as JSON and as a table for pages and for the screen."""

from __future__ import annotations

from typing import Any

from fem.statics.stated import at_load_entry
from robots.quantities import relative, rounded
from stiffarm.commands.fit.words import share_words
from stiffarm.commands.query.answers import surrogate_errors
from stiffarm.pages.report import Table
from stiffarm.session.console import say
from surrogate import Surrogate, Trained


def payload(trained: Trained) -> dict[str, Any]:
    """All surrogates of a training, best first."""
    best = trained.best
    return {
        "best": best.basis,
        "quantity": best.quantity.name,
        "whole_turns_do_not_matter": [n for n, p in zip(best.inputs, best.periodic, strict=True) if p],
        "fixed_coordinates_would_change_it_by": {n: rounded(v) for n, v in best.fixed_influence.items()},
        "calibration_uncertainty": _parameter_bars(best),
        "surrogates": [surrogate_errors(s) for s in trained.surrogates],
        "not_fitted": dict(trained.refused),
    } | at_load_entry(best.at_load)


def _parameter_bars(surrogate: Surrogate) -> dict[str, Any] | None:
    p = surrogate.parameters
    if p is None:
        return None
    return {"parameters": list(p.names), "undetermined": list(p.undetermined), "misfit": rounded(p.misfit)}


def errors_table(trained: Trained, of: str = "") -> Table:
    """Errors of every surrogate on runs kept out, the best first, and those that could not be fitted; ``of``: a model.

    "95 % below" and "worst, with limits" are over all these runs, "worst, uniform" over those not on joint limits.
    """
    columns = (
        "basis",
        "terms",
        "runs",
        "RMS",
        "95 % below",
        "worst, uniform",
        "worst, with limits",
        "6 x 6 worst",
        "inside bars",
        "condition",
    )
    rows = [_row(s) for s in trained.surrogates]
    rows += [(name, "not\u00a0fitted", *("–",) * (len(columns) - 2)) for name in trained.refused]
    name = f"{of}: relative" if of else "Relative"
    return Table(f"{name} errors of the {trained.best.quantity.name} on runs kept out", columns, tuple(rows), best=0)


def _row(s: Surrogate) -> tuple[str, ...]:
    e = s.errors
    return (
        s.basis,
        str(e.n_terms),
        str(e.n_train),
        relative(e.rms_relative),
        relative(e.p95_relative),
        relative(e.max_interior),
        relative(e.max_relative),
        "–" if e.matrix_max is None else relative(e.matrix_max),
        share_words(e.coverage95),
        f"{e.condition_number:.0e}",
    )


def show(trained: Trained) -> None:
    """Held-out errors of the surrogates of a training, and which one is best."""
    errors_table(trained).show()
    say(f"best: {trained.best.basis}")
