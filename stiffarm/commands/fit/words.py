"""Words about surrogates: what a basis is, why one was taken, what is doubtful."""

from __future__ import annotations

from robots import Remark
from robots.quantities import relative
from surrogate import Surrogate, Trained
from surrogate.model import COMPLIANCE
from surrogate.training import NOTHING

# A share inside the 95 % bars outside of this range is a matter for a warning.
HONEST = (0.93, 0.97)
# A worst error above this is worth a warning: springs are known to some percent at best.
LARGE = 0.05
# An interval wider than this share of the value is no number to act on.
KNOWN = 0.5


def basis_words(one: Surrogate) -> str:
    """What a basis is, in one sentence."""
    of = {"logarithm": "of the logarithm of the quantity", "direct": "of the quantity itself"}.get(one.target, "")
    if one.basis == "polynomial":
        return f"all products of powers of the scaled joint angles up to degree {one.degree} in total, {of}."
    if one.basis == "trigonometric":
        return (
            f"all products of sines and cosines up to order {one.degree} in each angle, {of}. For constant springs "
            "the compliance of a serial arm is such a sum."
        )
    if one.basis == "factored":
        return (
            "rows whose weighted squares add up to the 6 x 6 compliance. It is positive semidefinite by construction, "
            "and knows every load direction."
        )
    return f"products of sines, cosines and powers of the angles, chosen one by one by what they explain, {of}."


def choice_words(trained: Trained) -> str:
    """Which basis was taken and why."""
    best, others = trained.best, trained.surrogates[1:]
    rms = relative(best.errors.rms_relative)
    if not others:
        why = (
            "no other basis could be fitted" if trained.refused else "it was asked for by name, and no other was tried"
        )
        return f"The {best.basis} basis is used: {why}. Its RMS error on runs kept out of the fit is {rms}."
    rest = ", ".join(f"{relative(s.errors.rms_relative)} ({s.basis})" for s in others)
    if any(s.errors.rms_relative <= NOTHING for s in others):
        better = "it covers all load directions" if best.has_matrix else "it was fitted first"
        return (
            f"The {best.basis} basis is used: its RMS error on runs kept out of the fit is {rms}, that of the others "
            f"{rest}. Errors below a millionth count as equal, because no arm is known that well; among equals, "
            f"{better}."
        )
    more = " It also covers all load directions." if best.has_matrix else ""
    return (
        f"The {best.basis} basis is used: it has the smallest RMS error on runs kept out of the fit, {rms}, against "
        f"{rest}.{more}"
    )


def doubts(trained: Trained) -> list[str]:
    """What a user of the surrogate must not overlook."""
    best = trained.best
    e = best.errors
    out: list[str] = []
    if e.max_relative > LARGE:
        out.append(
            f"The largest error on runs kept out is {relative(e.max_relative)}: ask for the error bar at each pose"
        )
    if not HONEST[0] <= e.coverage95 <= HONEST[1]:
        out.append(f"The 95 % error bars hold {share_words(e.coverage95)} of the runs kept out")
    if best.quantity.name == COMPLIANCE and not best.has_matrix:
        d = ", ".join(f"{v:g}" for v in best.load_direction)
        out.append(Remark(f"It knows one load direction only, {d} in base axes", code="W016"))
    return out


def share_words(share: float) -> str:
    """A share of runs in percent, to a tenth (hard space)."""
    return f"{100.0 * share:.1f}\u00a0%"


def half_width(value: float) -> str:
    """The half-width of an interval over its value: ``± 4 %``; of one that says nothing, that."""
    return f"± {relative(value)}" if value < KNOWN else "not known to better than half its size"
