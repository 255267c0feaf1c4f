"""The site as a browser shows it, and its search: what `make docs` built, where it did."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping, Sequence

import oracles
import pytest
from browser import needs_browser
from cli_runs import ROOT
from devtools import Scheme, Tab, seen, tab

SITE = ROOT / "build" / "site"
pytestmark = [
    pytest.mark.slow,
    needs_browser,
    pytest.mark.skipif(not (SITE / "searchindex.js").is_file(), reason="no site here: `make docs` builds it"),
]

# Of each question of docs/start/questions.md the words that a user types and the page that the search has to lead to.
SEARCHED: Mapping[str, tuple[str, str]] = {
    "My robot is a FANUC (KUKA, ABB, Staubli, UR). Is it here?": ("robot is fanuc", "how-to/new_arm"),
    "What do I need to measure with?": ("dial gauge laser tracker instrument", "how-to/read_readings"),
    "How many poses do I need, and which?": ("how many poses", "how-to/plan"),
    "Would my measurement show backlash at all?": ("backlash measurement show", "how-to/rehearse"),
    "Should I load up and down? How often should I repeat?": ("repeat readings noise", "how-to/calibrate"),
    "Why does it refuse my table?": ("refused table column", "reference/measurement_table"),
    "Is my calibration good?": ("calibration good", "how-to/calibrate"),
    "What if a joint is not observable?": ("not identified", "concepts/uncertainty"),
    'Why is a spring "at its bound"?': ("spring at its bound", "how-to/calibrate"),
    "Why did it stop after one iteration?": ("one iteration linear", "concepts/mechanics"),
    "Why do two springs trade off against each other?": ("pairs trade off parameters", "how-to/plan"),
    "Which parameters matter most?": ("which parameters matter", "how-to/calibrate"),
    "Can the stiffness of a joint depend on its angle?": ("stiffness depends on angle", "how-to/calibrate"),
    "Can I calibrate geometry and stiffness together?": ("calibrate geometry", "how-to/positions"),
    "Can I use readings of another year, or of another robot of the same type?": (
        "compare two calibrations",
        "how-to/compare",
    ),
    "My model says something else than my gauge. Why?": ("model disagrees gauge", "how-to/diagnose"),
    "How often is the name right?": ("how often diagnosis right", "validation/diagnosis_study"),
    'What does "unknown" mean?': ("unknown effect", "concepts/diagnosis"),
    'It says "nothing missing", but the error is large. How?': ("nothing missing scatter", "how-to/calibrate"),
    "How do I add an effect that you do not have?": ("write own effect", "how-to/own_effect"),
    "Can I start from a URDF or an STL?": ("urdf stl import", "how-to/shells"),
    "Does it agree with my finite element program?": ("calculix finite element", "validation/calculix"),
    "How do I see the map in ParaView?": ("paraview map", "how-to/maps"),
    "How fast can I ask for the stiffness of a pose?": ("surrogate speed million poses", "how-to/surrogate"),
    "Why is my map blank in places?": ("map blank reach", "how-to/maps"),
    "Where should I put the part?": ("where to put the part", "how-to/place"),
    "Which way should I turn the tool about its axis (gamma)?": ("gamma tool axis", "concepts/gamma"),
    "Does it read my CAM system's files?": ("heidenhain apt g-code", "how-to/operations"),
    "My path has several tools. Can I post it as one program?": ("several tools", "how-to/operations"),
    "How do I know that the program is safe to run?": ("verify a program", "how-to/verify"),
    "Can it correct the path for the deflection?": ("compensate deflection", "how-to/positions"),
}
HITS = 5
QUESTIONS = ROOT / "docs" / "start" / "questions.md"


def site_pages() -> list[str]:
    """All pages but the index of names and the search's own, which have no text of ours."""
    found = (page.relative_to(SITE).as_posix() for page in SITE.rglob("*.html") if "_static" not in page.parts)
    return sorted(set(found) - {"genindex.html", "search.html", "py-modindex.html"})


@pytest.fixture(scope="module")
def browser() -> Iterator[Tab]:
    with tab() as opened:
        yield opened


def what_stops(browser: Tab, pages: Sequence[str], width: int, scheme: Scheme) -> dict[str, list[str]]:
    """Grave findings of axe, errors on the console and what is wider than the window, by page."""
    found = {}
    for name in pages:
        browser.faults.clear()
        browser.show(SITE / name, width, 844, scheme)
        faults = browser.grave() + browser.faults
        if (wide := seen(browser, "x")["wide"]) != width:
            faults.append(f"{wide} px wide")
        if faults:
            found[name] = faults
    return found


@pytest.mark.parametrize(("width", "scheme"), [(390, "light"), (1400, "dark")])
def test_no_page_of_the_site_stops_people(browser: Tab, width: int, scheme: Scheme) -> None:
    oracles.load("axe_core_python")
    pages = site_pages()
    assert len(pages) > 60
    assert what_stops(browser, pages, width, scheme) == {}


# Four minutes would go into all pages twice more: one of each kind stands for what width and scheme do together.
@pytest.mark.parametrize(("width", "scheme"), [(390, "dark"), (1400, "light")])
def test_the_other_way_round_no_kind_of_page_stops_people(browser: Tab, width: int, scheme: Scheme) -> None:
    oracles.load("axe_core_python")
    by_folder = {name.rpartition("/")[0]: name for name in site_pages()}
    assert len(by_folder) > 8
    assert what_stops(browser, list(by_folder.values()), width, scheme) == {}


@pytest.mark.parametrize("question", SEARCHED)
def test_the_search_leads_to_the_page_that_answers(browser: Tab, question: str) -> None:
    """Among the first hits, each page counted once."""
    typed, answer = SEARCHED[question]
    browser.show(SITE / "search.html")
    hits = browser.run(
        f"Search._performSearch(...Search._parseQuery({json.dumps(typed)})).map(hit => hit[0]).reverse()"
    )
    assert answer in list(dict.fromkeys(hits))[:HITS]


def test_each_question_is_searched_and_its_answer_links_to_the_page() -> None:
    parts = re.split(r"^### (.*)$", QUESTIONS.read_text(encoding="utf-8"), flags=re.MULTILINE)[1:]
    answers = dict(zip(parts[::2], parts[1::2], strict=True))
    assert set(SEARCHED) == set(answers)
    unlinked = [
        question
        for question, (_, page) in SEARCHED.items()
        if f"({'' if page.startswith('start/') else '../'}{page.removeprefix('start/')}.md" not in answers[question]
    ]
    assert unlinked == []
