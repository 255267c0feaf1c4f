"""Names every test that ran in no pass:  python3 .ci/each_test_ran.py PASS.xml ... (written by pytest --junitxml)."""

from __future__ import annotations

import sys
import xml.etree.ElementTree as ET


def outcomes(path: str) -> dict[str, str | None]:
    """Why each test of a pass did not run; None for those that did."""
    found: dict[str, str | None] = {}
    for case in ET.parse(path).iter("testcase"):  # noqa: S314 - written by our own pytest
        skipped = case.find("skipped")
        # What fails as expected has run.
        ran = skipped is None or skipped.get("type") == "pytest.xfail"
        module, name = case.get("classname", ""), case.get("name", "")
        found["::".join(filter(None, (module, name)))] = None if skipped is None or ran else skipped.get("message")
        if ran:
            found[module] = None  # A file that skips as a whole is named like this.
    return found


def main() -> None:
    """Exit 1 where a test ran in no pass, or there is none."""
    why: dict[str, str | None] = {}
    for path in sys.argv[1:]:
        for name, reason in outcomes(path).items():
            why[name] = None if reason is None else why.get(name, reason)
    never = {name: reason for name, reason in why.items() if reason is not None}
    for name, reason in sorted(never.items()):
        print(f"ran in no pass: {name}: {reason}")
    print(f"{len(why) - len(never)} ran, {len(never)} did not")
    sys.exit(bool(never) or not why)


main()
