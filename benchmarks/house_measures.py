"""How the house is built, in figures: helpers with one caller, data classes, folders, and what two commands run.

``python benchmarks/house_measures.py`` prints a table with the aims. OMP_NUM_THREADS=1.
"""

from __future__ import annotations

import ast
import json
import os
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

ROOT = next(folder for folder in Path(__file__).resolve().parents if (folder / "pyproject.toml").is_file())
PRODUCT = ("robots", "meshes", "fem", "doe", "surrogate", "machining", "rehearsal", "stiffarm")
CALIBRATE = ("calibrate", "xr701", "--free", "j2.stiffness,j3.stiffness")
QUERY = ("--pose", "q2_deg=5,q3real_deg=77.5")
# Runs a command in this process and prints how many functions of the product, in how many files, it entered.
COUNTED = """
import json, os, sys
root, *names = json.loads(sys.argv[1])
folders = tuple(os.path.join(root, name) + os.sep for name in names)
seen = set()
def note(frame, event, _):
    code = frame.f_code
    # Bodies of modules, classes and comprehensions are no functions.
    if event == "call" and not code.co_name.startswith("<") and code.co_flags & 2 and code not in seen:
        if code.co_filename.startswith(folders):
            seen.add(code)
from stiffarm.__main__ import main
del sys.argv[1]
sys.setprofile(note)
try:
    status = main()
except SystemExit as end:
    status = end.code
sys.setprofile(None)
print(json.dumps([status or 0, len(seen), len({code.co_filename for code in seen})]), file=sys.stderr)
"""


def sources() -> dict[Path, ast.Module]:
    """Syntax trees of the product's files."""
    return {
        path: ast.parse(path.read_text(encoding="utf-8")) for name in PRODUCT for path in (ROOT / name).rglob("*.py")
    }


def references(tree: ast.AST) -> Counter[str]:
    """How often each name is used: as a name, an attribute or an import."""
    found: Counter[str] = Counter()
    for node in ast.walk(tree):
        if isinstance(node, ast.Name):
            found[node.id] += 1
        elif isinstance(node, ast.Attribute):
            found[node.attr] += 1
        elif isinstance(node, ast.ImportFrom):
            found.update(alias.name for alias in node.names)
    return found


def functions(tree: ast.AST) -> Iterator[ast.FunctionDef | ast.AsyncFunctionDef]:
    return (node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef))


def called_once(trees: dict[Path, ast.Module]) -> tuple[int, int]:
    """Private functions and methods with a single reference outside of themselves, and all functions.

    A private name belongs to its file: the same one elsewhere is another function, unless it is imported from here.
    """
    once = every = 0
    imported: Counter[str] = Counter()
    for tree in trees.values():
        for node in ast.walk(tree):
            if isinstance(node, ast.ImportFrom):
                imported.update(alias.name for alias in node.names)
    for tree in trees.values():
        here = references(tree)
        for function in functions(tree):
            every += 1
            name = function.name
            if name.startswith("_") and not (name.startswith("__") and name.endswith("__")):
                once += here[name] - references(function)[name] + imported[name] == 1
    return once, every


def classes(trees: dict[Path, ast.Module]) -> Counter[str]:
    """Data classes of each kind: by decorator, named tuples, and pydantic models with what derives from them."""
    kinds: Counter[str] = Counter()
    bases: dict[str, set[str]] = {}
    for tree in trees.values():
        for node in ast.walk(tree):
            if isinstance(node, ast.ClassDef):
                above = {ast.unparse(base).rpartition(".")[2] for base in node.bases}
                bases.setdefault(node.name, set()).update(above)
                kinds["dataclasses"] += any("dataclass" in ast.unparse(one) for one in node.decorator_list)
                kinds["named tuples"] += "NamedTuple" in above
    models = {"BaseModel"}
    while more := {name for name, above in bases.items() if above & models} - models:
        models |= more
    kinds["pydantic models"] = len(models) - 1
    return kinds


def largest_folder() -> tuple[int, str]:
    """Python files in the fullest folder of the product, and its name."""
    count = Counter(path.parent for name in PRODUCT for path in (ROOT / name).rglob("*.py"))
    folder, files = count.most_common(1)[0]
    return files, folder.relative_to(ROOT).as_posix()


def entered(command: tuple[str, ...]) -> tuple[int, int]:
    """Functions of the product that a command enters, and their files."""
    where = json.dumps([str(ROOT), *PRODUCT])
    run = subprocess.run(  # noqa: S603 - our own interpreter
        [sys.executable, "-c", COUNTED, where, *command],
        check=True,
        capture_output=True,
        text=True,
        cwd=ROOT,
        env={**os.environ, "OMP_NUM_THREADS": "1", "PYTHONPATH": str(ROOT)},
    )
    status, count, files = json.loads(run.stderr.splitlines()[-1])
    if status:
        raise SystemExit(f"{' '.join(command)} ended with {status}:\n{run.stderr}")
    return count, files


def table() -> list[str]:
    """Lines of a table: each measure with its figure and its aim."""
    trees = sources()
    once, every = called_once(trees)
    kinds = classes(trees)
    files, folder = largest_folder()
    with tempfile.TemporaryDirectory() as out:
        calibrate = entered((*CALIBRATE, "--out", f"{out}/cal"))
        entered(("fit", "xr701", "--runs", "512", "--out", f"{out}/sur"))
        query = entered(("query", f"{out}/sur/surrogate.json", *QUERY))
    return [
        "| measure | figure | aim |",
        "|---|---|---|",
        f"| private functions with one caller, of {every} functions | {once} ({once / every:.1%}) | 10 % |",
        f"| data classes: {', '.join(f'{n} {kind}' for kind, n in kinds.items())} | {kinds.total()} | 350 |",
        f"| Python files in the largest folder ({folder}) | {files} | 24 |",
        f"| functions that `calibrate` of two springs runs | {calibrate[0]} in {calibrate[1]} files | 600 in 80 |",
        f"| functions that `query` runs | {query[0]} in {query[1]} files | 150 in 30 |",
    ]


if __name__ == "__main__":
    print("\n".join(table()))
