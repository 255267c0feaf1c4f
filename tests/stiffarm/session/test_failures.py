"""The catalogue of failures: complete, without dead entries, and in the words of its users."""

from __future__ import annotations

import ast
import copy
import re
from pathlib import Path

import pytest
from cli_runs import Command
from error_sites import ROOT, error_sites, sites_of
from prose_files import parts
from test_house import sources

from machining.toolpaths.motions import Note
from machining.verification.offences import KIND_CODES, Kind
from robots import InputError, InputErrors, Remark
from stiffarm.cli import COMMANDS, GONE, command_of
from stiffarm.failures import SYSTEM, Failure, catalogue, said
from stiffarm.session.console import say, say_error, say_notes

SITES = error_sites()
ALL = list(catalogue().values())


CONSTANTS = {
    node.value
    for path in sources()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
    if isinstance(node, ast.Constant) and isinstance(node.value, str)
}


def test_each_error_has_a_code_of_the_catalogue() -> None:
    """A literal one where it is made, of remarks too; helpers hand theirs on."""
    assert len(SITES) > 1200
    assert {site.place: site.code for site in SITES if site.code is not None and site.code not in catalogue()} == {}


def test_no_entry_is_dead() -> None:
    """Each code stands in the program."""
    assert [f.code for f in ALL if f.code not in CONSTANTS and not named_at_the_start(f.code)] == []


def named_at_the_start(code: str) -> bool:
    """The entry point says its own codes, before it can import anything."""
    return code in (ROOT / "stiffarm" / "__main__.py").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("call", "code"),
    [
        ('InputError("a", code="F001", value=1)', "F001"),
        ('InputError("a")', ""),
        ('InputError("a", code=table["x"])', ""),
        ("InputError(error.what, code=error.code)", None),
        ('Remark("a", code=CODES[kind])', None),
        ("InputError(what, code=code)", None),
        ('faults.add(1, "cell", code="T004")', "T004"),
        ('require_one_of("--aim", aim, known)', ""),
    ],
)
def test_the_check_sees_the_code_of_a_call(call: str, code: str | None, tmp_path: Path) -> None:
    file = tmp_path / "one.py"
    file.write_text(f"def made(what, *, code):\n    return {call}\n", encoding="utf-8")
    assert [site.code for site in sites_of(file, tmp_path)] == [code]


def test_each_kind_of_a_verification_has_its_entry() -> None:
    assert set(KIND_CODES) == set(Kind)
    assert sorted(KIND_CODES.values()) == [f.code for f in ALL if f.code.startswith("Z")]


@pytest.mark.parametrize("failure", ALL, ids=lambda f: f.code)
def test_an_entry_says_what_a_user_needs(failure: Failure) -> None:
    assert re.fullmatch(r"[A-Z]\d{3}", failure.code)
    for text in (failure.cause, failure.remedy):
        assert re.fullmatch(r"[A-Z`<-].*[.)]", text, re.DOTALL)
        assert len(text) > 20
    assert not failure.title.endswith(".")
    assert len(failure.title) <= 100
    assert failure.example


def test_codes_of_one_area_have_one_letter() -> None:
    assert len({f.code[0] for f in ALL}) == len({(f.code[0], f.area) for f in ALL}) == len({f.area for f in ALL})


def test_options_and_pages_that_entries_name_exist() -> None:
    """A remedy that names an option that is not there would be worse than none."""
    every = [command for name in COMMANDS for _, command in parts(name, command_of(name))]
    known = {opt for command in every for p in command.params for opt in (*p.opts, *p.secondary_opts)} | {"--help"}
    named = {(f.code, option) for f in ALL for option in re.findall(r"--[a-z][a-z0-9-]*", f.cause + f.remedy)}
    assert {(code, option) for code, option in named if option not in known} == set()
    pages = {(f.code, page) for f in ALL for page in re.findall(r"docs/[\w/]+(?:\.md)?", f.cause + f.remedy)}
    assert {(code, page) for code, page in pages if not (ROOT / page).exists()} == set()
    typed = {(f.code, word) for f in ALL for word in re.findall(r"`stiffarm ([a-z]+)", f.cause + f.remedy)}
    assert {(code, word) for code, word in typed if word not in COMMANDS} == set()


