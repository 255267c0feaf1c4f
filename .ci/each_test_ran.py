"""Names every test that ran in no pass:  python3 .ci/each_test_ran.py PASS.xml ... (written by pytest --junitxml).

With ``--files`` first, the files that hold such tests instead: what a pass elsewhere is to try again.
"""

from __future__ import annotations

import sys
import xml.etree.ElementTree as ET
from collections.abc import Iterable


def judge(paths: list[str]) -> tuple[set[str], dict[str, str]]:
    """Tests that ran in a pass, and why each other one did not. A file that skips as a whole counts as one test."""
    ran: set[str] = set()
    skipped: dict[str, str] = {}
    files: set[str] = set()
    for path in paths:
        for case in ET.parse(path).iter("testcase"):  # noqa: S314 - written by our own pytest
            file, reason = case.get("classname", ""), case.find("skipped")
            name = "::".join(filter(None, (file, case.get("name"))))
            # What fails as expected has run.
            if reason is None or reason.get("type") == "pytest.xfail":
                ran.add(name)
                files.add(file)
            else:
                skipped.setdefault(name, str(reason.get("message")))
    return ran, {name: why for name, why in skipped.items() if name not in ran | files}


def files_of(names: Iterable[str]) -> list[str]:
    """The files that hold these tests; none of ours stands in a class."""
    return sorted({name.partition("::")[0].replace(".", "/") + ".py" for name in names})


if __name__ == "__main__":
    if sys.argv[1] == "--files":
        print(*files_of(judge(sys.argv[2:])[1]))
        sys.exit()
    some_ran, none_ran = judge(sys.argv[1:])
    for test, why in sorted(none_ran.items()):
        print(f"ran in no pass: {test}: {why}")
    print(f"{len(some_ran)} ran, {len(none_ran)} did not")
    sys.exit(bool(none_ran) or not some_ran)
