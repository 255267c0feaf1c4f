"""The site as a browser shows it, and its search: what `make docs` built, where it did."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

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

# A question of docs/start/questions.md, the words that a user types, and the page that answers.
SEARCHED: Mapping[str, tuple[str, str]] = {}
HITS = 5
# How long the search may take; it looks words up in an index that is already loaded.
SECONDS = 20


def site_pages() -> list[str]:
    """All pages but the index of names and the search's own, which have no text of ours."""
    found = (page.relative_to(SITE).as_posix() for page in SITE.rglob("*.html") if "_static" not in page.parts)
    return sorted(set(found) - {"genindex.html", "search.html", "py-modindex.html"})


@pytest.fixture(scope="module")
def browser() -> Iterator[Tab]:
    with tab() as opened:
        yield opened


@pytest.mark.parametrize(("width", "scheme"), [(390, "light"), (1400, "dark"), (390, "dark"), (1400, "light")])
def test_no_page_of_the_site_stops_people(browser: Tab, width: int, scheme: Scheme) -> None:
    oracles.load("axe_core_python")
    pages, found = site_pages(), {}
    assert len(pages) > 60
    for name in pages:
        browser.faults.clear()
        browser.show(SITE / name, width, 844, scheme)
        faults = browser.grave() + browser.faults
        if (wide := seen(browser, "x")["wide"]) != width:
            faults.append(f"{wide} px wide")
        if faults:
            found[name] = faults
    assert found == {}
