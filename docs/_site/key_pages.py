"""The reference of a model file's keys, read from the classes that check it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pages

INTRODUCTION = """# Keys of a model file

Every key that a [model file](../model_file.md) can hold, read from the classes that check it. `stiffarm new` writes a
file with the same explanations beside its keys, and a JSON schema that editors complete and check by. Keys in **bold**
must be there.
"""


def write(folder: Path) -> None:
    """Write ``index.md`` into the folder."""
    from robots.schema.key_words import KEY_WORDS, json_schema

    schema = json_schema()
    tables = {"ModelDescription": schema, **schema["$defs"]}
    lines = [INTRODUCTION]
    for name in KEY_WORDS:
        lines += section(name, tables[name])
    lines += ["## Quantities", "", "A figure is `{ value, unit, source }`, with a `note` if you like. Units:", ""]
    for name, table in sorted(tables.items()):
        units = table["properties"].get("unit", {}).get("enum") if name not in KEY_WORDS else None
        if units:
            lines.append(f"- {name}: {', '.join(f'`{unit}`' for unit in units)}")
    pages.write_all(folder, {"index.md": "\n".join(lines) + "\n"})


def section(name: str, table: dict[str, Any]) -> list[str]:
    """One table with its keys."""
    heading = "The file" if name == "ModelDescription" else name
    needed = set(table.get("required", ()))
    rows = [
        f"| {f'**`{key}`**' if key in needed else f'`{key}`'} | {kind(entry)} | {entry['description']} |"
        for key, entry in table["properties"].items()
    ]
    return [f"## {heading}", "", "| key | holds | meaning |", "|---|---|---|", *rows, ""]


def kind(entry: dict[str, Any]) -> str:
    """What a key holds, in words."""
    if "$ref" in entry:
        return entry["$ref"].rpartition("/")[2]
    if "const" in entry:
        return f"`{entry['const']}`"
    if "enum" in entry:
        return " or ".join(f"`{value}`" for value in entry["enum"])
    for choice in ("anyOf", "oneOf"):
        if choice in entry:
            kinds = dict.fromkeys(kind(each) for each in entry[choice] if each.get("type") != "null")
            return " or ".join(kinds)
    if entry.get("type") == "array":
        items = entry.get("items") or (entry.get("prefixItems") or [{}])[0]
        return f"list of {kind(items)}"
    if entry.get("type") == "object" and isinstance(entry.get("additionalProperties"), dict):
        return f"{kind(entry['additionalProperties'])} by name"
    return {"string": "text", "number": "number", "integer": "whole number"}.get(str(entry.get("type")), "table")