def test_an_example_is_a_message_of_its_entry() -> None:
    """Some words of the example stand in a call that has its code; remarks are often put together before."""
    by_code: dict[str | None, list[str]] = {}
    for site in SITES:
        by_code.setdefault(site.code, []).extend(part.strip() for part in site.words.split("\0"))
    missing = [
        f.code
        for f in ALL
        if not f.code.startswith("W")
        and any(len(part) > 4 for part in by_code.get(f.code, []))
        and not any(len(part) > 4 and part in f.example for part in by_code[f.code])
    ]
    assert missing == []


def test_several_faults_carry_a_code_each(capsys: pytest.CaptureFixture[str]) -> None:
    one, other = InputError("a", code="R011"), InputError("b", code="F001")
    say_error(InputErrors("two", [one, other]))
    head, *lines = capsys.readouterr().err.splitlines()
    assert head == "stiffarm: two: 2 problem(s). More: stiffarm help CODE"
    assert lines == ["  - a [R011]", "  - b [F001]"]
    assert said(InputErrors("nested", [InputErrors("two", [one, other])])).endswith("More: stiffarm help R011, F001")


def test_a_warning_carries_its_code(capsys: pytest.CaptureFixture[str]) -> None:
    say("note: a poor surrogate", code="W011")
    say_notes([Remark("no spring", code="W001"), "all is well", Note(3, "cut short", 2, "W037")])
    assert capsys.readouterr().err.splitlines() == [
        "note: a poor surrogate [W011]",
        "note: no spring [W001]",
        "note: all is well",
        "note: line 3: cut short (2 times) [W037]",
    ]
    assert copy.deepcopy(Remark("a", code="W001")).code == "W001"


@pytest.mark.parametrize(
    ("typed", "code"),
    [
        (("robots", "xr702"), "R001"),
        (("simulate", "xr701", "--pose", "q2_deg=5,5"), "A004"),
        (("simulate", "xr701", "--pose", "q2_deg=500"), "A005"),
        (("simulate", "xr701", "--pose", "q2_deg=5", "--links", "beams"), "M003"),
        (("calibrate", "xr701", "gone.csv"), "A007|F001"),
        (("simulate", ""), "A008"),
        (("simulate",), "A022"),
        (("simulate", "xr701", "--posse"), "A021"),
        (("simulatte",), "A024"),
        *((tuple(old.split()), "A026") for old in GONE),
        (("rehearse", "xr701", "--seed", "x"), "A023"),
    ],
)
def test_a_message_carries_its_code(cli: Command, typed: tuple[str, ...], code: str) -> None:
    outcome = cli(*typed)
    assert outcome.code == 2
    shown = " ".join(outcome.err.replace("│", " ").split())
    assert re.search(rf"More: stiffarm help ({code})\b", shown), shown


def test_help_explains_a_code(cli: Command) -> None:
    outcome = cli("help", "t012")
    assert (outcome.code, outcome.err) == (0, "")
    assert outcome.out.strip() == catalogue()["T012"].text()


def test_help_alone_says_what_it_does_and_which_codes_there_are(cli: Command) -> None:
    outcome = cli("help")
    assert outcome.code == 0
    assert all(area in outcome.out for area in {f.area for f in ALL})


def test_help_of_a_command_is_that_commands_help(cli: Command) -> None:
    assert cli("help", "robots").out == cli("robots", "--help").out


def test_an_unknown_code_is_answered_by_those_that_are_near(cli: Command) -> None:
    outcome = cli("help", "T0122")
    assert (outcome.code, outcome.out) == (2, "")
    assert len(outcome.err.splitlines()) == 1
    assert "T012" in outcome.err


def test_the_system_code_stands_in_the_entry_point_as_well() -> None:
    assert SYSTEM in (ROOT / "stiffarm" / "__main__.py").read_text(encoding="utf-8")
