"""The frame of every command: what it reads and the hashes of that, its output folder, and how it answers.

>>> with command(out, as_json=as_json, debug=debug) as frame:
...     given = frame.model(model, links, load_path)
...     with frame.folder_if(seed) as folder:
...         content = ...
...     frame.answer(content, lambda: show(...))

Errors become one message and the agreed exit code. Models and readings are loaded by modules that only those commands
import which ask for them.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from robots import InputError
from robots.constants import DOWN
from stiffarm.session.caution import cautioned
from stiffarm.session.console import emit_json, say, user_errors
from stiffarm.session.outputs import OutputFolder

if TYPE_CHECKING:
    from fem.arm import Arm
    from robots.arrays import Array

Given = TypeVar("Given", bound="Arm")


@contextmanager
def command(out: Path | None = None, *, as_json: bool = False, debug: bool = False) -> Iterator[Frame]:
    """The frame of one command: its errors, its files, its answer."""
    with user_errors(debug):
        yield Frame(out, as_json)


@dataclass(eq=False)
class Frame:
    """One command at work.

    ``files``: what it has read, by name: a path, or a hash; for run.json. ``caution``: what every picture and page in
    its folder says of the model; ``named``: the model, as it was asked for; ``asked``: the request, for run.json.
    """

    out: Path | None
    as_json: bool
    files: dict[str, Path | str] = field(default_factory=dict)
    caution: str = ""
    named: str = "MODEL"
    asked: Mapping[str, Any] | None = None
    _folder: OutputFolder | None = None

    def model(
        self,
        name: str,
        links: str | None = None,
        load_path: str | None = None,
        *,
        effect: Sequence[Path] | None = None,
        without: str | None = None,
        sets: Sequence[str] | None = None,
        shown: bool = False,
    ) -> Arm:
        """The model asked for.

        ``effect``: files of own effects; ``sets``: what ``--set`` says; ``shown``: the command shows what this model
        says of the arm, so its pictures and pages warn of joints held rigid for want of a spring; else as
        :func:`stiffarm.session.inputs.read_model`.
        """
        from stiffarm.session.caution import uncalibrated
        from stiffarm.session.inputs import model_hash, read_model
        from stiffarm.session.own_effects import own_effects, own_files
        from stiffarm.session.parsing import parse_settings

        self.named = name
        values = parse_settings(sets or (), "--set")
        given = read_model(name, links, load_path, own=own_effects(effect), without=without, sets=values)
        self.files |= {**own_files(effect), "model": model_hash(given)}
        self.caution = uncalibrated(given) if shown else ""
        return given

    def at_load(
        self,
        given: Given,
        size_N: float | None,
        direction: Sequence[float] | Array = DOWN,
        point: Array | None = None,
    ) -> Given:
        """The arm with its effects in its compliance, as :func:`stiffarm.session.stated.at_load`; said and shown."""
        from stiffarm.session.caution import caveats
        from stiffarm.session.stated import at_load, stated_words

        given = at_load(given, size_N, direction, point)
        if words := stated_words(given.model):
            say(f"note: {words}")
        self.caution = caveats(given)
        return given

    def reads(self, **files: Path | None) -> None:
        """Files of options, by the option's name: they must exist, and their hashes go into run.json."""
        for name, file in files.items():
            if file is None:
                continue
            if not file.is_file():
                option = f"--{name.replace('_', '-')}"
                raise InputError(
                    option, code="A007", value=str(file), allowed="an existing file", remedy="check the path"
                )
            self.files[name.removesuffix("_file")] = file

    @contextmanager
    def folder(self, seed: int | None = None) -> Iterator[OutputFolder]:
        """The folder of ``--out``, of a command that must have one."""
        if self.out is None:
            raise InputError(
                "--out", code="A003", value="none", allowed="a folder for the results", remedy="give --out FOLDER"
            )
        folder = OutputFolder(self.out, ["stiffarm", *sys.argv[1:]], self.files, seed, self.asked)
        with cautioned(self.caution), folder as self._folder:
            yield self._folder

    def folder_if(self, seed: int | None = None) -> AbstractContextManager[OutputFolder | None]:
        """The folder of ``--out``, or None where that was not given."""
        return nullcontext() if self.out is None else self.folder(seed)

    def answer(self, content: Mapping[str, Any], show: Callable[[], None] = lambda: None) -> None:
        """Say what was found: as JSON on stdout, or to people by ``show``; and which files were written."""
        if self.as_json:
            emit_json(content)
        else:
            show()
        if self._folder is not None:
            say(f"written to {self.out}: {self._folder.contents()}")
