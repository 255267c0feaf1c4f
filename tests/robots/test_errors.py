"""Messages: printable lines of bounded length, whatever the input holds."""

from __future__ import annotations

import pytest

from robots.errors import FAULTS_SHOWN, InputError, InputErrors, line_ranges, listed, meant, one_line, shortened

HOSTILE = "\x1b]0;owned\x07\x1b[2J\x9b31m\r\nfake: line\u2028\u202emirrored\x00\ud800"


def test_what_steers_a_terminal_is_spelled_out() -> None:
    line = one_line(HOSTILE)
    assert line.isprintable()
    assert line == r"\x1b]0;owned\x07\x1b[2J\x9b31m\r\nfake: line\u2028\u202emirrored\x00\ud800"
    assert one_line("größer als 5 µm") == "größer als 5 µm"
    assert one_line("below 1\u00a0%") == "below 1 %"


@pytest.mark.parametrize("part", ["what", "value", "allowed", "remedy"])
def test_no_part_of_an_error_can_steer_a_terminal(part: str) -> None:
    error = InputError(code="X004", **{"what": "x", part: HOSTILE})  # type: ignore[arg-type]
    assert str(error).isprintable()
    assert "owned" in str(error)


def test_an_error_repeats_no_more_than_finds_the_place() -> None:
    long = "9" * 3_000_000
    error = InputError(long, code="X004", value=long, allowed=long, remedy=long)
    assert len(str(error)) < 8000
    assert str(error).count("(3000000 characters)") == 4
    assert len(str(InputError("x", code="X004", value=[1.5] * 100_000))) < 1000
    assert "thousands of digits" in str(InputError("x", code="X004", value=10**5000))
    assert (
        str(InputError("x", code="X004", value="5\n", allowed="3", remedy="y"))
        == r"x: got '5\n'; allowed: 3. To fix it: y"
    )


def test_many_faults_are_counted_and_the_first_spelled_out() -> None:
    errors = InputErrors("data.csv", [InputError(f"row {i}\nowned", code="X004") for i in range(200)])
    lines = str(errors).split("\n")
    assert lines[0] == "data.csv: 200 problem(s)"
    assert lines[1] == r"  - row 0\nowned"
    assert lines[-1] == "  ... and 180 more"
    assert len(lines) == FAULTS_SHOWN + 2
    assert (len(errors.errors), errors.count) == (200, 200)
    assert "more" not in str(InputErrors("data.csv", errors.errors[:FAULTS_SHOWN]))


def test_many_long_faults_stay_a_page() -> None:
    errors = [InputError("x" * 10**5, code="X004", value="\x1b" * 10**5, remedy="\u202e" * 10**5)] * 1000
    assert len(str(InputErrors("\x1b" * 10**5, errors, 10**6))) < 30_000
    assert str(InputErrors("data.csv", errors, 10**6)).endswith("... and 999980 more")


@pytest.mark.slow
def test_names_and_lines_are_listed_briefly() -> None:
    assert listed(["a", "b", "a"]) == "a, b"
    assert listed(f"u{i}" for i in range(1_000_000)) == f"{', '.join(f'u{i}' for i in range(12))} and 999988 more"
    assert line_ranges([5, 6, 7, 14, 20, 21]) == "5-7, 14, 20-21"
    assert line_ranges([]) == ""
    assert line_ranges(range(2, 300_000)) == "2-299999"
    assert line_ranges(range(0, 100, 2)).endswith(" and 38 more")
    assert shortened("abc", 2) == "ab... (3 characters)"


@pytest.mark.parametrize(
    ("value", "allowed", "close"),
    [
        ("j2.stiffnes", "{base,j1,j2}.{tx|ty}; {j1,j2}.stiffness; bar.stiffness", "j2.stiffness"),
        ("j22", "j1, j2, j3", "j2"),
        ("q22_deg", "q1_deg, q2_deg", "q2_deg"),
        ("xr702", "kr60-3, xr701, or the path of a model TOML", "xr701"),
        # Far from all of them, the same, numbers, sentences, no list: nothing is offered.
        ("waist", "j1, j2, j3", None),
        ("j2", "j1, j2, each once", None),
        (5, "4, 6", None),
        ("a finite numbr", "a finite number", None),
        ("j22", None, None),
        # Names that come from files may look like patterns of astronomically many names.
        ("a", "{a,b}" * 60, None),
    ],
)
def test_a_mistyped_name_is_answered_by_the_one_that_is_close(
    value: object, allowed: str | None, close: str | None
) -> None:
    assert meant(value, allowed) == close
    message = str(InputError("--free", code="X004", value=value, allowed=allowed, remedy="correct it"))
    assert (f"Did you mean {close}?" in message) == (close is not None)
    assert message.endswith("To fix it: correct it")
