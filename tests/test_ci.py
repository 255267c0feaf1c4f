"""What CI's own scripts decide: which tests ran in no pass, and where a root installs from."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from test_house import ROOT

EACH_TEST_RAN, MACHINE = ROOT / ".ci" / "each_test_ran.py", ROOT / ".ci" / "machine.py"
SKIPPED = '<skipped type="pytest.skip" message="{}"/>'


def case(name: str, inside: str = "", module: str = "tests.test_a") -> str:
    return f'<testcase classname="{module}" name="{name}">{inside}</testcase>'


def judge(folder: Path, *passes: str, options: tuple[str, ...] = ()) -> tuple[int, str]:
    files = [folder / f"{i}.xml" for i in range(len(passes))]
    for file, cases in zip(files, passes, strict=True):
        file.write_text(f"<testsuites><testsuite>{cases}</testsuite></testsuites>", encoding="utf-8")
    command = [sys.executable, str(EACH_TEST_RAN), *options, *map(str, files)]
    run = subprocess.run(command, capture_output=True, encoding="utf-8", check=False)  # noqa: S603 - ours
    assert "Traceback" not in run.stderr
    return run.returncode, run.stdout


def test_one_pass_is_enough(tmp_path: Path) -> None:
    module_skipped = case("tests.test_b", SKIPPED.format("no b"), module="")
    first = case("test_one", SKIPPED.format("no ccx")) + case("test_two") + module_skipped
    second = case("test_one") + case("test_two", SKIPPED.format("root")) + case("test_three", module="tests.test_b")
    assert judge(tmp_path, first, second) == (0, "3 ran, 0 did not\n")


def test_what_ran_in_none_is_named_with_its_reason(tmp_path: Path) -> None:
    module_skipped = case("tests.test_b", SKIPPED.format("no b"), module="")
    first = case("test_one", SKIPPED.format("no ccx")) + case("test_two") + module_skipped
    code, out = judge(tmp_path, first, first)
    assert code == 1
    assert out.splitlines()[:2] == [
        "ran in no pass: tests.test_a::test_one: no ccx",
        "ran in no pass: tests.test_b: no b",
    ]


def test_files_with_tests_to_try_again_are_named_once(tmp_path: Path) -> None:
    module_skipped = case("tests.fem.test_b", SKIPPED.format("no b"), module="")
    skipped = "".join(case(f"test_{word}[a b/c.d]", SKIPPED.format("no ccx")) for word in ("one", "two"))
    ran = case("test_three", module="tests.test_c")
    code, out = judge(tmp_path, skipped + module_skipped + ran, options=("--files",))
    assert (code, out.split()) == (0, [f"tests/{name}.py" for name in ("fem/test_b", "test_a")])
    # Nothing was skipped: no file, where make would otherwise be told to run all.
    assert judge(tmp_path, ran, options=("--files",)) == (0, "\n")


def test_what_fails_as_expected_has_run_and_no_tests_at_all_is_a_failure(tmp_path: Path) -> None:
    assert judge(tmp_path, case("test_one", '<skipped type="pytest.xfail" message=""/>'))[0] == 0
    assert judge(tmp_path, "")[0] == 1


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="CI's roots are Linux's")
def test_a_root_installs_from_where_pip_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An index on the disk, wheels and certificates are named, and whatever else pip is told stays here."""
    wheels, index, certificates = tmp_path / "Räder", tmp_path / "pypi" / "simple", tmp_path / "ca.crt"
    wheels.mkdir()
    index.mkdir(parents=True)
    certificates.touch()
    monkeypatch.setenv("PIP_CONFIG_FILE", "/dev/null")
    monkeypatch.setenv("PIP_FIND_LINKS", f"{wheels} {tmp_path / 'gone'}")
    monkeypatch.setenv("PIP_EXTRA_INDEX_URL", f"https://example.org/simple {index.as_uri()}")
    monkeypatch.setenv("PIP_CERT", str(certificates))
    monkeypatch.setenv("PIP_CACHE_DIR", str(tmp_path))
    monkeypatch.setenv("HTTPS_PROXY", "http://proxy.example.org:3128")

    def said(what: str) -> list[str]:
        command = [sys.executable, str(MACHINE), what]
        return subprocess.run(command, capture_output=True, encoding="utf-8", check=True).stdout.splitlines()  # noqa: S603

    assert {str(wheels), str(index.parent), str(certificates)} <= set(said("paths"))
    assert not any(line.startswith(str(tmp_path / "gone")) for line in said("paths"))
    settings = said("pip")
    assert settings[0] == "[global]"
    assert f"extra-index-url = https://example.org/simple {index.as_uri()}" in settings
    assert not any("cache" in line for line in settings)
    assert "HTTPS_PROXY=http://proxy.example.org:3128" in said("network")
