"""The frame of every page: its title, the first screen, what folds away, and links to the files beside it."""

from __future__ import annotations

import re
from html.parser import HTMLParser
from pathlib import Path

from stiffarm.pages.files import listed
from stiffarm.pages.report import (
    Answer,
    Block,
    Bullets,
    Fold,
    KeyFigure,
    Note,
    Picture,
    Section,
    Table,
    Text,
    render,
    write_page,
)
from stiffarm.session.outputs import OutputFolder


def made(*blocks: Block, answer: Answer | None = None, files: tuple[str, ...] = ()) -> str:
    key = [KeyFigure("290 N/mm", "softest", "95 %: 230 to 330 N/mm")]
    return render("Arm", "lede", key, [Section("one", blocks)], "foot", "how stiff?", answer, files)


class Links(HTMLParser):
    """Where links lead, and which elements there are."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.targets: list[str] = []
        self.tags: list[str] = []
        self.feed(page)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        if tag == "a":
            self.targets.append(dict(attrs).get("href") or "")


def test_title_and_heading_say_what_is_asked() -> None:
    page = made(Text("x"))
    assert "<title>Arm: how stiff?</title>" in page
    assert "<h1>Arm: how stiff?</h1>" in page


def test_landmarks_and_a_way_past_the_head() -> None:
    seen = Links(made(Text("x")))
    assert {"header", "main", "nav", "footer"} <= set(seen.tags)
    assert seen.targets[0] == "#answer"


def test_the_first_screen_comes_before_all_sections() -> None:
    answer = Answer("quite", "measure more", None, ("joints are rigid",))
    page = made(Text("the story"), answer=answer)
    places = [
        page.index(text) for text in ("joints are rigid", "95 %: 230 to 330", "quite", "measure more", "the story")
    ]
    assert places == sorted(places)


def test_a_file_that_is_named_is_a_link_wherever_it_is_named() -> None:
    files = ("model.toml", "look/report.html", "look/gap.vtp", "figures/one.png")
    rows = (("model.toml", "of all"),)
    page = made(
        Text("See model.toml. Not other.toml, nor my-model.toml."),
        Note("All of it is in look/, its points in look/gap.vtp"),
        Bullets(("`stiffarm query model.toml`",)),
        Table("files", ("file", "what"), rows, (0, 1)),
        Table("typed", ("file", "what"), rows, (0, 1), code_columns=(0,)),
        files=files,
    )
    targets = [t for t in Links(page).targets if not t.startswith("#")]
    assert targets.count("model.toml") == 5, "four places and the list of all files"
    assert targets.count("look/report.html") == 2, "a folder leads to its page"
    assert targets.count("look/gap.vtp") == 2
    assert set(targets) <= set(files)
    assert "<code>stiffarm query <a href=" in page


def test_what_is_no_link_stays_text() -> None:
    page = made(Text("<b>model.toml</b>"), files=("model.toml",))
    assert "&lt;b&gt;<a href=" in page
    name = 'a"b.csv'
    assert 'href="a"b' not in made(Text(name), files=(name, "b.csv"))


def test_pages_lead_to_files_written_after_them(tmp_path: Path) -> None:
    with OutputFolder(tmp_path / "out", ["x"], {}, None) as folder:
        write_page(folder, "Arm", "See late.csv and run.json.", (), (), "why?")
        folder.write_text("late.csv", "1")
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    targets = [t for t in Links(page).targets if not t.startswith("#")]
    assert {"late.csv", "run.json"} <= set(targets)
    for target in targets:
        assert (tmp_path / "out" / target).is_file(), target


def test_pages_come_first_in_the_list_of_files() -> None:
    names = [
        name for name, _ in listed(("a.csv", "figures/x.png", "run.json", "report.html", "index.html", "m/a.toml"))
    ]
    assert names == ["index.html", "report.html", "run.json", "a.csv", "m/a.toml"]


def test_folds_hold_blocks_and_folds() -> None:
    page = made(Fold("How", (Text("inner"), Fold("Deeper", (Text("innermost"),)))))
    assert re.search(
        r"<details><summary>How</summary>.*inner.*<details><summary>Deeper</summary>.*innermost", page, re.S
    )
    assert page.count("<details") == page.count("</details>") == 2


def test_a_picture_has_its_size_so_that_nothing_jumps(tmp_path: Path) -> None:
    from stiffarm.pages.style import new_figure, save_png

    figure, _ = new_figure("wide")
    save_png(figure, tmp_path / "p.png")
    one = Picture(tmp_path / "p.png", "caption", "words")
    page = made(one, Fold("more", (one, Fold("deeper", (one,)))), answer=Answer(picture=one))
    assert 'width="1080" height="475"' in page
    ids = re.findall(r'\bid="([^"]+)"', page)
    assert len(set(ids)) == len(ids)
    assert {t[1:] for t in Links(page).targets if t.startswith("#")} <= set(ids)
