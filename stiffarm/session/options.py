"""Options that several commands share, and what all commands do first."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

# Options that most commands have, listed last in a group of their own.
COMMON = "Common options"

ModelArg = Annotated[
    str, typer.Argument(metavar="MODEL", help="A bundled name (see `stiffarm robots`), a model TOML or a URDF.")
]
Links = Annotated[
    str | None,
    typer.Option(
        "--links",
        help="Link model: beam, shell, solid (links with a solid; the others as shells) or rigid. "
        "shell:distributing lets the flanges warp (soft bound), shell:rigid keeps them flat (stiff bound), shell uses "
        "the model's choice. Default: as calibrated, otherwise beam.",
    ),
]
LoadPathOpt = Annotated[
    str | None, typer.Option("--load-path", help="Load path: parallelogram or serial. Default: the model's.")
]
Sets = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="NAME=VALUE",
        help="Replace one parameter of the model, as in j2.stiffness=1.4e6 or forearm.modulus=70GPa (SI without a "
        "unit). May be repeated.",
    ),
]
Out = Annotated[
    Path | None, typer.Option("--out", rich_help_panel=COMMON, help="Folder for the results; it is created if needed.")
]
Json = Annotated[
    bool, typer.Option("--json", rich_help_panel=COMMON, help="Print the result as one JSON object on stdout.")
]
Debug = Annotated[bool, typer.Option("--debug", rich_help_panel=COMMON, help="Show tracebacks of errors.")]
EffectFile = Annotated[
    list[Path] | None,
    typer.Option(
        "--effect",
        metavar="FILE.py",
        help="Python file that defines your own effects. The file is executed. May be repeated.",
    ),
]
