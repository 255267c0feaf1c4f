"""The house rules that a machine can check: imports flow one way, nothing unsafe, nothing sprawling."""

from __future__ import annotations

import ast
import importlib
import importlib.metadata
import json
import os
import re
import shutil
import subprocess
import sys
import tomllib
from collections import Counter
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
# Bottom first: a package may import those before it.
LAYERS = ("robots", "meshes", "fem", "doe", "surrogate", "machining", "rehearsal", "stiffarm")
LONGEST_FILE = 600
# Python files in a folder; more do not fit in a head.
FULLEST_FOLDER = 24
# Reading any of these runs what the file says.
UNSAFE_MODULES = {"pickle", "_pickle", "cPickle", "cloudpickle", "dill", "joblib", "shelve", "marshal"}
UNSAFE_CALLS = {"eval", "exec", "compile", "__import__"}
UNSAFE_METHODS = {"read_pickle", "to_pickle", "system", "popen"}
UNSAFE_FLAGS = {"allow_pickle", "shell"}


def sources(root: Path = ROOT) -> list[Path]:
    return sorted(path for package in LAYERS for path in (root / package).rglob("*.py"))


def project() -> dict[str, object]:
    return tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))


def imported_modules(tree: ast.AST, package: str) -> set[str]:
    """Names of the modules imported anywhere in a file, functions included; ``.x`` is the package's own."""
    found: set[str] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            found.add(package if node.level else str(node.module))
    return found


def unsafe_parts(tree: ast.AST) -> list[str]:
    """Imports and calls that could run code from a file or a string."""
    found = [name for name in imported_modules(tree, "") if name.split(".")[0] in UNSAFE_MODULES]
    for node in ast.walk(tree):
        if not isinstance(node, ast.Call):
            continue
        if isinstance(node.func, ast.Name) and node.func.id in UNSAFE_CALLS:
            found.append(node.func.id)
        if isinstance(node.func, ast.Attribute) and node.func.attr in UNSAFE_METHODS:
            found.append(node.func.attr)
        for keyword in node.keywords:
            safe = isinstance(keyword.value, ast.Constant) and keyword.value.value is False
            if keyword.arg in UNSAFE_FLAGS and not safe:
                found.append(str(keyword.arg))
    return found


def lint_imports(folder: Path) -> subprocess.CompletedProcess[str]:
    # In a process of its own: import-linter changes sys.path and its registry of contracts.
    code = "import sys; from importlinter.cli import lint_imports; sys.exit(lint_imports(no_cache=True))"
    return subprocess.run(  # noqa: S603 - our own interpreter with a constant argument
        [sys.executable, "-c", code],
        cwd=folder,
        # Where a report has drawings in it, a machine set to plain ASCII must be able to print it.
        env={**os.environ, "PYTHONIOENCODING": "utf-8"},
        stdin=subprocess.DEVNULL,
        capture_output=True,
        encoding="utf-8",
        timeout=120,
        check=False,
    )


def test_the_import_contract_holds() -> None:
    result = lint_imports(ROOT)
    assert result.returncode == 0, result.stdout + result.stderr
    assert "5 kept, 0 broken" in result.stdout


def test_the_import_contract_can_break(tmp_path: Path) -> None:
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    for path in sources():
        empty = tmp_path / path.relative_to(ROOT)
        empty.parent.mkdir(parents=True, exist_ok=True)
        empty.touch()
    assert lint_imports(tmp_path).returncode == 0
    (tmp_path / "robots" / "__init__.py").write_text("def f():\n    import fem\n", encoding="utf-8")
    result = lint_imports(tmp_path)
    assert result.returncode != 0
    assert "robots is not allowed to import fem" in result.stdout
    (tmp_path / "robots" / "__init__.py").write_text("", encoding="utf-8")
    (tmp_path / "stiffarm/session/console.py").write_text("import stiffarm.pages.report\n", encoding="utf-8")
    (tmp_path / "stiffarm/commands/plan/step.py").write_text("import stiffarm.commands.run.command\n", encoding="utf-8")
    (tmp_path / "doe/certainty/uncertainty.py").write_text("import doe.calibration.run\n", encoding="utf-8")
    (tmp_path / "rehearsal/world.py").write_text("import robots.kinematics\n", encoding="utf-8")
    assert "1 kept, 4 broken" in lint_imports(tmp_path).stdout


@pytest.mark.parametrize("package", LAYERS)
def test_no_package_imports_upward(package: str) -> None:
    """The same rule read from the source, so that a change of the linter's settings cannot lift it."""
    above = set(LAYERS[LAYERS.index(package) + 1 :])
    for path in (ROOT / package).rglob("*.py"):
        modules = imported_modules(ast.parse(path.read_text(encoding="utf-8")), package)
        upward = above & {module.split(".")[0] for module in modules}
        assert not upward, f"{path.relative_to(ROOT)} imports {upward}"


@pytest.mark.parametrize("package", LAYERS)
def test_tests_see_this_tree(package: str) -> None:
    """Not another installed copy, and not tests/robots in the place of robots."""
    module = importlib.import_module(package)
    assert module.__file__ is not None
    assert Path(module.__file__).resolve() == ROOT / package / "__init__.py"


def imports_of(path: Path, known: set[str]) -> set[str]:
    """Our own modules that a file imports, functions included; what only type checkers read is no import."""
    found: set[str] = set()
    waiting: list[ast.AST] = [ast.parse(path.read_text(encoding="utf-8"))]
    while waiting:
        node = waiting.pop()
        if isinstance(node, ast.If) and isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING":
            continue
        waiting += ast.iter_child_nodes(node)
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            inside = {f"{node.module}.{alias.name}" for alias in node.names}
            found |= inside & known or {node.module}
    return found & known


