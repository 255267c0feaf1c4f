"""The sets of a study: what a diagnosis may see of each, and the key that it may not."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field

from robots import InputError
from robots.files.reading import parse_json, read_text
from robots.files.validated import tuples, validated
from robots.schema.quantities import Strict

SET_SCHEMA, KEY_SCHEMA = "stiffarm-study-set/1", "stiffarm-study-key/1"
SET, KEY, READINGS, UNSEEN = "set.json", "key.json", "readings.csv", "unseen.csv"

# What an effect varies with.
Axis = Literal["pose", "load", "load history", "clock", "temperature", "session", "direction"]


class _Open(BaseModel):
    """A table of a key: a world may tell more of its truth than is asked."""

    model_config = ConfigDict(extra="allow", frozen=True, allow_inf_nan=False)


class SetFile(Strict):
    """set.json: the model that the diagnosis sets out from."""

    schema_: Annotated[Literal["stiffarm-study-set/1"], Field(alias="schema")]
    model: str
    links: str = "rigid"
    load_path: Literal["serial", "parallelogram"] | None = None


class Hidden(_Open):
    """One effect that is hidden; ``excess_chi2``: what it adds to chi-square by itself, null where nobody knows."""

    code: Annotated[str, Field(min_length=1)]
    axis: tuple[Axis, ...] = ()
    place: str = ""
    excess_chi2: Annotated[float, Field(ge=0.0)] | None = None


class Key(_Open):
    """key.json: the truth of a set."""

    schema_: Annotated[Literal["stiffarm-study-key/1"], Field(alias="schema")]
    effects: Annotated[tuple[Hidden, ...], BeforeValidator(tuples)]
    excess_chi2: Annotated[float, Field(ge=0.0)] | None = None
    world: str = ""
    tags: dict[str, Any] = {}


@dataclass(frozen=True)
class StudySet:
    """One set: its folder, what is said of its model, and its key."""

    name: str
    folder: Path
    file: SetFile
    key: Key

    @property
    def model(self) -> str:
        """A model file of the set's own, or the name of a bundled one."""
        own = self.folder / self.file.model
        return str(own) if own.is_file() else self.file.model

    @property
    def readings(self) -> Path:
        """What was read."""
        return self.folder / READINGS

    @property
    def unseen(self) -> Path | None:
        """Readings without noise in other set-ups; None where the set has none."""
        path = self.folder / UNSEEN
        return path if path.is_file() else None


def study_sets(folder: Path) -> list[StudySet]:
    """The sets of a folder, by name: each of its folders, at any depth, that has a set.json.

    Raises
    ------
    InputError
        No such folder, no set in it, or a set whose files are missing or do not fit.
    """
    if not folder.is_dir():
        raise InputError(
            "FOLDER", code="A007", value=str(folder), allowed="an existing folder", remedy="check the path"
        )
    found = sorted(path.parent for path in folder.rglob(SET))
    if not found:
        raise InputError(
            "FOLDER",
            code="A013",
            value=str(folder),
            allowed=f"folders with {SET}, {READINGS} and {KEY}, one a set",
            remedy="see docs/reference/study_sets.md",
        )
    return [study_set(path, path.relative_to(folder).as_posix()) for path in found]


def study_set(folder: Path, name: str) -> StudySet:
    """One set."""
    for needed in (READINGS, KEY):
        if not (folder / needed).is_file():
            raise InputError(
                f"set {name}", code="A013", value=f"no {needed}", allowed=f"{SET}, {READINGS}, {KEY}", remedy="add it"
            )
    file = validated(SetFile, _json(folder / SET), f"set {name}: {SET}")
    if ".." in Path(file.model).parts or Path(file.model).is_absolute():
        raise InputError(
            f"set {name}: {SET}: model",
            code="A013",
            value=file.model,
            allowed="a file of the set's folder, or a bundled robot",
        )
    return StudySet(name, folder, file, validated(Key, _json(folder / KEY), f"set {name}: {KEY}"))


def _json(path: Path) -> object:
    return parse_json(read_text(path, "study set"), str(path))
