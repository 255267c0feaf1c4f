"""The catalogue of failures: complete, without dead entries, and in the words of its users."""

from __future__ import annotations

import ast
import re
from collections import Counter

import pytest
from cli_runs import Command
from error_sites import ROOT, Site, error_sites
from prose_files import parts
from test_house import LAYERS, sources

from machining.toolpaths.recorder import StatementError
from machining.verification.offences import Kind
from robots import InputError, InputErrors
from robots.errors import raised_at
from stiffarm.cli import COMMANDS, GONE, command_of
from stiffarm.failures import SYSTEM, Failure, catalogue, covering, failure_of, said, warning_of
from stiffarm.session.console import say, say_error

SITES = error_sites()
ALL = list(catalogue().values())


def entries_of(site: Site) -> list[tuple[str, Failure]]:
    return covering(site.place, site.words)


def test_each_place_that_makes_errors_has_exactly_one_entry() -> None:
    assert len(SITES) > 1200
    found = {f"{site.place} {site.line}": [f.code for _, f in entries_of(site)] for site in SITES}
    assert {place: codes for place, codes in found.items() if len(codes) != 1} == {}


def test_no_entry_is_dead() -> None:
    """Whatever an entry names is the place of an error, a warning's words, or a code that the program uses."""
    used = {place for site in SITES for place, _ in entries_of(site)}
    named = {cover for failure in ALL for cover in failure.covers if not cover.startswith("click:")}
    assert named - used == set()
    constants = {
        node.value
        for path in sources()
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Constant) and isinstance(node.value, str)
    }
    warnings = [words for failure in ALL for words in failure.says]
    assert [words for words in warnings if not any(words in text for text in constants)] == []
    assert [f.code for f in ALL if f.named and not any(f.code in text for text in constants)] == []
    assert [f.code for f in ALL if not (f.covers or f.says or f.finding or f.named)] == []


def test_each_kind_of_a_verification_has_its_entry() -> None:
    assert Counter(f.finding for f in ALL if f.finding) == Counter(str(kind) for kind in Kind)


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
    """Some words of the example stand in the code at a place that the entry covers."""
    by_code: dict[str, list[str]] = {}
    for site in SITES:
        for _, failure in entries_of(site):
            by_code.setdefault(failure.code, []).extend(part.strip() for part in site.words.split("\0"))
    missing = [
        f.code
        for f in ALL
        if any(len(part) > 4 for part in by_code.get(f.code, []))
        and not any(len(part) > 4 and part in f.example for part in by_code[f.code])
    ]
    assert missing == []


def test_an_error_knows_where_it_was_made() -> None:
    def made() -> list[InputError]:
        return [InputError(what) for what in ("a", "b")]

    here = f"{__name__}:test_an_error_knows_where_it_was_made.made"
    assert [error.site for error in made()] == [here, here]
    assert StatementError("c").site == raised_at() == here.removesuffix(".made")
    assert InputError("d", site="robots.urdf.xml:_root").site == "robots.urdf.xml:_root"


def test_several_faults_carry_a_code_each(capsys: pytest.CaptureFixture[str]) -> None:
    one, other = InputError("a", site="robots.urdf.xml:_root"), InputError("b", site="nobody:knows")
    say_error(InputErrors("two", [one, other]))
    head, *lines = capsys.readouterr().err.splitlines()
    assert head == "stiffarm: two: 2 problem(s). More: stiffarm help CODE"
    assert lines == ["  - a [R011]", "  - b"]
    assert said(InputErrors("nested", [InputErrors("two", [one, other])])).endswith("More: stiffarm help R011")
    assert failure_of(other) is None
    assert said(other) == "b"


def test_a_warning_carries_its_code(capsys: pytest.CaptureFixture[str]) -> None:
    say("note: a poor surrogate: 14 % RMS")
    say("note: all is well")
    assert capsys.readouterr().err.splitlines() == ["note: a poor surrogate: 14 % RMS [W011]", "note: all is well"]
    assert warning_of("all is well") is None


def test_the_words_of_a_warning_stand_in_the_code() -> None:
    """A warning whose words were changed would lose its code."""
    files = [path for package in LAYERS for path in (ROOT / package).rglob("*") if path.suffix in (".py", ".j2")]
    # Texts that run over lines, and places for values in them.
    code = "\n".join(re.sub(r'"\s*\n\s*f?"', "", path.read_text(encoding="utf-8")) for path in files)
    said = [(f.code, words) for f in ALL for words in f.says]
    assert [(name, words) for name, words in said if words not in code] == []
    # One example each, known by its own words alone.
    examples = [(f.code, warning_of(f.example)) for f in ALL if f.says]
    assert [name for name, known in examples if known is None or known.code != name] == []


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
