"""A description as TOML text for people who will edit it: what every key means stands beside it, once."""

from __future__ import annotations

import json
from typing import Any

from robots.schema.description import ModelDescription
from robots.schema.key_words import KEY_WORDS

SCHEMA_FILE = "stiffarm-model.schema.json"
# Tables of the file by the class that they are.
_CLASSES = {
    "joint": "Joint",
    "flange": "Flange",
    "tool": "Tool",
    "base": "PlaceStiffness",
    "load": "LoadPlacement",
    "link": "Link",
    "parallelogram": "ParallelogramBar",
    "coupling": "Coupling",
    "controller": "Controller",
    "effect": "EffectTable",
}
_LISTS = ("joint", "link", "coupling", "effect")
_K = '{ value = 1.4e6, unit = "N m/rad", source = "assumed" }'
_FIGURE = '{{ value = {}, unit = "{}", source = "assumed" }}'
# What an absent key looks like, for those that are wanted most.
_EXAMPLES = {
    ("Joint", "stiffness"): _K,
    ("Joint", "tilt_stiffness"): _K,
    ("Joint", "sign"): "-1",
    ("Joint", "offset"): _FIGURE.format(-90, "deg"),
    ("Joint", "zero_error"): _FIGURE.format(0.05, "deg"),
    ("Joint", "bearing"): f"{{ rx = {_K}, ry = {_K} }}",
    ("Flange", "rpy"): _FIGURE.format("[0, 90, 0]", "deg"),
    ("Tool", "xyz"): _FIGURE.format("[0, 0, 250]", "mm"),
    ("Tool", "rpy"): _FIGURE.format("[0, 0, 0]", "deg"),
    ("PlaceStiffness", "rx"): _K,
    ("PlaceStiffness", "ry"): _K,
    ("Coupling", "name"): '"forearm_deg"',
    ("Coupling", "terms"): '[{ coordinate = "q2_deg", factor = 1 }, { coordinate = "q3_deg", factor = 1 }]',
    ("Coupling", "limits"): _FIGURE.format("[-60, 70]", "deg"),
    ("Controller", "axes"): '["J1_deg", "J2_deg", "J3_deg", "J4_deg", "J5_deg", "J6_deg"]',
    ("Controller", "angle"): '[{ coordinate = "q3_deg", '
    'terms = [{ axis = "J2_deg", factor = 1 }, { axis = "J3_deg", factor = 1 }] }]',
    ("Controller", "formats"): '["krl"]',
    ("Controller", "base"): "{ xyz = " + _FIGURE.format("[0, 0, 670]", "mm") + " }",
    ("ModelDescription", "mass"): _FIGURE.format(1000, "kg"),
    ("ModelDescription", "payload"): _FIGURE.format(165, "kg"),
    ("ModelDescription", "beam_radius"): _FIGURE.format(80, "mm"),
    ("ModelDescription", "notes"): '["A sentence."]',
    ("ModelDescription", "load_path"): '"serial"',
    ("EffectTable", "code"): '"backlash:j2"',
    ("EffectTable", "parameters"): "{ gap = " + _FIGURE.format(0.3, "mrad") + " }",
}


def commented_toml(description: ModelDescription) -> str:
    """The description as TOML with comments; reading it back gives the same description."""
    data = description.model_dump(mode="json", by_alias=True, exclude_none=True, exclude_defaults=True)
    data = {"schema": description.schema_version} | data
    top = KEY_WORDS["ModelDescription"]
    lines = [
        f"#:schema ./{SCHEMA_FILE}",
        "# Every figure is { value, unit, source }; source is a key of [sources], or assumed, derived or definition.",
        "# Lines that begin with # are comments: remove the # of a key to use it.",
        "",
    ]
    plain = ("schema", "name", "title", "notes", "load_path", "mass", "payload", "beam_radius")
    for key in plain:
        lines += _line("ModelDescription", key, data, explained=True)
    for key in [k for k in data if k not in plain]:
        value = data[key]
        if key in _LISTS:
            for i, table in enumerate(value):
                lines += [
                    "",
                    *([f"# {top[key]}"] if i == 0 else []),
                    f"[[{key}]]",
                    *_table(key, table, explained=i == 0),
                ]
        else:
            lines += ["", f"# {top[key]}", f"[{key}]", *_table(key, value, explained=True)]
    lines += ["", "# --- What else a model file can hold ---"]
    for key, words in top.items():
        if key not in data and key not in plain and key not in ("calibration", "positions"):
            opening = f"[[{key}]]" if key in _LISTS else f"[{key}]"
            lines += ["", f"# {words}", f"# {opening}", *_table(key, {}, explained=True)]
    return "\n".join(lines) + "\n"


def _table(key: str, table: dict[str, Any], *, explained: bool) -> list[str]:
    """Lines of one table: what it has, and where it is ``explained`` what it could have."""
    kind = _CLASSES.get(key)
    if kind is None:
        return [f"{_key(name)} = {_inline(value)}" for name, value in table.items()]
    given = [name for name in KEY_WORDS[kind] if name in table]
    absent = [name for name in KEY_WORDS[kind] if name not in table] if explained else []
    if kind == "Joint" and given:
        absent = [name for name in absent if name not in ("dh", "frame")]
    return [line for name in (*given, *absent) for line in _line(kind, name, table, explained=explained)]


def _line(kind: str, key: str, table: dict[str, Any], *, explained: bool) -> list[str]:
    words = [f"# {key}: {KEY_WORDS[kind][key]}"] if explained else []
    if key in table:
        return [*words, f"{_key(key)} = {_inline(table[key])}"]
    example = _EXAMPLES.get((kind, key))
    return [*words, *([f"# {key} = {example}"] if example else [])]


def _key(name: str) -> str:
    return name if name.replace("-", "").replace("_", "").isalnum() and name.isascii() else json.dumps(name)


def _inline(value: Any) -> str:
    """A value on one line, as TOML has it."""
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{_key(name)} = {_inline(each)}" for name, each in value.items()) + " }"
    if isinstance(value, list):
        return "[" + ", ".join(map(_inline, value)) + "]"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float) and value == int(value) and abs(value) < 1e15:
        return str(int(value)) if abs(value) < 1e6 else repr(value)
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f") if isinstance(value, str) else repr(value)
