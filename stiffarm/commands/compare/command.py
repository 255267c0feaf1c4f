"""The command `compare`: what differs between results of one kind, by how much, and whether beyond the noise."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from doe.estimation.differences import LEVEL, Figure, Joint, Pair, joint, pairs
from robots import InputError
from robots.quantities import Quantity, percent, rounded, significant
from stiffarm.capability import capability_without_arm
from stiffarm.commands.compare.map_page import page_of_both
from stiffarm.commands.compare.sources import Source, check_alike, figures_of, read_source
from stiffarm.pages.report import Bullets, KeyFigure, Section, Text
from stiffarm.request import READINGS, Request, argument
from stiffarm.result import Drawing, Result, Table
from surrogate.maps.differences import MapPair, compare_maps
from surrogate.maps.mesh import read_map

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Drawn

    from stiffarm.session.outputs import OutputFolder

# More than these nobody reads side by side.
MOST = 8
# Map quantities that are drawn.
DRAWN = 4
PARTS_OF_RUN = ("diagnosis", "stiffness_map.vtu")
FIRST, SECOND = Quantity("first"), Quantity("second")
DIFFERENCE, CHANGE = Quantity("difference"), Quantity("relative_change")
P_VALUE = Quantity("p_value", label="p", digits=2, stored=3)
FIRST_MEDIAN, SECOND_MEDIAN = Quantity("first_median", digits=3), Quantity("second_median", digits=3)
# The change that so many of a map's points stay below.
SPREAD = tuple(Quantity(f"change_{name}") for name in ("5_percent", "median", "95_percent"))
BEYOND = Quantity("share_beyond_noise")
MARGIN = {
    "map": (
        "Beyond the noise: more than 1.96 standard deviations of both maps' combined uncertainty.",
        "Each point that both maps reach is compared; stiffnesses as a fraction of the first map's.",
        "Maps with different robots, loads, normals, points or units are refused.",
    ),
    "": (
        "Beyond the noise: significant at 5 % by Student's t, corrected for the number of comparisons (Holm).",
        "Each is compared in the variable whose error is normally distributed (for a stiffness, the compliance). "
        "'Perhaps': below 5 % alone, but among so many comparisons one such is expected by chance.",
        "A parameter that one of them does not identify counts as different only where the 95 % intervals do not "
        "overlap.",
        "The test of all parameters together uses the covariances kept in calibrated model files.",
    ),
}


@dataclass(frozen=True, kw_only=True)
class CompareRequest(Request):
    """Show what differs between two results by more than noise.

    Compares calibrations, diagnoses, maps or placements; for two runs, their calibrations. Writes comparison.json and
    a report into --out; for two maps made with --html also a page with both side by side and their difference.

    Examples
    --------
    >>> import stiffarm as sa, tempfile
    >>> arm, folder = sa.load("xr701", links="rigid"), tempfile.mkdtemp()
    >>> data = sa.read_readings(sa.bundled("xr701"), arm)
    >>> for k, path in enumerate(("parallelogram", "serial")):
    ...     given = sa.load("xr701", links="rigid", load_path=path)
    ...     _ = sa.calibrate(given, data, free=["j2.stiffness", "j3.stiffness"]).arm.save(f"{folder}/{k}.toml")
    >>> sa.compare(f"{folder}/0.toml", f"{folder}/1.toml").differs
    (('j2.stiffness',),)
    """

    first: Path | str = argument(
        "The result that the others are compared with: a folder of run, calibrate, diagnose, map or place, its JSON "
        "file, a calibrated model file, or a map (.vtu, .vti, .vtp).",
        READINGS,
        metavar="A",
        required=True,
    )
    others: Sequence[Path | str] | Path | str = argument(
        "One or more results of the same kind.", READINGS, metavar="B...", required=True, several=True
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 2 <= len(self.paths) <= MOST:
            raise InputError(
                "results to compare",
                code="A012",
                value=len(self.paths),
                allowed=f"2 to {MOST}",
                remedy="name the first one, then those to compare with it",
            )

    @property
    def paths(self) -> list[Path]:
        """All of them, the first one first."""
        others = (self.others,) if isinstance(self.others, Path | str) else self.others
        return [Path(one) for one in (self.first, *others)]


@dataclass(frozen=True, eq=False)
class Compared:
    """Two results: ``pairs`` of parameters, ``settings`` (both in words, by name), ``joint`` of all; or ``maps``."""

    a: Source
    b: Source
    pairs: tuple[Pair, ...] = ()
    settings: Mapping[str, tuple[str, str]] | None = None
    joint: Joint | None = None
    maps: MapPair | None = None

    @property
    def beyond(self) -> list[Pair]:
        """Parameters that differ by more than noise."""
        return [p for p in self.pairs if p.verdict == "beyond the noise"]

    @property
    def shared(self) -> list[Pair]:
        """Parameters that both have."""
        return [p for p in self.pairs if p.a is not None and p.b is not None]

    @property
    def noun(self) -> str:
        """What is compared."""
        return "figure" if self.a.kind == "placement" else "parameter"

    @property
    def counted(self) -> tuple[int, str]:
        """How many can be judged: ``5``, ``parameters that both identify``."""
        count = sum(p.verdict != "undecided" for p in self.shared)
        return count, f"{self.noun}s that both {'have' if self.a.kind == 'placement' else 'identify'}"


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Comparison(Result):
    """Results compared with the first one; ``found`` holds each pair of them."""

    found: tuple[Compared, ...]

    @property
    def differs(self) -> tuple[tuple[str, ...], ...]:
        """Of each other result the parameters that differ by more than noise; of maps it is empty."""
        return tuple(tuple(p.name for p in c.beyond) for c in self.found)


def answer(asked: CompareRequest) -> Comparison:
    """Each of several results against the first one.

    Raises
    ------
    InputError
        Nothing that can be compared, or things of different kinds, robots, quantities or units.
    """
    some = [read_source(path, number) for number, path in enumerate(asked.paths, start=1)]
    check_alike(some)
    first, *others = some
    if is_map := first.kind == "map":
        maps = [read_map(s.file) for s in some]
        found = [
            Compared(first, s, maps=compare_maps(maps[0], other, (first.name, s.name)))
            for s, other in zip(others, maps[1:], strict=True)
        ]
    else:
        found = [_compared(first, other) for other in others]
    alone = len(found) == 1
    sure, *how = MARGIN["map" if is_map else ""]
    remarks = [_remarks(c) for c in found]
    pages, said = _pages(found) if is_map else ({}, "")
    about = [Section("Page of both maps", (Text(said),))] if said else []
    return Comparison(
        name="comparison",
        title=f"Two {first.kind}s" if alone else f"{len(some)} {first.kind}s",
        question="what differs, and is it more than noise?",
        answer=_headline(found[0]) if alone else " ".join(f"{c.b.name}: {_headline(c)}" for c in found),
        how_sure=sure,
        facts={
            "kind": first.kind,
            "robot": first.robot or None,
            "first": {"name": first.name, "file": first.file.name},
            "others": [_facts(c) for c in found],
        },
        tables=_of_maps(found) if is_map else _of_parameters(found),
        drawings=tuple(
            drawing for k, c in enumerate(found, start=1) for drawing in _drawings(c, "" if alone else f"{k}_")
        ),
        key=_key_figures(found[0]),
        sections=(*about, Section("How it was done", (Bullets(tuple(how)),), folded=True)),
        remarks=tuple(
            remarks[0] if alone else (f"{c.b.name}: {r}" for c, rs in zip(found, remarks, strict=True) for r in rs)
        ),
        found=tuple(found),
        made_of=f"first: {first.name}; compared: {', '.join(c.b.name for c in found)}",
        more=partial(_write_pages, pages),
    )


def _compared(a: Source, b: Source) -> Compared:
    figures, said = [], []
    for s in (a, b):
        with _as_ours(s):
            figures.append(figures_of(s))
            said.append(_said(s))
    found = Compared(a, b, tuple(pairs(figures[0], figures[1])))
    if not found.shared and a.kind == "calibration":
        raise InputError(
            f"{a.name} and {b.name} have no parameter in common",
            code="A012",
            allowed="calibrations of the same parameters",
            remedy="compare others, or calibrate with the same --free",
        )
    wrong = next((p for p in found.shared if p.verdict == "other"), None)
    if wrong is not None:
        raise InputError(
            f"{a.name} and {b.name}: unit of {wrong.name}",
            code="A012",
            value=wrong.unit,
            allowed="the same in both",
            remedy="make both with one version of stiffarm",
        )
    together = None if a.uncertainty is None or b.uncertainty is None else joint(a.uncertainty, b.uncertainty)
    settings = {key: (said[0][key], said[1][key]) for key in said[0] if key in said[1]}
    return Compared(a, b, found.pairs, settings, together)


@contextmanager
def _as_ours(s: Source) -> Iterator[None]:
    """One message where a results file does not hold what it says that it holds."""
    try:
        yield
    except (AttributeError, IndexError, KeyError, TypeError, ValueError) as error:
        what = f"{s.name} does not hold what a {s.kind} of stiffarm holds"
        raise InputError(what, code="A012", remedy="make it again") from error


def _said(s: Source) -> dict[str, str]:
    """What is no number: how it was made, what a diagnosis says, how well a calibration fits."""
    keys = {
        "calibration": ("scheme", "load_path", "links", "readings", "rms_mm", "left_one_pose_out_rms_mm"),
        "diagnosis": ("verdict", "load_path", "links", "readings", "poses", "stated_probability"),
        "placement": ("cell", "aim", "mode", "path_points", "path_length_mm"),
    }[s.kind]
    origin = None if s.model is None else s.model.calibration
    # Of a model file what it keeps.
    content = s.content or ({} if origin is None else vars(origin))
    simple = {key: content[key] for key in keys if isinstance(content.get(key), str | int | float)}
    out = {key: significant(v, 4) if isinstance(v, float) else str(v) for key, v in simple.items()}
    if s.kind == "diagnosis":
        codes = [one["code"] for key in ("effects", "learned") for one in s.content.get(key, [])]
        out["effects"] = ", ".join(codes) or "none"
        gap = s.content.get("gap", {}).items()
        out |= {key: significant(v, 4) for key, v in gap if key.endswith("_mm") and isinstance(v, int | float)}
    return out


def _facts(c: Compared) -> dict[str, Any]:
    """What holds for one of the others."""
    out: dict[str, Any] = {"name": c.b.name, "file": c.b.file.name, "answer": _headline(c)}
    if c.maps is not None:
        return out | {
            "points": len(c.maps.points),
            "only_first_reaches": c.maps.only_a,
            "only_second_reaches": c.maps.only_b,
        }
    together = None
    if c.joint is not None:
        together = {
            "chi_square": rounded(c.joint.chi2),
            "degrees_of_freedom": c.joint.freedom,
            "p_value": rounded(c.joint.p, 3),
        }
    return out | {"all_at_once": together}


def _labelled(found: Sequence[Compared], counts: Sequence[int]) -> dict[str, list[str]]:
    """Which of several others a row is about."""
    return (
        {"result": [c.b.name for c, n in zip(found, counts, strict=True) for _ in range(n)]} if len(found) > 1 else {}
    )


def _sides(found: Sequence[Compared]) -> str:
    """Which is the first and which the second, for the title of a table."""
    return f": {found[0].b.name} (second) against {found[0].a.name} (first)" if len(found) == 1 else ""


def _of_parameters(found: Sequence[Compared]) -> tuple[Table, ...]:
    rows = [p for c in found for p in c.pairs]
    sides = {FIRST: [p.a for p in rows], SECOND: [p.b for p in rows]}
    values = {q: np.array([_or_nan(None if f is None else f.value) for f in some]) for q, some in sides.items()}
    change = np.array([p.change for p in rows])
    is_share = np.array([p.is_share for p in rows], dtype=bool)
    noun = found[0].noun
    main = Table(
        f"{noun}s",
        f"{noun.capitalize()}s{_sides(found)}",
        _labelled(found, [len(c.pairs) for c in found])
        | {
            noun: [p.name for p in rows],
            "unit": ["" if p.unit == "1" else p.unit for p in rows],
            "verdict": [_verdict(p) for p in rows],
            "change": [_change(p) for p in rows],
        },
        {**values, P_VALUE: np.array([p.p for p in rows])},
        {q: _ends(some) for q, some in sides.items()},
        {DIFFERENCE: values[SECOND] - values[FIRST], CHANGE: np.where(is_share, change, np.nan)},
    )
    settings = [(c, name, both) for c in found for name, both in (c.settings or {}).items()]
    if not settings:
        return (main,)
    labels: dict[str, Sequence[str | bool]] = {"result": [c.b.name for c, _, _ in settings]} if len(found) > 1 else {}
    labels |= {
        "setting": [name.replace("_", " ") for _, name, _ in settings],
        "first": [both[0] for _, _, both in settings],
        "second": [both[1] for _, _, both in settings],
        "differs": [both[0] != both[1] for _, _, both in settings],
    }
    return main, Table("settings", "How they were made, and what they say", labels, {})


def _or_nan(value: float | None) -> float:
    return np.nan if value is None else value


def _ends(some: Sequence[Figure | None]) -> tuple[Any, Any]:
    """Ends of the intervals; an open end is infinite, NaN where there is no interval."""
    ends = [
        (np.nan, np.nan)
        if f is None or (f.low is None and f.high is None)
        else (-np.inf if f.low is None else f.low, np.inf if f.high is None else f.high)
        for f in some
    ]
    low, high = np.array(ends, dtype=float).reshape(-1, 2).T
    return low, high


def _verdict(p: Pair) -> str:
    return p.verdict if p.verdict != "other" else f"only the {'first' if p.b is None else 'second'} has it"


def _change(p: Pair) -> str:
    """By how much the second differs."""
    if not np.isfinite(p.change):
        return "–"
    return f"{1.0 + p.change:.3g} times" if p.is_share and p.change >= 1.0 else _signed(p.change, "", p.is_share)


def _signed(value: float, unit: str, is_share: bool) -> str:
    """A change with its sign: ``+3.2 %`` or ``−0.5 N``."""
    shown, unit = (100.0 * value, "%") if is_share else (value, unit)
    return f"{'+' if shown > 0.0 else ''}{significant(shown)} {unit}".rstrip()


def _of_maps(found: Sequence[Compared]) -> tuple[Table, ...]:
    maps = [c.maps for c in found if c.maps is not None]
    rows = [q for one in maps for q in one.quantities]
    spreads = np.array([q.spread for q in rows]).reshape(-1, 3)
    medians = np.array([[np.median(x[q.known]) if q.known.any() else np.nan for x in (q.a, q.b)] for q in rows])
    beyond = np.array([q.share_beyond for q in rows])
    labels = _labelled(found, [len(one.quantities) for one in maps]) | {
        "quantity": [q.label for q in rows],
        "unit": [q.unit for q in rows],
        "change": [_signed(s[1], "", q.is_share) for q, s in zip(rows, spreads, strict=True)],
        "nine_tenths_of_the_points": [_range(q, s, "") for q, s in zip(rows, spreads, strict=True)],
        "beyond_the_noise": ["–" if math.isnan(v) else f"{percent(v)} of the points" for v in beyond],
    }
    more = dict(zip(SPREAD, spreads.T, strict=True)) | {BEYOND: beyond}
    extra: dict[str, Sequence[Any]] = {
        "name": [q.name for q in rows],
        "change_is_share": [q.is_share for q in rows],
        "points": [int(q.known.sum()) for q in rows],
    }
    values = {FIRST_MEDIAN: medians[:, 0], SECOND_MEDIAN: medians[:, 1]}
    return (Table("quantities", f"Quantities{_sides(found)}", labels, values, {}, more, extra),)


def _range(q: Any, spread: Any, unit: str) -> str:
    low, high = (_signed(v, "", q.is_share).removesuffix(" %") for v in spread[[0, 2]])
    return f"{low} to {high} {'%' if q.is_share else unit}".rstrip()


def _headline(c: Compared) -> str:
    """The answer in a sentence."""
    if c.maps is not None:
        q = c.maps.quantities[0]
        if not q.known.any():
            return "No point has a value in both maps."
        text = (
            f"{q.label[0].upper()}{q.label[1:]}: the second map differs from the first by "
            f"{_signed(q.spread[1], q.unit, q.is_share)} in the median, {_range(q, q.spread, q.unit)} over nine tenths "
            f"of {int(q.known.sum())} points"
        )
        if q.beyond is not None:
            text += f"; at {percent(q.share_beyond)} of them by more than the uncertainty of both"
        return f"{text}."
    count, words = c.counted
    if not c.shared:
        return f"They have no {c.noun} in common."
    if not c.beyond:
        perhaps = [p.name for p in c.shared if p.verdict == "perhaps"]
        more = f" ({', '.join(perhaps[:4])} perhaps)" if perhaps else ""
        return f"None of {count} {words} differs by more than noise{more}."
    top = max(c.beyond, key=lambda p: abs(p.change) if np.isfinite(p.change) else 0.0)
    verb = "differs" if len(c.beyond) == 1 else "differ"
    return f"{len(c.beyond)} of {count} {words} {verb} by more than noise; most: {top.name}, {_change(top)}."


def _remarks(c: Compared) -> list[str]:
    """What else a reader must know."""
    out = []
    if c.maps is not None:
        out += [f"{text[0].upper()}{text[1:]}." for text in c.maps.remarks]
        for count, which in ((c.maps.only_a, "first"), (c.maps.only_b, "second")):
            if count:
                out.append(f"{count} point{'s are' if count > 1 else ' is'} reached in the {which} map only.")
        if all(q.beyond is None for q in c.maps.quantities):
            out.append(
                "Only maps of a calibrated model hold an uncertainty: without that of both, differences cannot be "
                "judged against it."
            )
        return out
    if c.a.data and c.a.data == c.b.data:
        out.append(
            "Both use the same readings, so they differ only by the choice of model. They share the noise, "
            "so even differences smaller than the intervals can be real."
        )
    if c.a.of_run and c.b.of_run:
        more = (f"stiffarm compare {c.a.name}/{part} {c.b.name}/{part}" for part in PARTS_OF_RUN)
        out.append(f"For two runs, their calibrations are compared. To compare the rest: {', '.join(more)}.")
    if c.joint is not None:
        real = "more than noise" if c.joint.p < LEVEL else "no more than noise"
        p = "p < 0.001" if c.joint.p < 1e-3 else f"p {significant(c.joint.p, 2)}"
        out.append(
            f"All {c.joint.freedom} shared parameters tested together, with their covariances: {real} (chi-square "
            f"{significant(c.joint.chi2)} on {c.joint.freedom} degrees of freedom, {p})."
        )
    settings = c.settings or {}
    for name in ("load_path", "links", "scheme", "cell"):
        a, b = settings.get(name, ("", ""))
        out += [f"They differ in {name.replace('_', ' ')}: {a} and {b}."] if a != b else []
    return out


def _key_figures(c: Compared) -> tuple[KeyFigure, ...]:
    if c.maps is None:
        count, words = c.counted
        return (KeyFigure(f"{len(c.beyond)} of {count}", f"{words} differ by more than noise"),)
    q = c.maps.quantities[0]
    return (
        KeyFigure(_signed(q.spread[1], "", q.is_share), f"change of {q.label} in the median"),
        KeyFigure(_range(q, q.spread, ""), "over nine tenths of the points"),
    )


def _drawings(c: Compared, before: str) -> Iterator[Drawing]:
    if c.maps is None:
        drawn = [p for p in c.shared if p.a is not None and p.a.value and p.b is not None and p.b.value is not None]
        if drawn:
            caption = "Both values divided by the first, with their 95 % intervals."
            yield Drawing(f"{before}{c.noun}s", caption, "second over first", partial(_parameters, drawn))
        return
    for q in c.maps.quantities[:DRAWN]:
        caption = f"{q.label[0].upper()}{q.label[1:]}: both maps on one scale, and what they differ by."
        yield Drawing(f"{before}{q.name}", caption, f"{q.label} in both maps", partial(_map, c.maps, q))


def _parameters(drawn: Sequence[Pair]) -> Drawn:
    from stiffarm.commands.compare.figures import numbers_figure

    return numbers_figure(drawn)


def _map(maps: MapPair, q: Any) -> Drawn:
    from stiffarm.commands.compare.figures import map_figure

    return map_figure(maps, q)


def _pages(found: Sequence[Compared]) -> tuple[dict[str, str], str]:
    """Pages of both maps by name, and what to say of them."""
    able = [c for c in found if c.a.page is not None and c.b.page is not None]
    made = {}
    for k, c in enumerate(able, start=1):
        page = page_of_both(c.a.page, c.b.page, c.b.name)  # type: ignore[arg-type]
        if page is not None:
            made["maps.html" if len(found) == 1 else f"maps_{k}.html"] = page
    if not able:
        return {}, "For a page of both maps to turn and pick in, make them with --html."
    if len(made) < len(able):
        return made, "A map's own page is of an older version: make the maps again with --html for a page of both."
    said = "both maps side by side, on one scale and under one camera, and what they differ by as a quantity."
    return made, f"{' and '.join(made)} show{'s' * (len(made) == 1)} {said}"


def _write_pages(pages: Mapping[str, str], folder: OutputFolder) -> dict[str, Any]:
    for name, page in pages.items():
        folder.write_text(name, page)
    return {}


compare = capability_without_arm("compare", CompareRequest, answer)
