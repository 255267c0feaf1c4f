"""What `--format` and `--coordinates` ask for."""

from __future__ import annotations

from machining.programs.format import BOTH
from machining.programs.formats import FORMATS
from machining.programs.run import Target
from robots import InputError, require_one_of


def parse_targets(text: str, kind: str) -> tuple[Target, ...]:
    """Formats ``krl,json`` and ``cartesian``, ``joint`` or ``both``: the targets.

    Raises
    ------
    InputError
        An unknown format or kind, or a format named twice.
    """
    kinds = tuple(k for k in BOTH if kind in (k, "both"))
    if not kinds:
        raise InputError(
            "--coordinates", code="Q002", value=kind, allowed="cartesian, joint, both", remedy="choose one of them"
        )
    names = [part.strip() for part in text.split(",") if part.strip()]
    for name in names:
        require_one_of("--format", name, FORMATS, code="Q002", remedy="choose from these")
    if not names or len(set(names)) != len(names):
        raise InputError(
            "--format", code="Q002", value=text, allowed=", ".join(FORMATS), remedy="name each once, with commas"
        )
    out: list[Target] = []
    for name in names:
        if FORMATS[name].neutral:
            out.append(Target(name, "joint"))
            continue
        wanted = [k for k in kinds if k in FORMATS[name].kinds]
        if not wanted:
            raise InputError(
                f"--coordinates of {name}", code="Q002", value=kind, allowed=", ".join(FORMATS[name].kinds)
            )
        out += [Target(name, k) for k in wanted]
    return tuple(out)
