"""report.html of a diagnosis: what disagrees, where, what explains it, how sure, what cannot be told, what next."""

from __future__ import annotations

from doe.diagnosis.where import noise_floor_mm
from stiffarm.commands.diagnose import words
from stiffarm.commands.diagnose.sections import (
    explained,
    how,
    in_short,
    laws,
    next_readings,
    not_told,
    shrunk,
    where,
)
from stiffarm.commands.diagnose.step import Diagnosed
from stiffarm.pages.blocks import Pictures
from stiffarm.pages.report import KeyFigure, data_words, write_page
from stiffarm.session.noise_words import floor_name
from stiffarm.session.outputs import OutputFolder

VERDICTS = {"named": "named", "ambiguous": "not settled", "unknown": "unknown effect", "none": "nothing missing",
            "uninformative": "readings tell nothing"}  # fmt: skip


def write_report(d: Diagnosed, folder: OutputFolder) -> None:
    """Draw all figures and write report.html."""
    pictures = Pictures(folder)
    sections = [in_short(d)]
    if d.tells:
        sections += [where(d, pictures), explained(d, pictures)]
    if d.in_model:
        sections.append(laws(d, pictures))
    sections.append(shrunk(d, pictures))
    if d.tells:
        sections += [not_told(d), next_readings(d), how(d)]
    title = d.given.description.title.split(" (")[0]
    p = d.found.before.setting.data
    lede = (
        f"Diagnosis of where simulation and measurement disagree: {len(p)} readings at {len(p.poses)} poses; "
        f"{d.given.model.link_kind} links, {d.given.model.load_path} load path; springs of "
        f"{', '.join(d.found.before.setting.free)} fitted."
    )
    write_page(folder, title, lede, _key_figures(d), sections, made_of=data_words(d.used))


def _key_figures(d: Diagnosed) -> list[KeyFigure]:
    found, h = d.found, d.held_out
    codes = ", ".join(f.code for f in found.effects)
    out = [
        KeyFigure(
            codes or ("nothing proven" if words.hints(d) else VERDICTS[found.verdict]),
            "verdict" if not codes else "what is missing",
        )
    ]
    far = (found.before.left_out_rms_mm, found.after.left_out_rms_mm)
    label = "RMS at poses left out one at a time"
    if h is not None:
        far, label = (h.rms_before_mm, h.rms_after_mm), f"RMS on {h.data.source}"
    if d.in_model:
        out.append(KeyFigure(f"{far[0]:.3f} → {far[1]:.3f} mm", f"{label}, before and after"))
    else:
        out.append(KeyFigure(f"{far[0]:.3f} mm", label))
    if d.tells:
        name = floor_name(found.after.setting.data)
        label = "RMS that noise alone would give" if name == "noise alone" else f"{name}, no repeats to tell the noise"
        out.append(KeyFigure(f"{noise_floor_mm(found):.3f} mm", label))
    if found.effects:
        out.append(KeyFigure(words.percent(min(f.probability for f in found.effects)), "probability of the name"))
    return out
