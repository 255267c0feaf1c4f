"""Every kind of page as a browser shows and prints it, and every figure drawn for them.

The pages come from quick runs of the commands; among them an arm with 36 parameters and 43 loads.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import oracles
import pytest
from browser import needs_browser
from cli_runs import run_here
from devtools import Scheme, Tab, seen, tab
from drawn_figures import Drawn, faults, recorded
from shortened import few_runs, quick_diagnosis
from small_robot import write_readings, write_urdf
from urdf_arms import Arm

pytestmark = [pytest.mark.slow, needs_browser]

FREE_36 = ",".join(f"j{i}.{row}" for i in range(1, 7) for row in ("rx", "ry", "stiffness", "tx", "ty", "tz"))
COMMANDS: Mapping[str, tuple[str, ...]] = {
    "calibrate": ("calibrate", "xr701", "--scheme", "global"),
    "staged": ("calibrate", "xr701", "--scheme", "staged"),
    "many": ("calibrate", "fanuc-r2000ic", "--free", FREE_36),
    "simulate": ("simulate", "xr701"),
    "pose": ("simulate", "xr701", "--pose", "q2_deg=5,q3real_deg=77.5"),
    "sensitivity": ("sensitivity", "xr701"),
    "sobol": ("sensitivity", "xr701", "--method", "sobol", "--samples", "64"),
    "plan": ("plan", "xr701", "--poses", "2", "--candidates", "200"),
    "import": ("import", "URDF"),
    "identify": ("identify", "tx200", "--synthetic", "--seed", "3", "--law", "fourier-1"),
    "fit": ("fit", "calibrate/model.toml", "--runs", "1400"),
    "run": ("run", "SMALL", "READINGS", "--points", "5", "--no-rehearse"),
    "diagnose": ("diagnose", "SMALL", "READINGS"),
}
KINDS = [f"{name}/report.html" for name in COMMANDS] + ["run/index.html", "run/card.html"]
# What is folded on paper and should not be: all but detail of detail and the list of files. And what is too wide.
HIDDEN = (
    "[...document.querySelectorAll('details')].filter(d => !d.parentElement.closest('details, footer')"
    " && d.lastElementChild.getBoundingClientRect().height < 3)"
)
WIDE = "[...document.querySelectorAll('table, img')].filter(e => e.getBoundingClientRect().right > innerWidth + 1)"
# Pictures that hold a rendered arm.
SCENES = {"gap in space", "missing effect", "stiffness map, side view", "stiffness map, oblique view"}
MOST_WORDS = 1200
SCREEN = 900


@dataclass(frozen=True)
class Site:
    """The folders of all commands, and the figures that they drew."""

    root: Path
    figures: tuple[Drawn, ...]


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Site:
    root = tmp_path_factory.mktemp("site")
    urdf = write_urdf(root / "small.urdf")
    named = {
        "SMALL": urdf,
        "READINGS": write_readings(urdf, root / "readings.csv", poses=10),
        "URDF": Arm().write(root),
    }
    named["calibrate/model.toml"] = root / "calibrate" / "model.toml"
    with recorded() as figures, few_runs(), quick_diagnosis():
        for name, arguments in COMMANDS.items():
            outcome = run_here(*(named.get(word, word) for word in arguments), "--out", root / name)
            assert outcome.code == 0, (name, outcome.err)
    return Site(root, tuple(figures))


@pytest.fixture(scope="module")
def browser() -> Iterator[Tab]:
    with tab() as opened:
        yield opened


@pytest.mark.parametrize("kind", [*KINDS, "plan/measurement_sheet.html"])
@pytest.mark.parametrize(("width", "scheme"), [(390, "light"), (1400, "dark")])
def test_nothing_stops_people(site: Site, browser: Tab, kind: str, width: int, scheme: Scheme) -> None:
    oracles.load("axe_core_python")
    browser.show(site.root / kind, width, 844, scheme)
    assert browser.grave() == []
    assert browser.faults == []
    assert seen(browser, "x")["wide"] == width, "the page is wider than the window"


@pytest.mark.parametrize("kind", KINDS)
def test_print_unfolds_sections_and_cuts_no_table(site: Site, browser: Tab, kind: str) -> None:
    # A4 without its margins, in pixels.
    browser.show(site.root / kind, 703, 1032)
    browser.media("print")
    assert browser.run(f"{HIDDEN}.length") == 0
    assert browser.run(f"{WIDE}.map(e => e.innerText || e.alt)") == []
    pages = len(re.findall(rb"/Type\s*/Page\b", browser.pdf()))
    assert pages <= (1 if kind == "run/card.html" else 20)


def test_figures_are_dark_on_dark_pages_and_arms_keep_their_light(site: Site, browser: Tab) -> None:
    turned = "[...document.querySelectorAll('figure img')].map(i => [i.alt, getComputedStyle(i).filter])"
    for kind in ("run/report.html", "simulate/report.html"):
        browser.show(site.root / kind, scheme="light")
        assert {how for _, how in browser.run(turned)} == {"none"}
        browser.show(site.root / kind, scheme="dark")
        for name, how in browser.run(turned):
            assert ("invert" in how) != (name in SCENES or name.startswith("map of")), name


def test_titles_are_unique(site: Site) -> None:
    titles = {}
    for kind in KINDS:
        page = (site.root / kind).read_text(encoding="utf-8")
        (title,), (heading,) = (re.findall(rf"<{tag}>(.*?)</{tag}>", page) for tag in ("title", "h1"))
        assert title == heading
        # What the page asks, without the robot's name.
        titles[kind] = title.partition(": ")[2]
    alike = {kind for kind, title in titles.items() if list(titles.values()).count(title) > 1}
    # These are the same command with other options.
    assert alike == {f"{name}/report.html" for name in ("calibrate", "staged", "many", "sensitivity", "sobol")}


@pytest.mark.parametrize("kind", KINDS)
def test_every_file_that_is_named_is_a_link_that_exists(site: Site, browser: Tab, kind: str) -> None:
    folder = (site.root / kind).parent
    browser.show(site.root / kind)
    targets = browser.run("[...document.querySelectorAll('a')].map(a => a.getAttribute('href'))")
    inner = set(browser.run("[...document.querySelectorAll('[id]')].map(e => '#' + e.id)"))
    for target in targets:
        assert target in inner or (folder / target).exists(), target
    words = browser.run(
        "(() => { const out = [], walk = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);"
        " for (let n; (n = walk.nextNode()); ) if (!n.parentElement.closest('a')) out.push(n.data); return out; })()"
    )
    named = set(re.findall(r"(?<![\w./])[\w./-]+\.(?:json|csv|toml|html|png|vtu|vtp|vti)\b", " ".join(words)))
    given = json.dumps(json.loads((folder / "run.json").read_text(encoding="utf-8"))["command"]) + "next_readings.csv"
    # Tables that were read, and one that a reader may have.
    data = {"xr701_gotlih.csv", "fanuc_r2000ic.csv", "readings.csv", "poses.csv"}
    assert {
        one for one in named if not one.startswith(("docs/", "/")) and one not in data and one not in given
    } == set()


def test_the_run_answers_on_its_first_screen(site: Site, browser: Tab) -> None:
    browser.show(site.root / "run/report.html", 1400, SCREEN)
    of = seen(browser, r"\d N/mm")
    assert of["at"] < SCREEN
    interval = seen(browser, r"95\s%: [\d,.]+ to [\d,.]+ N/mm")
    assert interval["at"] < SCREEN
    assert of["words"] <= MOST_WORDS
    for said in ("How sure", "What to do next"):
        assert seen(browser, said)["at"] < SCREEN
    assert browser.run("document.querySelector('#picture img').getBoundingClientRect().bottom") < SCREEN


def test_the_index_leads_to_every_file(site: Site, browser: Tab) -> None:
    folder = site.root / "run"
    browser.show(folder / "index.html")
    targets = set(browser.run("[...document.querySelectorAll('a')].map(a => a.getAttribute('href'))"))
    files = {p.relative_to(folder).as_posix() for p in folder.rglob("*") if p.is_file()}
    assert files <= targets
    assert "map.html" in files


def test_figures_survive_any_arm(site: Site) -> None:
    assert len(site.figures) > 30
    assert faults(site.figures) == [], "\n".join(faults(site.figures))


def test_parameters_that_are_not_identified_share_a_line(site: Site) -> None:
    found: dict[str, Any] = json.loads((site.root / "many" / "calibration.json").read_text(encoding="utf-8"))
    assert found["count"]["free"] == 36
    page = (site.root / "many" / "report.html").read_text(encoding="utf-8")
    assert "determination" not in page
    assert "Estimates that move together most" in page
