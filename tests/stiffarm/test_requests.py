"""One request for each capability: command, Python function, run.json and reference page have the same fields."""

from __future__ import annotations

import importlib
import inspect
import json
from pathlib import Path
from typing import Any

import command_pages
import numpy as np
import pytest
import typer
from cli_runs import Command

import stiffarm as sa
from stiffarm import capability as capabilities
from stiffarm.cli import COMMANDS, app, command_of
from stiffarm.request import Request, options_of, spelled

MADE = {
    "calibrate": "CalibrateRequest",
    "compare": "CompareRequest",
    "diagnose": "DiagnoseRequest",
    "fit": "FitRequest",
    "identify": "IdentifyRequest",
    "import": "ImportRequest",
    "index": "IndexRequest",
    "map box": "BoxRequest",
    "map cylinder": "CylinderRequest",
    "map index": "IndexMapRequest",
    "map joints": "JointsRequest",
    "map slice": "SliceRequest",
    "new": "NewRequest",
    "place": "PlaceRequest",
    "plan": "PlanRequest",
    "post": "PostRequest",
    "posture": "PostureRequest",
    "query": "QueryRequest",
    "readings": "ReadingsRequest",
    "rehearse": "RehearseRequest",
    "robots check": "CheckRequest",
    "robots show": "RobotsRequest",
    "run": "RunRequest",
    "sensitivity": "SensitivityRequest",
    "simulate": "SimulateRequest",
    "verify": "VerifyRequest",
}
# Functions whose name is not that of the command.
CALLED = {
    "import": "import_arm",
    "new": "new_arm",
    "readings": "convert_readings",
    "robots check": "check_kinematics",
    "robots show": "robots",
}
# What a command has beside its request: the model and how it is built, and what all commands have.
MODEL = {"model", "links", "load_path", "sets", "effect"}
ALL_HAVE = {"out", "as_json", "debug", "help"}
POSE = {"q2_deg": -60.0, "q3_deg": 40.0, "q5_deg": 40.0}


def request_of(name: str) -> type[Request]:
    module = importlib.import_module(f"stiffarm.commands.{COMMANDS[name.partition(' ')[0]].folder}.command")
    found = getattr(module, MADE[name])
    assert issubclass(found, Request)
    return found


def test_each_capability_that_is_made_of_a_request_is_listed() -> None:
    for name in COMMANDS:
        command_of(name)
    assert set(capabilities.COMMANDS) == set(MADE)


@pytest.mark.parametrize("name", MADE)
def test_command_function_and_page_have_the_fields_of_the_request(name: str) -> None:
    options = options_of(request_of(name))
    group, _, word = name.partition(" ")
    command = command_of(group).commands[word] if word else command_of(group)
    assert {p.name for p in command.params} - (MODEL - set(options)) - ALL_HAVE == set(options) - ALL_HAVE
    typed = {p.name: p for p in command.params}
    for field, how in options.items():
        assert typed[field].help == how.help
        if not how.is_argument:
            assert spelled(field, how) in typed[field].opts
    function = getattr(sa, CALLED.get(name, name.replace(" ", "_")))
    # The arm stands first, then the fields in their order: arguments, then options.
    parameters = [one for one in inspect.signature(function).parameters if one != "arm" or one in options]
    assert sorted(parameters) == sorted(options)
    assert all(f"\n{field} : " in (function.__doc__ or "") for field in options)
    context = typer.Context(typer.main.get_command(app), info_name="stiffarm")
    if word:
        context = typer.Context(command_of(group), info_name=group, parent=context)
    page = command_pages.page(name, command, context)
    for field, how in options.items():
        text = how.metavar if how.is_argument else f"{{option}} {spelled(field, how)}"
        assert text is not None
        assert text in page, field


def test_run_json_holds_the_request_as_python_would_write_it(cli: Command, tmp_path: Path) -> None:
    pose = ",".join(f"{key}={value:g}" for key, value in POSE.items())
    done = cli("index", "kr60-3", "--pose", pose, "--force", "0,0,-100", "--out", "out", "--json")
    assert done.code == 0, done.err
    request = json.loads((tmp_path / "out" / "run.json").read_text(encoding="utf-8"))["request"]
    asked: dict[str, Any] = {key: value for key, value in request.items() if value not in (None, [])}
    assert asked == {"pose": [POSE], "normal": [0.0, 0.0, 1.0], "force": [0.0, 0.0, -100.0]}
    found = sa.index("kr60-3", **asked)
    assert {**found.as_json, "what_next": ""} == {**done.json, "what_next": ""}
    files = {p.name for p in found.save(tmp_path / "python").iterdir()}
    assert files == {p.name for p in (tmp_path / "out").iterdir()}


def test_an_error_names_the_option_in_the_shell_and_the_argument_in_python(cli: Command) -> None:
    assert "--unload-from" in cli("simulate", "xr701", "--pose", "q3real_deg=80", "--unload-from", "fz_N=0").err
    with pytest.raises(sa.InputError, match=r"^unload_from: ") as caught:
        sa.simulate("xr701", pose={"q3real_deg": 80}, unload_from={"fz_N": 0})
    assert "--" not in str(caught.value)


@pytest.mark.parametrize(
    ("wrong", "code"),
    [
        ({"normal": (0, 0, 0)}, "A004"),
        ({"normal": "0,0,1"}, "A004"),
        ({"force": (1, 2)}, "A004"),
        ({"tool": (1, 2)}, "A004"),
        ({"load": {"fz": 1}}, "A004"),
        ({"load": {"fz_N": 0}}, "A006"),
        ({"pose": {"q2_deg": 500}}, "A005"),
        ({"pose": ()}, "A003"),
    ],
)
def test_values_of_python_are_checked_as_those_of_the_shell(wrong: dict[str, Any], code: str) -> None:
    with pytest.raises(sa.InputError) as caught:
        sa.index("kr60-3", **{"pose": POSE, **wrong})
    assert caught.value.code == code


def test_a_result_has_its_figures_in_si_and_in_shown_units() -> None:
    found = sa.index("kr60-3", pose=[POSE, POSE])
    frame = found.to_frame()
    np.testing.assert_allclose(found["k_fs"] * 1e-3, found["k_fs_N_per_mm"], rtol=1e-12)
    # Rows are rounded to six digits.
    np.testing.assert_allclose(frame["k_fs_N_per_mm"], found["k_fs_N_per_mm"], rtol=1e-5)
    assert [row["k_fs_N_per_mm"] for row in found.as_json["poses"]] == frame["k_fs_N_per_mm"].tolist()
    assert "N/mm" in repr(found)
    assert "<table" in found._repr_html_()
    with pytest.raises(sa.InputError, match="k_fs"):
        found["nothing"]
