"""Names and texts of a surrogate inside source files: identifiers, comments and strings that nothing breaks out of."""

from __future__ import annotations

import math
import re
import textwrap
import unicodedata

import numpy as np

from surrogate.portable.content import SCHEMA, Portable, Status

# Characters that an identifier keeps; C99 compilers tell at least 63 apart, prefixes of ours included.
_LONGEST_NAME = 40
_COMMENT_WIDTH = 110
_SPELLED = str.maketrans({"µ": "u", "μ": "u", "°": " deg", "·": "*", "×": "x", "–": "-", "—": "-"})


def plain(text: str) -> str:
    """One line of printable ASCII without backslashes; other characters become their nearest, or '?'."""
    decomposed = unicodedata.normalize("NFKD", text.translate(_SPELLED))
    bare = "".join(c for c in decomposed if not unicodedata.combining(c))
    kept = "".join(c if c.isspace() or (" " <= c <= "~" and c != "\\") else "?" for c in bare)
    return re.sub(r"\s+", " ", kept).strip()


def identifier(text: str) -> str:
    """A name that starts with a letter and is reserved in neither C, C++ nor Python once something follows it."""
    name = re.sub(r"[^A-Za-z0-9]+", "_", plain(text)).strip("_")
    if not name or not name[0].isalpha():
        name = f"surrogate_{name}".rstrip("_")
    return name[:_LONGEST_NAME].rstrip("_")


def with_unit(quantity: str, unit: str) -> str:
    """'compliance', 'm/N' -> 'compliance_m_per_N'."""
    spelled = re.sub(r"\s*/\s*", "_per_", plain(unit))
    return "_".join(part for part in (identifier(quantity), re.sub(r"[^A-Za-z0-9]+", "_", spelled).strip("_")) if part)


def number(value: float) -> str:
    """A number in C and Python that reads back as the same bits; finite numbers only."""
    if not math.isfinite(value):
        raise ValueError(value)
    text = repr(float(value))
    return text if any(c in text for c in ".e") else f"{text}.0"


def comment(text: str) -> list[str]:
    """Lines for a C block comment or Python comments, within the width."""
    # Comment marks are drawn apart, and so are the trigraphs that C99 knows.
    apart = plain(text).replace("*/", "* /").replace("/*", "/ *")
    while "??" in apart:
        apart = apart.replace("??", "? ?")
    return textwrap.wrap(apart, _COMMENT_WIDTH, subsequent_indent="  ", break_on_hyphens=False) or [""]


def string(text: str) -> str:
    """A string literal in double quotes, for C and Python."""
    apart = plain(text).replace('"', "'")
    while "??" in apart:
        apart = apart.replace("??", "? ?")
    return f'"{apart}"'


def provenance(p: Portable) -> list[str]:
    """What a reader must know, as comment lines."""
    size = "a number" if p.n_values == 1 else f"{' x '.join(map(str, p.shape))} numbers"
    texts = [
        f"{p.name}: {p.quantity} in {p.unit} of the robot {p.robot}, {size} at each pose.",
        f"Surrogate of the model with hash {p.model_hash}; written by stiffarm as {SCHEMA}.",
        "",
        "Inputs, in this order, in radians even where a name says deg; the ranges where it holds:",
        *(
            f"  {i}: {name}: {_range(low, high)}"
            for i, (name, low, high) in enumerate(zip(p.inputs, p.lower, p.upper, strict=True))
        ),
    ]
    c = p.couplings
    if c.names:
        texts.append("Sums of inputs that must hold besides:")
        texts += [
            f"  {name}: {_sum(row, p.inputs)}: {_range(low, high)}"
            for name, row, low, high in zip(c.names, c.matrix, c.lower, c.upper, strict=True)
        ]
    if p.fixed_deg:
        texts.append("Coordinates that were kept at one value, and must stand there:")
        texts += [f"  {name}: {value:.10g} deg" for name, value in p.fixed_deg.items()]
    if p.errors:
        texts += ["", "Errors against model runs that were kept out of the fit:"]
        texts += [f"  {name}: {value:.4g}" for name, value in p.errors.items()]
    texts += [*p.notes, ""]
    texts += [f"Status {int(s)}: {_STATUS[s]}" for s in Status]
    return [line for text in texts for line in _indented(text)]


_STATUS = {
    Status.OK: "there is a value.",
    Status.OUTSIDE_DOMAIN: "an angle is outside of its range.",
    Status.COUPLINGS_BROKEN: "a sum of angles is outside of its range: the pose cannot be reached.",
    Status.NOT_FINITE: "an angle or a value is not a finite number.",
}


def _indented(text: str) -> list[str]:
    indent = "  " if text.startswith("  ") else ""
    return [f"{indent}{line}".rstrip() for line in comment(text)]


def _range(low: float, high: float) -> str:
    low_deg, high_deg = np.degrees([low, high])
    return f"{low_deg:.10g} to {high_deg:.10g} deg ({low:.10g} to {high:.10g} rad)"


def _sum(row: np.ndarray, names: tuple[str, ...]) -> str:
    return " ".join(f"{f:+.10g} {n}" for f, n in zip(row, names, strict=True) if f != 0.0) or "0"
