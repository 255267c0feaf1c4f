"""Programs of changed templates: what cannot be read back or differs is said; nothing else counts as the same."""

from __future__ import annotations

from pathlib import Path

import pytest
from program_cases import PLAIN, program_of
from refusals import refuses

from machining.programs.formats import round_trip, write_program
from machining.programs.program import JointProgram
from machining.programs.write_options import WriteOptions

BUNDLED = Path(__file__).parents[3] / "machining" / "programs" / "templates"
OPTIONS = WriteOptions.model_validate({"arm": PLAIN})
NINES = "9" * 5000
SIDES = '{{ m.configuration | join(",") }}'
QUATERNION = "[{{ w[3] }},{{ w[4] }},{{ w[5] }},{{ w[6] }}]"
pytestmark = pytest.mark.filterwarnings("error")


@pytest.fixture(scope="module")
def program() -> JointProgram:
    return program_of(n=5)


def compare(program: JointProgram, language: str, templates: Path) -> None:
    """As the command does: raise what differs."""
    files = write_program(program, language, "cartesian", OPTIONS, templates).texts()
    wrong = round_trip(program, files, language, "cartesian", OPTIONS).difference()
    if wrong is not None:
        raise wrong


@pytest.mark.parametrize(
    ("template", "old", "new", "message"),
    [
        ("val3/data.j2", 'key="{{ m.place }}"', f'key="{NINES}"', r"part\.dtx, line \d+, key"),
        ("val3/data.j2", 'key="{{ m.place }}"', 'key="0"', "each once"),
        ("val3/data.j2", 'name="{{ o.tool_name }}"', 'name="pPath"', "stands there twice"),
        ("val3/data.j2", ' x="{{ w[0] }}"', "", "no x"),
        ("val3/data.j2", 'x="{{ w[0] }}"', 'x="1e300"', "a finite number"),
        ("val3/data.j2", 'shoulder="{{ c[0] }}" ', "", "configuration of the arm"),
        ("val3/data.j2", '"{{ c[0] }}"', '"same"', "configuration of the arm"),
        ("val3/moves.j2", "{{ m.place }}]", NINES + "]", "pPath"),
        ("val3/moves.j2", "{{ m.place }}]", "\u0663]", "pPath"),
        ("val3/moves.j2", "mStop.tvel={{ m.feed }}", "mStop.tvel=1", "speeds differ"),
        ("val3/moves.j2", "mMove.tvel={{ m.feed }}", "mMove.tvel=-5", "speeds differ"),
        ("val3/moves.j2", "mMove.tvel={{ m.feed }}", "", "no speed"),
        ("val3/moves.j2", '"movel(pPath["', '"movej(pPath["', "exchanged"),
        ("val3/moves.j2", '"movel(pPath["', '"do movel(pPath["', "do movel"),
        ("rapid/moves.j2", SIDES, "0.5,0,0,0", "a whole number"),
        ("rapid/moves.j2", SIDES, "9,9,9,9", "configuration of the arm"),
        ("rapid/moves.j2", QUATERNION, "[0,0,0,0]", "a quaternion of length 1"),
        ("rapid/moves.j2", QUATERNION, "[2,0,0,0]", "a quaternion of length 1"),
        ("rapid/moves.j2", "[[{{ w[0] }},", "[[1e308,", "a finite number"),
        ("rapid/moves.j2", "[[{{ w[0] }},", "[[1_0,", "a finite number"),
        ("rapid/moves.j2", "[[{{ w[0] }},", "[[{{ w[1] }},", "off the tool path"),
        ("rapid/moves.j2", ":= {{ m.feed }}", ":= 5", "speeds differ"),
        ("rapid/moves.j2", "    vMove.v_tcp := {{ m.feed }};", "", "no speed"),
        ("rapid/moves.j2", '    {{ "MoveJ"', '    IF TRUE {{ "MoveJ"', "IF TRUE MoveJ"),
        ("rapid/moves.j2", "{% set w = m.words %}", "{% set w = m.words %}\nWHILE TRUE DO", "motion within a loop"),
        ("rapid/moves.j2", "{% for m in moves %}", "GOTO away;\n{% for m in moves %}", "a jump"),
        ("krl/moves.j2", "m.named", 'm.named ~ ",S 1.5"', "a whole number"),
        ("krl/moves.j2", "m.named", 'm.named ~ ",S 7"', "configuration of the arm"),
        ("krl/moves.j2", "$VEL.CP = {{ m.feed }}", "$VEL.CP = 7", "speeds differ"),
    ],
)
def test_what_differs_is_said(
    program: JointProgram, tmp_path: Path, template: str, old: str, new: str, message: str
) -> None:
    text = (BUNDLED / template).read_text(encoding="utf-8")
    assert old in text
    language = template.partition("/")[0]
    (tmp_path / language).mkdir()
    (tmp_path / template).write_text(text.replace(old, new), encoding="utf-8")
    caught = refuses("Q001 Q005", message, compare, program, language, tmp_path)
    assert len(str(caught)) < 3000


@pytest.mark.parametrize("language", ["krl", "rapid", "val3"])
def test_a_shops_own_loops_around_no_motion_are_read_over(program: JointProgram, tmp_path: Path, language: str) -> None:
    loop = {
        "krl": 'WHILE $IN[1]\nWAIT SEC 0.1\nENDWHILE\nMSG("LIN {X 1} GOTO")\n; GOTO 5\n',
        "rapid": '    WHILE di1 = 0 DO\n      WaitTime 0.1;\n    ENDWHILE\n    TPWrite "MoveL GOTO";\n    ! MoveL\n',
        "val3": '  while dIn==false\n    delay(0.1)\n  endWhile\n  putln("movel(")\n  // movel( goto\n',
    }[language]
    mark = "{% set w = m.words %}" if language != "val3" else '  {{ "movel('
    text = (BUNDLED / language / "moves.j2").read_text(encoding="utf-8")
    (tmp_path / language).mkdir()
    (tmp_path / language / "moves.j2").write_text(text.replace(mark, loop + mark, 1), encoding="utf-8")
    compare(program, language, tmp_path)
