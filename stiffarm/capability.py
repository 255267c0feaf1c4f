"""Capabilities: a request and what answers it, made into a command and a Python function that take the same fields."""

from __future__ import annotations

import inspect
import os
import re
import shlex
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import MISSING, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Concatenate, Final, ParamSpec, TypeVar, get_type_hints

import typer

from robots import InputError, InputErrors
from robots.files.reading import recording
from stiffarm.request import Option, Request, options_of, spelled
from stiffarm.result import Result
from stiffarm.session.console import kept_messages, say, say_notes
from stiffarm.session.options import COMMON, Debug, EffectFile, Json, Links, LoadPathOpt, ModelArg, Out, Sets
from stiffarm.session.parsing import typed_again

if TYPE_CHECKING:
    from fem.arm import Arm

P = ParamSpec("P")
R = TypeVar("R", bound=Result)
_OPTION: Final = re.compile(r"--([a-z][a-z0-9]*(?:-[a-z0-9]+)*)")
COMMANDS: Final[dict[str, Callable[..., None]]] = {}
"""The command line's functions of the capabilities that have been imported, by name."""


def capability(
    name: str,
    request: Callable[P, Request],
    answer: Callable[..., R],
    *,
    own_effects: bool = False,
    built: Sequence[str] = ("links", "load_path"),
    model: str | None = None,
    function: str = "",
) -> Callable[Concatenate[Arm | str | Path, P], R]:
    """The Python function of a capability of an arm; its command is :data:`COMMANDS`'s of that name.

    ``name``: that of the command; one of a group's is written as in "map slice". ``request``: a
    :class:`stiffarm.request.Request`; ``answer``: what it is asked with an arm and gives a result of, and what
    writes into a folder, its third argument, if the request says so. ``own_effects``: the command takes files of a
    user's own effects, as :func:`stiffarm.load` does; ``built``: how the model is built that it may ask for (without
    links it is built with rigid ones); ``model``: where none is named; ``function``: the name in Python, where that is
    another.
    """

    def call(arm: Arm | str | Path, /, *args: P.args, **kwargs: P.kwargs) -> R:
        with called(_class(request)):
            # Not loaded where nothing is asked of an arm.
            from stiffarm.session.inputs import read_model

            given = read_model(str(arm), None, None) if isinstance(arm, str | Path) else arm
            asked = request(*args, **kwargs)
            if not asked.writes_itself or asked.folder is None:
                return answer(given, asked)
            from stiffarm.session.outputs import OutputFolder

            run = [f"stiffarm.{name}"], dict(_files_read(asked)), getattr(asked, "seed", None), asked.as_json()
            with OutputFolder(asked.folder, *run) as folder:
                return answer(given, asked, folder)

    if model is not None:
        call.__defaults__ = (model,)
    COMMANDS[name] = _command(name, _class(request), answer, _model_options(own_effects, built, model))
    subject = {"arm": ("the arm, or the name or file of a model", model)}
    _describe(call, function or name, _class(request), answer, subject)
    return call


def capability_without_arm(
    name: str, request: Callable[P, Request], answer: Callable[[Any], R], *, function: str = ""
) -> Callable[P, R]:
    """The Python function of a capability that is asked of no arm, but of what its request holds; else the same."""

    def call(*args: P.args, **kwargs: P.kwargs) -> R:
        with called(_class(request)):
            return answer(request(*args, **kwargs))

    COMMANDS[name] = _command(name, _class(request), lambda _, asked: answer(asked), [])
    _describe(call, function or name, _class(request), answer, {})
    return call


def _class(request: Callable[P, Request]) -> type[Request]:
    """A request's class, which is typed as what makes one for the sake of ``P``."""
    assert isinstance(request, type)  # noqa: S101
    return request


