"""What --help says: each command in its group, whole phrases, and what may be meant where a name is mistyped."""

from __future__ import annotations

import inspect
import re

import pytest
from cli_runs import Command, run_here
from prose_files import FOLDER, parts, prose

from stiffarm.cli import COMMANDS, command_of

# Words of a dialect that no reader shares; see the glossary of the docs.
DIALECT = re.compile(r"\b(be told|heed|hangs? on|some ten|gives? way|as the axes like|what else one would)\b")


@pytest.mark.parametrize("name", COMMANDS)
def test_the_list_of_commands_says_what_the_command_says(name: str) -> None:
    assert inspect.cleandoc(command_of(name).help).split("\n")[0] == COMMANDS[name].summary


def test_the_list_fits_a_screen_with_one_line_a_command() -> None:
    shown = run_here("--help").out
    for name, entry in COMMANDS.items():
        assert re.search(rf"│ {name} +{re.escape(entry.summary)} +│", shown), name
        assert f"─ {entry.group} ─" in shown


@pytest.mark.parametrize("name", COMMANDS)
def test_each_option_is_explained_in_whole_phrases(name: str) -> None:
    for full, command in parts(name, command_of(name)):
        for parameter in command.params:
            text = parameter.help
            assert re.fullmatch(r"[A-Z].*\.", text, re.DOTALL), f"{full} {parameter.opts}: {text}"
            assert not DIALECT.search(text), f"{full} {parameter.opts}: {text}"


@pytest.mark.parametrize("name", COMMANDS)
def test_the_prose_of_a_command_is_as_written_down(name: str) -> None:
    """A change of texts is seen in review: `python tests/stiffarm/session/prose_files.py` writes the files anew."""
    assert prose(name) == (FOLDER / f"{name}.txt").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("typed", "meant"),
    [(("calibrat", "xr701"), "calibrate"), (("plan", "xr701", "--poses", "3", "--critrion", "D"), "--criterion")],
)
def test_a_mistyped_command_or_option_is_answered_by_the_one_that_is_close(
    cli: Command, typed: tuple[str, ...], meant: str
) -> None:
    outcome = cli(*typed)
    assert outcome.code == 2
    assert "Did you mean" in outcome.err
    assert meant in outcome.err.split("Did you mean")[1]


@pytest.mark.parametrize(
    ("typed", "meant"),
    [
        (("plan", "xr701", "--poses", "3", "--free", "j2.stiffnes"), "j2.stiffness"),
        (("diagnose", "xr701", "--free", "j22"), "j2"),
        (("simulate", "xr701", "--pose", "q22_deg=5"), "q2_deg"),
        (("robots", "xr702"), "xr701"),
    ],
)
def test_a_mistyped_parameter_joint_coordinate_or_robot_is_answered_by_the_one_that_is_close(
    cli: Command, typed: tuple[str, ...], meant: str
) -> None:
    outcome = cli(*typed)
    assert outcome.code == 2
    assert f"Did you mean {meant}?" in outcome.err
