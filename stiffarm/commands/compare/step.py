"""The step `compare`: each of several results against the first one."""

from __future__ import annotations

from collections.abc import Sequence
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
        raise InputError("results to compare", value=len(files), allowed=f"2 to {MOST}", remedy="name the first one, "
                         "then those to compare with it")  # fmt: skip
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
    found = pairs(figures_of(a), figures_of(b))
    if not any(p.a is not None and p.b is not None for p in found) and a.kind == "calibration":
        raise InputError(f"{a.name} and {b.name} have no parameter in common", allowed="calibrations of the same "
                         "parameters", remedy="compare others, or calibrate with the same --free")  # fmt: skip
    wrong = next((p for p in found if p.verdict == "other" and p.a is not None and p.b is not None), None)
    if wrong is not None:
        raise InputError(f"{a.name} and {b.name}: unit of {wrong.name}", value=wrong.unit, allowed="the same in both",
                         remedy="make both with one version of stiffarm")  # fmt: skip
    notes = []
    if a.data and a.data == b.data:
        notes.append("Both rest on the same readings: what they differ by is the choice of model. They share the "
                     "noise, so smaller differences than the intervals suggest are real too.")  # fmt: skip
    if a.of_run and b.of_run:
        more = (f"stiffarm compare {a.name}/{part} {b.name}/{part}" for part in PARTS_OF_RUN)
        notes.append(f"Of two runs the calibrations are compared. What else they hold: {', '.join(more)}.")
    together = joint(a, b)
    return Compared(a, b, tuple(found), tuple(_settings(a, b)), together, None, tuple(notes))


def _settings(a: Source, b: Source) -> list[Setting]:
    """What is no number: how they were made, what a diagnosis says, how well a calibration fits."""
    keys = {
        "calibration": ("scheme", "load_path", "links", "readings", "rms_mm", "left_one_pose_out_rms_mm"),
        "diagnosis": ("verdict", "load_path", "links", "readings", "poses", "stated_probability"),
        "placement": ("cell", "aim", "mode", "path_points", "path_length_mm"),
    }[a.kind]
    content = [_words(s) for s in (a, b)]
    out = [Setting(key, content[0][key], content[1][key]) for key in keys if key in content[0] and key in content[1]]
    if a.kind == "diagnosis":
        effects = [
            ", ".join(one["code"] for key in ("effects", "learned") for one in s.content.get(key, [])) or "none"
            for s in (a, b)
        ]
        out.insert(1, Setting("effects", effects[0], effects[1]))
        gaps = [s.content.get("gap", {}) for s in (a, b)]
        out += [
            Setting(key, f"{gaps[0][key]:.4g}", f"{gaps[1][key]:.4g}") for key in gaps[0]
            if key.endswith("_mm") and all(isinstance(g.get(key), int | float) for g in gaps)
        ]  # fmt: skip
    return out


def _words(s: Source) -> dict[str, str]:
    """Settings of a source in words; of a model file those that it keeps."""
    if s.content:
        return {key: f"{v:.4g}" if isinstance(v, float) else str(v) for key, v in s.content.items()
                if isinstance(v, str | int | float) and not isinstance(v, bool)}  # fmt: skip
    origin = None if s.model is None else s.model.calibration
    if origin is None:
        return {}
    return {"scheme": origin.scheme, "load_path": origin.load_path, "links": origin.links,
            "rms_mm": f"{origin.rms_mm:.4g}"}  # fmt: skip