def _describe(
    call: Callable[..., Any],
    name: str,
    request: type[Request],
    answer: Callable[..., Any],
    subject: dict[str, tuple[str, str | None]],
) -> None:
    """Name, docstring and signature of the Python function."""
    call.__name__ = call.__qualname__ = name.replace(" ", "_").replace("-", "_")
    call.__module__ = answer.__module__
    call.__doc__ = _docstring(request, subject)
    first = [
        inspect.Parameter(
            s,
            inspect.Parameter.POSITIONAL_ONLY,
            annotation="Arm | str | Path",
            default=inspect.Parameter.empty if default is None else default,
        )
        for s, (_, default) in subject.items()
    ]
    own = inspect.signature(request).parameters.values()
    returned = inspect.signature(answer).return_annotation
    call.__signature__ = inspect.Signature([*first, *own], return_annotation=returned)  # type: ignore[attr-defined]


@contextmanager
def called(request: type[Request] | None = None) -> Iterator[list[str]]:
    """Run a step: its messages become the list that is handed out.

    Raises
    ------
    InputError
        As the step raises it, with the names of options as those of arguments: ``--load-path`` is ``load_path``.
    """
    fields = {} if request is None else {spelled(name, how): name for name, how in options_of(request).items()}

    def words(text: str) -> str:
        return _OPTION.sub(lambda found: fields.get(found[0], found[1].replace("-", "_")), text)

    def of_arguments(error: InputError) -> InputError:
        allowed, remedy = (None if text is None else words(text) for text in (error.allowed, error.remedy))
        return InputError(words(error.what), code=error.code, value=error.value, allowed=allowed, remedy=remedy)

    with kept_messages() as messages, recording():
        try:
            yield messages
        except InputErrors as error:
            raise InputErrors(words(error.what), [of_arguments(e) for e in error.errors], error.count) from error
        except InputError as error:
            raise of_arguments(error) from error


def _docstring(request: type[Request], subject: dict[str, tuple[str, str | None]]) -> str:
    """What Python's help says: the request's own words, then each field."""
    text, _, examples = inspect.cleandoc(request.__doc__ or "").partition("\nExamples\n")
    lines = [text.rstrip(), "", "Parameters", "----------"]
    lines += [f"{name} : {words}" for name, (words, _) in subject.items()]
    lines += [f"{name} : {how.help}" for name, how in options_of(request).items()]
    lines += [
        "",
        "Raises",
        "------",
        "InputError",
        "    A value out of its range, or that does not fit the rest.",
    ]
    return "\n".join([*lines, *(["", "Examples", examples.lstrip("\n")] if examples else [])])


def _command(
    name: str, request: type[Request], answer: Callable[..., Result], model: list[inspect.Parameter]
) -> Callable[..., None]:
    """The function that typer makes the command of: the model, the request's fields, then what all commands have.

    ``model``: what says which model, empty for a command that is asked of none.
    """
    options = options_of(request)

    def command(**given: Any) -> None:
        from stiffarm.session.caution import cautioned
        from stiffarm.session.frame import command as framed

        out = None if "out" in options else given["out"]
        with framed(out, as_json=given["as_json"], debug=given["debug"]) as frame:
            asked = request(**dict(_values(options, given)))
            frame.out = frame.out or asked.folder
            if asked.writes_by is not None and frame.out is None:
                raise InputError(
                    f"{asked.writes_by} writes files and has no folder for them", code="A003", remedy="give --out DIR"
                )
            frame.files |= dict(_files_read(asked))
            arm = None
            if model:
                arm = frame.model(
                    given["model"],
                    asked.links(given["model"], given["links"]) if "links" in given else "rigid",
                    given.get("load_path"),
                    effect=given.get("effect"),
                    sets=given["sets"],
                )
            frame.asked = asked.as_json()
            writes, seed = asked.writes_itself, getattr(asked, "seed", None)
            with frame.folder(seed) if writes else frame.folder_if(seed) as folder:
                result = answer(arm, asked, folder) if writes else answer(arm, asked)
                # To copy: what leads on names the model as it was typed, with what changes it.
                typed = typed_again("", (frame.named,), {o: given.get(field) for o, field in _AS_TYPED.items()})
                what_next = result.what_next.replace("MODEL", typed).replace("FOLDER", shlex.quote(str(frame.out)))
                result = replace(result, what_next=what_next, arm=result.arm or arm)
                content = result.as_json
                if folder is not None and not writes:
                    with cautioned(result.warning):
                        content = result.write(folder)
            frame.answer(content, result.show)
            say_notes(result.remarks)
            if result.exit_code:
                say(f"stiffarm: {result.answer}")
                raise typer.Exit(result.exit_code)

    command.__name__ = name.rpartition(" ")[2]
    command.__doc__ = inspect.cleandoc(request.__doc__ or "").partition("\nExamples\n")[0]
    common = [one for one in _COMMON if one.name not in options]
    parameters = [*model[:1], *_parameters(request, options), *model[1:], *common]
    command.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    command.__annotations__ = {p.name: p.annotation for p in parameters}
    return command


