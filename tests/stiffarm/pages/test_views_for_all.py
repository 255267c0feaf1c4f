"""The map's page and the replay in a browser: wide and narrow, light and dark, nothing that stops people."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import oracles
import pytest
from browser import needs_browser
from devtools import Scheme, Tab, seen, tab
from verify_cases import verified
from viewer_maps import arm, kr60_slice, xr701_sweep

from stiffarm.commands.maps.viewer import viewer_page
from stiffarm.commands.verify.replay import replay_page

pytestmark = [pytest.mark.slow, needs_browser]


@pytest.fixture(scope="module")
def views(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("views")
    pages = {
        "joints": viewer_page(xr701_sweep(), *arm("xr701"), title="xr701"),
        "slice": viewer_page(kr60_slice(), *arm("kr60-3"), title="kr60-3"),
        "replay": replay_page(verified(folder), "a program"),
    }
    files = {name: folder / f"{name}.html" for name in pages}
    for name, page in pages.items():
        files[name].write_text(page, encoding="utf-8")
    return files


@pytest.fixture(scope="module")
def browser() -> Iterator[Tab]:
    with tab() as opened:
        yield opened


@pytest.mark.parametrize("name", ["joints", "slice", "replay"])
@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [1400, 390])
def test_no_view_stops_people(views: dict[str, Path], browser: Tab, name: str, width: int, scheme: Scheme) -> None:
    oracles.load("axe_core_python")
    browser.faults.clear()
    browser.show(views[name], width, 844, scheme)
    assert browser.grave() == []
    assert browser.own_faults() == []
    assert seen(browser, "x")["wide"] == width, "the page is wider than the window"
