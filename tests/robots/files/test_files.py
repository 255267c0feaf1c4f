"""The one place that opens input files: what it refuses, and that a run records what it read."""

from __future__ import annotations

import hashlib
import os
import time
from pathlib import Path

import pytest
from refusals import refuses

from robots.files.reading import DEEPEST, parse_json, parse_toml, read_bytes, read_text, recording


def test_content_comes_back(tmp_path: Path) -> None:
    file = tmp_path / "a"
    file.write_bytes(b"\xef\xbb\xbfaou\r\n")
    assert read_bytes(file, "thing") == b"\xef\xbb\xbfaou\r\n"
    assert read_text(file, "thing") == "aou\r\n"


def test_what_is_no_ordinary_file_is_refused_at_once(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    for path, words in (
        (pipe, "a pipe, socket or device"),
        (Path("/dev/zero"), "a pipe, socket or device"),
        (tmp_path, "it is a folder"),
        (tmp_path / "none", "it does not exist"),
        (Path("a\0b"), "cannot be read"),
    ):
        caught = refuses("F001", words, read_bytes, path, "thing")
        assert str(caught).startswith("thing ")


def test_size_is_bounded_also_where_the_file_does_not_say_it(tmp_path: Path) -> None:
    file = tmp_path / "a"
    file.write_bytes(b"12345")
    assert read_bytes(file, "thing", most=5) == b"12345"
    refuses("F002", r"size: got '5 bytes'; allowed: up to 4 bytes", read_bytes, file, "thing", most=4)
    refuses("F002", "allowed: up to 4 bytes", read_bytes, "/proc/self/status", "thing", most=4)


def test_text_must_be_utf_8(tmp_path: Path) -> None:
    (tmp_path / "a").write_bytes(b"abc\xff")
    refuses("F004", "from byte 3 on", read_text, tmp_path / "a", "thing")


def test_within_a_recording_a_file_is_read_once(tmp_path: Path) -> None:
    file = tmp_path / "a"
    file.write_bytes(b"old")
    with recording() as ledger:
        read_bytes(file, "thing")
        file.write_bytes(b"new")
        assert read_bytes(file, "thing") == b"old"
        file.unlink()
        with recording() as inner:
            assert read_bytes(tmp_path / "." / "a", "thing") == b"old"
            assert inner is ledger
        assert ledger.of(file) == hashlib.sha256(b"old").hexdigest()
        assert ledger.of(tmp_path / "b") is None
    refuses("F001", "does not exist", read_bytes, file, "thing")


def test_a_large_file_that_changes_between_two_readings_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("robots.files.reading.MOST_KEPT", 2)
    file = tmp_path / "a"
    file.write_bytes(b"old")
    with recording() as ledger:
        ledger._room = 2
        read_bytes(file, "thing")
        assert read_bytes(file, "thing") == b"old"
        file.write_bytes(b"new")
        refuses("F003", "has changed while this command was running", read_bytes, file, "thing")


def test_what_the_program_wrote_itself_is_read_as_it_stands(tmp_path: Path) -> None:
    file = tmp_path / "a"
    with recording() as ledger:
        for content in (b"one", b"two"):
            file.write_bytes(content)
            assert read_bytes(file, "thing", kept=False) == content
        assert not ledger.sha256


DEEP = DEEPEST + 1


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("a = " + "9" * 400, "64 bits"),
        ("a = " + "9" * 5000, "64 bits"),
        ("a = [{b = 0x" + "f" * 17 + "}]", "64 bits"),
        ("a = " + "[" * DEEP + "]" * DEEP, "deep"),
        ("a = " + "[" * 10**5 + "]" * 10**5, "deep"),
        ("a = 1\na = 2", "not valid TOML"),
    ],
)
def test_toml_that_no_reader_could_hold_is_refused(text: str, words: str) -> None:
    caught = refuses("F005", words, parse_toml, text, "arm.toml")
    assert str(caught).startswith("arm.toml")
    assert len(str(caught)) < 300


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[1e999]", "beyond the largest number"),
        ("[NaN]", "NaN is not a number"),
        ('{"a": -Infinity}', "-Infinity is not a number"),
        ("9" * 400, "64 bits"),
        ("-" + "9" * 5000, "64 bits"),
        ("9223372036854775808", "64 bits"),
        ('{"a": 1, "b": 0, "a": 2}', "key 'a' stands twice"),
        ("[" * DEEP + "]" * DEEP, "deep"),
        ("[" * 10**5 + "]" * 10**5, "deep"),
        ("{", "not valid JSON"),
    ],
)
def test_json_that_no_reader_could_hold_is_refused(text: str, words: str) -> None:
    caught = refuses("F005", words, parse_json, text, "s.json", remedy="fit again")
    assert str(caught).startswith("s.json")
    assert len(str(caught)) < 300


def test_good_toml_and_json_with_a_byte_order_mark() -> None:
    assert parse_toml("\ufeffa = -9223372036854775807\r\nb = [[1]]", "x") == {"a": -(2**63) + 1, "b": [[1]]}
    assert parse_json('\ufeff{"a": [1, 2.5, -9223372036854775807]}', "x") == {"a": [1, 2.5, -(2**63) + 1]}


@pytest.mark.parametrize(
    "key", ["x" + ".x" * 100_000 + " = 1", "[" + "x." * 100_000 + "x]", 'y = {"x"' + ' . "x"' * 1000 + "= 1}"]
)
def test_a_key_of_a_hundred_thousand_parts_is_refused_at_once(key: str) -> None:
    start = time.monotonic()
    refuses("F005", "nested more than 64 deep", parse_toml, key, "file")
    assert (
        time.monotonic() - start < 60.0
    )  # it took minutes, going up with the square of the parts; now it takes milliseconds


def test_many_numbers_on_a_line_are_no_key() -> None:
    assert len(parse_toml("x = [" + "1.5," * 1000 + "]", "file")["x"]) == 1000