def _values(options: dict[str, Option], given: dict[str, Any]) -> Iterator[tuple[str, Any]]:
    """Fields that were given on the command line, as values."""
    for name, how in options.items():
        value = given[name]
        if value is None or value == []:
            continue
        if how.kind is not None:
            read, option = how.kind.read, spelled(name, how)
            value = tuple(read(text, option) for text in value) if how.several else read(value, option)
        yield name, value


def _files_read(asked: Request) -> Iterator[tuple[str, Path]]:
    """Files that a request names, by field; of several, with their number behind it."""
    for name in options_of(type(asked)):
        value = getattr(asked, name)
        for k, one in enumerate(value if isinstance(value, tuple) else (value,)):
            # Not Path.is_file: that raises for names too long for any file.
            if isinstance(one, Path) and os.path.isfile(one):
                yield f"{name}_{k + 1}" if k else name, one


def _parameter(name: str, annotation: Any, default: Any) -> inspect.Parameter:
    return inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, annotation=annotation, default=default)


def _model_options(own_effects: bool, built: Sequence[str], model: str | None) -> list[inspect.Parameter]:
    """Which model, then how it is built."""
    which = _parameter("model", ModelArg, inspect.Parameter.empty)
    if model is not None:
        info = typer.Argument(metavar="[MODEL]", help="A bundled name, a model TOML or a URDF.")
        which = _parameter("model", Annotated[str, info], model)
    kinds = {"effect": EffectFile if own_effects else None, "links": Links, "load_path": LoadPathOpt}
    kinds = {name: kind for name, kind in kinds.items() if name == "effect" or name in built} | {"sets": Sets}
    return [which, *(_parameter(name, kind, None) for name, kind in kinds.items() if kind is not None)]


# What is typed of a model beside its name, by field.
_AS_TYPED: Final = {"--links": "links", "--load-path": "load_path", "--set": "sets"}
_COMMON: Final = (_parameter("out", Out, None), _parameter("as_json", Json, False), _parameter("debug", Debug, False))


def _parameters(request: type[Request], options: dict[str, Option]) -> Iterator[inspect.Parameter]:
    """The request's fields, arguments first."""
    hints, defaults = get_type_hints(request), {f.name: f.default for f in fields(request)}
    for name, how in sorted(options.items(), key=lambda item: not item[1].is_argument):
        default = None if defaults[name] == () else defaults[name]
        annotation: Any = hints[name]
        if how.kind is not None:
            annotation = list[str] | None if how.several else str | None
            default = how.kind.text(default) if default not in (None, MISSING) else default
        elif how.is_argument:
            annotation = list[Path] | None if how.several else Path | None
        metavar = how.metavar or (how.kind.metavar if how.kind else None)
        if how.is_argument:
            info: Any = typer.Argument(metavar=metavar, help=how.help)
        else:
            names = how.spelled or (f"--{name.replace('_', '-')}",)
            if default is True and "/" not in names[0]:
                names = (f"{names[0]}/--no-{names[0].removeprefix('--')}", *names[1:])
            info = typer.Option(
                *names,
                metavar=metavar,
                help=how.help,
                min=how.least,
                max=how.most,
                rich_help_panel=COMMON if how.is_common else how.group,
            )
        yield _parameter(name, Annotated[annotation, info], inspect.Parameter.empty if default is MISSING else default)
