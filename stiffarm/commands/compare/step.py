"""The step `compare`: each of several results against the first one."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from robots import InputError
from stiffarm.commands.compare.maps import MapPair, compare_maps, read_map
from stiffarm.commands.compare.numbers import Joint, Pair, figures_of, joint, pairs
from stiffarm.commands.compare.sources import Source, check_alike, read_source

# More than these nobody reads side by side.
MOST = 8
PARTS_OF_RUN = ("diagnosis", "stiffness_map.vtu")


@dataclass(frozen=True)
class Setting:
    """Something that is no number: what each of both says."""

    name: str
    a: str
    b: str

    @property
    def same(self) -> bool:
        """Whether both say the same."""
        return self.a == self.b


@dataclass(frozen=True, eq=False)
class Compared:
    """Two results. ``pairs`` of numbers, ``settings`` in words, ``joint`` of all numbers; or ``maps``."""

    a: Source
    b: Source
    pairs: tuple[Pair, ...]
    settings: tuple[Setting, ...]
    joint: Joint | None
    maps: MapPair | None
    notes: tuple[str, ...]

    @property
    def beyond(self) -> list[Pair]:
        """Numbers that differ by more than noise."""
        return [p for p in self.pairs if p.verdict == "beyond the noise"]

    @property
    def shared(self) -> list[Pair]:
        """Numbers that both have."""
        return [p for p in self.pairs if p.a is not None and p.b is not None]


def compare(files: Sequence[Path]) -> list[Compared]:
    """Each of some results against the first one.

    Raises
    ------
    InputError
        Fewer than two, nothing that can be compared, or things of different kinds, robots, quantities or units.
    """
    if not 2 <= len(files) <= MOST:
        raise InputError(
            "results to compare",
            code="A012",
            value=len(files),
            allowed=f"2 to {MOST}",
            remedy="name the first one, then those to compare with it",
        )
    some = [read_source(path, number) for number, path in enumerate(files, start=1)]
    check_alike(some)
    if some[0].kind == "map":
        read = [read_map(s.file, s.name) for s in some]
        return [
            Compared(some[0], s, (), (), None, compare_maps(read[0], other), ())
            for s, other in zip(some[1:], read[1:], strict=True)
        ]
    return [_compared(some[0], other) for other in some[1:]]


def _compared(a: Source, b: Source) -> Compared:
    figures, said = [], []
    for s in (a, b):
        with _as_ours(s):
            figures.append(figures_of(s))
            said.append(_said(s))
    found = pairs(figures[0], figures[1])
    if not any(p.a is not None and p.b is not None for p in found) and a.kind == "calibration":
        raise InputError(
            f"{a.name} and {b.name} have no parameter in common",
            code="A012",
            allowed="calibrations of the same parameters",
            remedy="compare others, or calibrate with the same --free",
        )
    wrong = next((p for p in found if p.verdict == "other" and p.a is not None and p.b is not None), None)
    if wrong is not None:
        raise InputError(
            f"{a.name} and {b.name}: unit of {wrong.name}",
            code="A012",
            value=wrong.unit,
            allowed="the same in both",
            remedy="make both with one version of stiffarm",
        )
    notes = []
    if a.data and a.data == b.data:
        notes.append(
            "Both use the same readings, so they differ only by the choice of model. They share the noise, "
            "so even differences smaller than the intervals can be real."
        )
    if a.of_run and b.of_run:
        more = (f"stiffarm compare {a.name}/{part} {b.name}/{part}" for part in PARTS_OF_RUN)
        notes.append(f"For two runs, their calibrations are compared. To compare the rest: {', '.join(more)}.")
    together = joint(a, b)
    return Compared(a, b, tuple(found), tuple(_settings(said[0], said[1])), together, None, tuple(notes))


@contextmanager
def _as_ours(s: Source) -> Iterator[None]:
    """One message where a results file does not hold what it says that it holds."""
    try:
        yield
    except (AttributeError, IndexError, KeyError, TypeError, ValueError) as error:
        raise InputError(
            f"{s.name} does not hold what a {s.kind} of stiffarm holds", code="A012", remedy="make it again"
        ) from error


def _said(s: Source) -> dict[str, str]:
    """What is no number: how it was made, what a diagnosis says, how well a calibration fits."""
    keys = {
        "calibration": ("scheme", "load_path", "links", "readings", "rms_mm", "left_one_pose_out_rms_mm"),
        "diagnosis": ("verdict", "load_path", "links", "readings", "poses", "stated_probability"),
        "placement": ("cell", "aim", "mode", "path_points", "path_length_mm"),
    }[s.kind]
    content = _words(s)
    out = {key: content[key] for key in keys if key in content}
    if s.kind == "diagnosis":
        codes = [one["code"] for key in ("effects", "learned") for one in s.content.get(key, [])]
        gap = s.content.get("gap", {})
        out["effects"] = ", ".join(codes) or "none"
        out |= {key: f"{v:.4g}" for key, v in gap.items() if key.endswith("_mm") and isinstance(v, int | float)}
    return out


def _settings(a: Mapping[str, str], b: Mapping[str, str]) -> list[Setting]:
    """What both say, side by side."""
    return [Setting(key, a[key], b[key]) for key in a if key in b]


def _words(s: Source) -> dict[str, str]:
    """Settings of a source in words; of a model file those that it keeps."""
    if s.content:
        return {
            key: f"{v:.4g}" if isinstance(v, float) else str(v)
            for key, v in s.content.items()
            if isinstance(v, str | int | float) and not isinstance(v, bool)
        }
    origin = None if s.model is None else s.model.calibration
    if origin is None:
        return {}
    return {
        "scheme": origin.scheme,
        "load_path": origin.load_path,
        "links": origin.links,
        "rms_mm": f"{origin.rms_mm:.4g}",
    }
