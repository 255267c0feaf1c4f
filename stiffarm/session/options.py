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
DataArg = Annotated[
    Path | None,
    typer.Argument(metavar="[DATA]", help="Measurement table (CSV/XLSX). Default: the robot's bundled table."),
]
TablesArg = Annotated[
    list[Path] | None,
    typer.Argument(
        metavar="DATA",
        help="One or more measurement tables (CSV/XLSX), combined. Pass a filled-in sheet together with "
        "the table it extends. Default: the robot's bundled table, also available as `bundled`.",
    ),
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
ConfirmUnits = Annotated[
    bool,
    typer.Option(
        "--confirm-units",
        help="Accept the table although its values look like other units; use it after checking them.",
    ),
]
Out = Annotated[
    Path | None, typer.Option("--out", rich_help_panel=COMMON, help="Folder for the results; it is created if needed.")
]
Json = Annotated[
    bool, typer.Option("--json", rich_help_panel=COMMON, help="Print the result as one JSON object on stdout.")
]
Debug = Annotated[bool, typer.Option("--debug", rich_help_panel=COMMON, help="Show tracebacks of errors.")]
Joints = Annotated[
    str | None,
    typer.Option(
        "--joints", help="Joints, separated by commas, as in j2,j3. Default: the scheme's, otherwise all that matter."
    ),
]
Loads = Annotated[
    str | None,
    typer.Option(
        "--loads",
        help="Loads to use, in N, separated by commas, as in 150,650, or all. Default: the scheme's, otherwise all.",
    ),
]
Seed = Annotated[int, typer.Option("--seed", rich_help_panel=COMMON, help="Seed of the random numbers.", min=0)]
EffectFile = Annotated[
    list[Path] | None,
    typer.Option(
        "--effect",
        metavar="FILE.py",
        help="Python file that defines your own effects. The file is executed. May be repeated.",
    ),
]
SchemeFile = Annotated[
    Path | None, typer.Option("--scheme-file", help="Calibration scheme (TOML). Default: the robot's bundled scheme.")
]
Floor = Annotated[
    str, typer.Option("--floor-mm", help="Height of the floor in mm: no part of the arm may be below it; or none.")
]
KeepOut = Annotated[
    list[str] | None,
    typer.Option("--keep-out", help="Box that the arm must keep out of, x0,y0,z0:x1,y1,z1, in mm. May be repeated."),
]
Clearance = Annotated[
    float | None,
    typer.Option(
        "--clearance-mm",
        help="Distance of wrist and tool from base and upper arm, in mm; 0 for no limit. Default: what the"
        " casings need.",
    ),
]
