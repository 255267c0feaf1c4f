"""What set-ups are expected to tell of the rivals of a diagnosis, before they are measured: chances, and in words."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations, islice

import numpy as np

from doe.certainty.verdicts import ALARM, NAME
from doe.diagnosis.hypotheses import NONE, UNKNOWN
from doe.diagnosis.proposals.discrimination import Outcome, Predictions, divergence, joint, outcomes
from doe.diagnosis.proposals.rivals import Question
from robots.arrays import Array, Integers

# Expected log evidence from which on one rival is as good as ruled out (20 to 1).
SETTLED = float(np.log(20.0))
# Set-ups with a smaller chance to bring what they are for are not advised.
WORTH_MEASURING = 0.2
# Pairs told about.
TOLD = 6
# What chances by the rivals alone came to on readings of foreign worlds that nothing was tuned on, with all that no
# rival foresees (laws not quite right, further effects, other noise): CAME of PROMISED right names, and ASTRAY wrong
# ones. To be measured again when the diagnosis changes: `benchmarks/diagnosis/diagnosis_loop.py` prints them.
PROMISED, CAME, ASTRAY, PROPOSALS = 55.9, 16, 4, 80


@dataclass(frozen=True)
class Rival:
    """One hypothesis that is still possible.

    ``probability``: its weight among the rivals; ``hidden``: the present readings cannot see it; ``against_none``:
    expected log evidence against "nothing missing" by the new readings, if it is true; ``before`` and ``after``: what
    the verdict is worth, if it is true, by the readings so far and with the new ones.
    """

    code: str
    probability: float
    hidden: bool
    against_none: float
    before: Outcome
    after: Outcome


@dataclass(frozen=True)
class Foreseen:
    """What set-ups are expected to tell: of each rival, most probable first, of all together, and in words.

    ``after``: if one of the rivals is the whole truth; ``expected``: by what such chances came to (:func:`tempered`).
    """

    rivals: tuple[Rival, ...]
    before: Outcome
    after: Outcome
    expected: Outcome
    words: tuple[str, ...]


def foresee(q: Question, p: Predictions, chosen: list[int], rng: np.random.Generator) -> Foreseen:
    """What set-ups are expected to tell."""
    expected = _by_code(p.code, p.weight, divergence(*joint(p, chosen)))
    codes = list(dict.fromkeys(p.code))
    names = [q.name[code] for code in p.code]

    def verdict(belief: Array) -> Integers:
        return verdicts(codes, belief)

    before, after = (outcomes(p, some, names, verdict, rng) for some in ((), chosen))
    for some in (before, after):
        if UNKNOWN in some:
            # Something unknown has no name that could be right.
            some[UNKNOWN] = Outcome(0.0, 0.0, some[UNKNOWN].wrong)
    order = sorted(q.weight.items(), key=lambda item: -item[1])
    rivals = tuple(Rival(c, w, c in q.hidden, expected.get((c, NONE), 0.0), before[c], after[c]) for c, w in order)
    now, then = _mean(rivals, "before"), _mean(rivals, "after")
    honest = tempered(now, then)
    return Foreseen(rivals, now, then, honest, _words(rivals, expected, now, then, honest))


def tempered(before: Outcome, after: Outcome) -> Outcome:
    """What is to be expected by the rivals' own chances, as far as such came true so far."""
    true, astray = ((count + 0.5) / (PROMISED + 1.0) for count in (CAME, ASTRAY))
    settled = after.right + after.wrong
    return Outcome(
        before.belief + min(true, 1.0) * (after.belief - before.belief),
        min(true * after.right, 1.0),
        min(max(after.wrong, astray * settled), max(1.0 - true * after.right, 0.0)),
    )


def _mean(rivals: Sequence[Rival], when: str) -> Outcome:
    parts = [(r.probability, getattr(r, when)) for r in rivals]
    return Outcome(*(sum(w * getattr(o, f) for w, o in parts) for f in ("belief", "right", "wrong")))


def verdicts(codes: Sequence[str], belief: Array) -> Integers:
    """What is said (n,) by probabilities (n, h) of codes: the number of one of them, -1 where nothing is named.

    As :func:`doe.diagnosis.hypotheses.decide` does, but for poses left out. That nothing is missing is no name.
    """
    effect = np.array([code not in (NONE, UNKNOWN) for code in codes])
    of = {code: belief[:, [k for k, c in enumerate(codes) if c == code]].sum(axis=1) for code in (NONE, UNKNOWN)}
    among = np.where(effect, belief, 0.0)
    top = np.argmax(among, axis=1)
    sure = among.max(axis=1) >= NAME * among.sum(axis=1)
    said = np.where(sure & (of[UNKNOWN] <= 0.5) & effect.any(), top, -1)
    if NONE in codes:
        said = np.where(of[NONE] >= ALARM, np.where(of[NONE] >= NAME, codes.index(NONE), -1), said)
    return np.asarray(said, dtype=np.int64)


def _by_code(code: tuple[str, ...], weight: Array, kl: Array) -> dict[tuple[str, str], float]:
    """Expected log evidence of a code against another: mean over the first one's shapes, the second one's best."""
    index = {c: np.flatnonzero(np.array(code) == c) for c in dict.fromkeys(code)}
    return {
        (a, b): float(np.average(kl[np.ix_(i, j)].min(axis=1), weights=weight[i]))
        for a, i in index.items()
        for b, j in index.items()
        if a != b
    }


def _words(
    rivals: tuple[Rival, ...],
    expected: dict[tuple[str, str], float],
    before: Outcome,
    after: Outcome,
    honest: Outcome,
) -> tuple[str, ...]:
    out = [
        f"probability of the right name: {_percent(before.belief)} now, {_percent(honest.belief)} to be expected with "
        "the new readings",
        f"chances: {_percent(honest.right)} that they settle the right name, {_percent(honest.wrong)} that they settle "
        f"a wrong one, {_percent(honest.open)} that nothing is settled",
        f"if one of the candidates left were the whole truth, these would be {_percent(after.right)}, "
        f"{_percent(after.wrong)} and {_percent(after.open)}; on independent test readings {CAME} of "
        f"{PROMISED:.0f} right names so promised came true, in {PROPOSALS} proposals",
    ]
    hidden = [r for r in rivals if r.hidden]
    if hidden:
        seen = [r.code for r in hidden if r.against_none >= SETTLED]
        names = f": {', '.join(seen)}" if seen else ""
        out.append(f"{len(hidden)} candidates are hidden so far; the new readings would show {len(seen)}{names}")
    # Of what stays hidden there is nothing to tell in pairs.
    pairs = [r.code for r in rivals if r.code != UNKNOWN and not (r.hidden and r.against_none < SETTLED)]
    for pair in islice(combinations(pairs, 2), TOLD):
        least = min(expected[pair], expected[pair[::-1]])
        what = "would settle it" if least >= SETTLED else "would not settle it"
        first, second = map(called, pair)
        out.append(f"{first} or {second}: expected log evidence {least:.1f}, which {what}")
    return tuple(out)


def _percent(share: float) -> str:
    return f"{100.0 * max(share, 0.0):.0f} %"


def called(code: str) -> str:
    """A hypothesis in words."""
    return {NONE: "nothing missing", UNKNOWN: "something unknown"}.get(code, code)
