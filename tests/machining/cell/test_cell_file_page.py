"""The page of the cell file names every key that the file can have."""

from __future__ import annotations

import re
from pathlib import Path

from machining.cell.schema import CellFile

PAGE = Path(__file__).parents[3] / "docs" / "reference" / "cell_file.md"
# Where the controller's outputs stand.
COMMANDS = Path(__file__).parents[3] / "docs" / "how-to" / "operations.md"


def test_every_key_is_on_the_page() -> None:
    schema = CellFile.model_json_schema(by_alias=True)
    text = PAGE.read_text(encoding="utf-8")
    said = set(re.findall(r"[a-zA-Z_0-9]+", text))
    outputs = COMMANDS.read_text(encoding="utf-8")
    for name, table in {"CellFile": schema, **schema["$defs"]}.items():
        for key in table.get("properties", ()):
            assert key in said or (name == "CommandsTable" and key in outputs), f"{name}: {key}"
