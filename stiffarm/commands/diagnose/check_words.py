"""Checks after the name, in words: a line for each that failed, one where all passed, and a table of all."""

from __future__ import annotations

from typing import Final

from doe.diagnosis.checks import Check, Code
from doe.diagnosis.diagnose import Diagnosis
from stiffarm.pages.report import Table

# What a check says where it fails.
AGAINST: Final[dict[Code, str]] = {
    "plausible-parameters": "its parameters are not plausible",
    "predicts-left-out": "it does not predict poses left out",
    "stable": "it depends on a few poses",
    "nothing-left": "something is left",
    "no-twin": "another effect fits as well",
    "one-of-a-kind": "several joints have this fault",
    "like-noise": "the remaining error does not look like noise",
}
RESULT: Final = {True: "passed", False: "failed", None: "not applicable"}


def check_sentences(d: Diagnosis) -> tuple[str, ...]:
    """A line for each check that failed; one line where none did; nothing where nothing was found."""
    failed = [c for c in d.checks if c.passed is False]
    if failed:
        return tuple(f"Against {c.effect or _all(d)}: {AGAINST[c.code]} ({c.evidence})." for c in failed)
    if not d.checks:
        return ()
    passed = sum(c.passed is True for c in d.checks)
    other = len(d.checks) - passed
    beside = f"; {other} of {len(d.checks)} do not apply" if other else ""
    return (f"No check speaks against {_all(d)}: {passed} passed{beside}.",)


def check_table(d: Diagnosis) -> Table:
    """All checks, folded."""
    rows = tuple((c.code, c.effect or "all", RESULT[c.passed], c.evidence, _factor(c)) for c in d.checks)
    heads = ("check", "of", "result", "evidence", "odds times")
    return Table("All checks after the name", heads, rows, (0, 1, 2, 3), folded=True)


def _factor(c: Check) -> str:
    return f"{c.factor:.2g}" if c.passed is False else "1"


def _all(d: Diagnosis) -> str:
    return d.found[0].code if len(d.found) == 1 else f"all {len(d.found)} effects together"