def test_no_modules_import_each_other_in_a_circle() -> None:
    names = {
        ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__"): path for path in sources()
    }
    waits = {name: imports_of(path, set(names)) - {name} for name, path in names.items()}
    # Taken away again and again: modules that wait for none of those left. A circle never goes.
    while free := {name for name, others in waits.items() if not others & waits.keys()}:
        waits = {name: others for name, others in waits.items() if name not in free}
    assert sorted(waits) == []


def test_nothing_can_run_code_from_a_file() -> None:
    files = sources()
    assert len(files) > len(LAYERS)
    word = re.compile("|".join({*UNSAFE_MODULES, *UNSAFE_CALLS, *UNSAFE_METHODS, *UNSAFE_FLAGS}))
    # Parsing all of them would take most of the test's time.
    texts = {path: text for path in files if word.search(text := path.read_text(encoding="utf-8"))}
    found = {str(path.relative_to(ROOT)): bad for path, text in texts.items() if (bad := unsafe_parts(ast.parse(text)))}
    assert found == {}


@pytest.mark.parametrize(
    ("code", "found"),
    [
        ("import pickle", ["pickle"]),
        ("def f():\n    from joblib import load", ["joblib"]),
        ("import numpy.linalg", []),
        ("x = eval('1')", ["eval"]),
        ("frame.eval('a + b')", []),
        ("re.compile('a')", []),
        ("pd.read_pickle('a')", ["read_pickle"]),
        ("np.load('a', allow_pickle=True)", ["allow_pickle"]),
        ("np.load('a', allow_pickle=False)", []),
        ("subprocess.run('ls', shell=True)", ["shell"]),
        ("os.system('ls')", ["system"]),
    ],
)
def test_the_scan_for_unsafe_code_sees_it(code: str, found: list[str]) -> None:
    assert unsafe_parts(ast.parse(code)) == found


def test_no_file_sprawls() -> None:
    lengths = {path: len(path.read_text(encoding="utf-8").splitlines()) for path in sources()}
    too_long = {str(p.relative_to(ROOT)): n for p, n in lengths.items() if n >= LONGEST_FILE}
    assert too_long == {}


def test_no_folder_sprawls() -> None:
    folders = Counter(path.parent for top in (*LAYERS, "tests", "benchmarks") for path in (ROOT / top).rglob("*.py"))
    too_full = {str(folder.relative_to(ROOT)): n for folder, n in folders.items() if n > FULLEST_FOLDER}
    assert too_full == {}


@pytest.mark.parametrize("package", LAYERS)
def test_each_package_is_typed_and_shipped(package: str) -> None:
    setuptools = project()["tool"]["setuptools"]  # type: ignore[index]
    assert (ROOT / package / "py.typed").is_file()
    assert "py.typed" in setuptools["package-data"][package]
    assert f"{package}*" in setuptools["packages"]["find"]["include"]
    folders = {path.parent for path in (ROOT / package).rglob("*.py")}
    bare = [str(folder.relative_to(ROOT)) for folder in folders if not (folder / "__init__.py").is_file()]
    assert bare == [], "folders that are not installed, for want of an __init__.py"


def test_every_requirement_is_pinned() -> None:
    def key(name: str) -> str:
        return re.sub(r"[-_.]+", "-", name).lower()

    table = project()["project"]
    wanted = [*table["dependencies"]]  # type: ignore[index]
    for extra in ("test", "oracle", "dev"):
        wanted += table["optional-dependencies"][extra]  # type: ignore[index]
    lines = (ROOT / "constraints.txt").read_text(encoding="utf-8").split()
    pinned = {key(line.split("==")[0]) for line in lines if "==" in line}
    names = {key(re.split(r"[^A-Za-z0-9._-]", requirement)[0]) for requirement in wanted}
    assert names - pinned == set()


def test_test_files_have_names_of_their_own() -> None:
    """Test folders are no packages, so pytest would take two files of one name for the same module."""
    names = Counter(path.name for path in (ROOT / "tests").rglob("test_*.py"))
    assert [name for name, count in names.items() if count > 1] == []


# What has one home: a pattern of it, and the file where it stands.
ONE_HOME = {
    r"NDArray\[np\.(?:float64|bool_|int64|intp)\]": "robots/arrays.py",
    r"Callable\[\[int, int\], None\]": "robots/progress.py",
    r"= 1\.96\d*\b|= 9\.8\d*\b": "robots/constants.py",
}


@pytest.mark.parametrize("pattern", ONE_HOME)
def test_small_things_have_one_home(pattern: str) -> None:
    word = re.compile(pattern, re.MULTILINE)
    found = [p.relative_to(ROOT).as_posix() for p in sources() if word.search(p.read_text(encoding="utf-8"))]
    assert found == [ONE_HOME[pattern]], "import it from there"


def test_type_checkers_find_an_editable_installation() -> None:
    """It is a folder on the path: mypy and editors follow no import hook."""
    elsewhere = [p for p in sys.path if p != str(ROOT)]
    found = next(iter(importlib.metadata.distributions(name="stiffarm", path=elsewhere)), None)
    files = (found and found.files) or ()
    url = next((f.read_text() for f in files if f.name == "direct_url.json"), "{}")
    if not json.loads(url).get("dir_info", {}).get("editable"):
        pytest.skip("not an editable installation")
    (path,) = [f.read_text().strip() for f in files if f.suffix == ".pth"]
    assert (Path(path) / "stiffarm" / "py.typed").is_file()
