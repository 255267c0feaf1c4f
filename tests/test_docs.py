"""The pages that users read: each is in the site, what they refer to exists, and README is short."""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from test_house import LAYERS, ROOT

from stiffarm.cli import COMMANDS, command_of

DOCS = ROOT / "docs"
# Written by the build (docs/conf.py).
GENERATED = (
    *(DOCS / "reference" / name for name in ("commands", "failures", "keys", "python")),
    DOCS / "gallery" / "scripts",
)
LONGEST_README = 90
FENCE = re.compile(r"^(`{3,}|~{3,}).*?^\1", re.MULTILINE | re.DOTALL)
FENCE_BODY = re.compile(r"^ *```\w*\n(.*?)^ *```", re.MULTILINE | re.DOTALL)
LINK = re.compile(r"!?\[[^\]]*\]\(([^)\s]+)\)")
PICTURE = re.compile(r"!\[([^\]]*)\]\(([^)\s]+)\)")
TOCTREE = re.compile(r"^```\{toctree\}\n(.*?)^```", re.MULTILINE | re.DOTALL)
# A file of this tree as texts name it, beginning with one of its folders.
MENTIONED = re.compile(
    rf"(?<![\w/.-])((?:{'|'.join([*LAYERS, 'docs', 'tests', 'benchmarks'])})/[\w/.-]*\.(?:md|py|toml|csv|png))"
)


def pages() -> list[Path]:
    return sorted(page for page in DOCS.rglob("*.md") if not any(folder in page.parents for folder in GENERATED))


def links(text: str) -> Iterator[tuple[str, str]]:
    """File and heading that each link leads to, those to other hosts left out."""
    for target in LINK.findall(FENCE.sub("", text)):
        if not re.match(r"[a-z]+:", target):
            path, _, heading = target.partition("#")
            yield path, heading


def anchors(page: Path) -> set[str]:
    """Headings as links name them."""
    titles = re.findall(r"^#+ (.+)$", FENCE.sub("", page.read_text(encoding="utf-8")), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-") for title in titles}


def broken_links(page: Path) -> list[str]:
    found = []
    for path, heading in links(page.read_text(encoding="utf-8")):
        target = (page.parent / path).resolve() if path else page
        generated = any(folder in target.parents for folder in GENERATED)
        if not (target.is_file() or generated) or (heading and heading not in anchors(target)):
            found.append(f"{path}#{heading}" if heading else path)
    return found


def listed(page: Path) -> set[Path]:
    """Pages in the tables of contents of a page."""
    entries = [line for block in TOCTREE.findall(page.read_text(encoding="utf-8")) for line in block.splitlines()]
    return {(page.parent / f"{entry}.md").resolve() for entry in entries if entry and not entry.startswith(":")}


def test_readme_is_short_and_opens_with_the_two_commands() -> None:
    lines = (ROOT / "README.md").read_text(encoding="utf-8").splitlines()
    assert len(lines) <= LONGEST_README
    block = lines.index("```sh")
    assert block < 6
    assert [line.split("#")[0].strip() for line in lines[block + 1 : block + 3]] == ["make run", "make test"]


@pytest.mark.parametrize("page", [ROOT / "README.md", *pages()], ids=lambda p: str(p.relative_to(ROOT)))
def test_links_lead_somewhere(page: Path) -> None:
    assert broken_links(page) == []


@pytest.mark.parametrize("page", [ROOT / "README.md", *pages()], ids=lambda p: str(p.relative_to(ROOT)))
def test_pictures_have_alternative_text(page: Path) -> None:
    """What the site makes of it, axe judges (tests/stiffarm/pages/test_site.py)."""
    text = FENCE.sub("", page.read_text(encoding="utf-8"))
    assert [target for alt, target in PICTURE.findall(text) if len(alt.split()) < 2] == []


def test_a_link_that_leads_nowhere_is_found(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text("# One\n[a](gone.md) [b](page.md#one) [c](#two)\n```\n[d](code.md)\n```\n", encoding="utf-8")
    assert broken_links(page) == ["gone.md", "#two"]


def test_each_page_is_in_the_site() -> None:
    reached: set[Path] = set()
    waiting = {DOCS / "index.md"}
    while waiting:
        page = waiting.pop()
        reached.add(page)
        # What the build writes is listed before it is there.
        waiting |= {below for below in listed(page) if below.is_file()} - reached
    assert set(pages()) - reached == set()


@pytest.mark.parametrize("page", pages(), ids=lambda p: str(p.relative_to(DOCS)))
def test_a_page_listed_exists(page: Path) -> None:
    missing = {below for below in listed(page) if not below.is_file()}
    assert {below for below in missing if not any(folder in below.parents for folder in GENERATED)} == set()


def test_files_that_texts_mention_exist() -> None:
    """Pages, README, CHANGELOG and the comments of the code name files of this tree."""
    texts = [ROOT / "README.md", ROOT / "CHANGELOG.md", *pages()]
    texts += [path for folder in (*LAYERS, "tests", "benchmarks") for path in (ROOT / folder).rglob("*.py")]
    missing = {
        f"{path.relative_to(ROOT)}: {file}"
        for path in texts
        for file in MENTIONED.findall(path.read_text(encoding="utf-8"))
        if not (ROOT / file).exists()
    }
    assert missing == set()


def typed_commands(text: str) -> list[list[str]]:
    """Commands of ``stiffarm`` in a page's examples, as words."""
    lines = "\n".join(FENCE_BODY.findall(text)).replace("\\\n", " ").splitlines()
    return [line.split("#")[0].split()[1:] for line in lines if line.strip().startswith("stiffarm ")]


def unknown_words(words: list[str]) -> list[str]:
    """What of a typed command the command line does not know: the command, or options."""
    if words[0] not in COMMANDS:
        return words[:1]
    command, rest = command_of(words[0]), words[1:]
    if below := getattr(command, "commands", {}):
        if words[0] == "robots" and (not rest or rest[0] not in below):
            rest = ["show", *rest]  # as the command itself takes it
        if not rest or rest[0] not in below:
            return rest[:1] or words[:1]
        command = below[rest[0]]
    known = {name for parameter in command.params for name in (*parameter.opts, *parameter.secondary_opts)}
    return [word for word in rest if word.startswith("--") and word not in known | {"--help"}]


@pytest.mark.parametrize("page", [ROOT / "README.md", *pages()], ids=lambda p: str(p.relative_to(ROOT)))
def test_commands_that_pages_show_exist(page: Path) -> None:
    typed = typed_commands(page.read_text(encoding="utf-8"))
    assert {" ".join(words): bad for words in typed if (bad := unknown_words(words))} == {}


def test_the_page_of_commands_shows_each() -> None:
    typed = typed_commands((DOCS / "start" / "commands.md").read_text(encoding="utf-8"))
    assert {words[0] for words in typed} == set(COMMANDS)


def test_a_command_that_does_not_exist_is_found() -> None:
    page = "```sh\nstiffarm plan xr701 --poses 3 \\\n  --posse 4\nstiffarm mapp xr701\nstiffarm map xr701\n```\n"
    assert [unknown_words(words) for words in typed_commands(page)] == [["--posse"], ["mapp"], ["xr701"]]


@pytest.mark.parametrize("page", sorted((DOCS / "decisions").glob("[!i]*.md")), ids=lambda p: p.stem)
def test_decisions_stand_under_their_day(page: Path) -> None:
    """Newest last; each paragraph begins with its decision in bold, or goes on with the one before."""
    lines = page.read_text(encoding="utf-8").splitlines()
    days = [line for line in lines if line.startswith("#")][1:]
    assert days
    assert all(re.fullmatch(r"## \d{4}-\d\d-\d\d", day) for day in days)
    assert days == sorted(set(days))
    first = [lines[k + 2] for k, line in enumerate(lines) if line in days]
    assert all(line.startswith("**") for line in first)


@pytest.mark.slow
def test_the_first_page_of_python_runs_as_it_stands(tmp_path: Path) -> None:
    blocks = re.findall(
        r"^```python\n(.*?)^```", (DOCS / "start" / "python.md").read_text(encoding="utf-8"), re.M | re.S
    )
    assert len(blocks) == 2
    for block in blocks:
        run = subprocess.run(  # noqa: S603 - a page of our own
            [sys.executable, "-c", block], cwd=tmp_path, capture_output=True, encoding="utf-8", check=False
        )
        assert run.returncode == 0, run.stderr
    assert (tmp_path / "calibrated.toml").is_file()


def test_the_files_of_an_own_effect_are_those_of_its_page() -> None:
    text = (DOCS / "how-to" / "own_effect.md").read_text(encoding="utf-8")
    folder = DOCS / "examples" / "own_effect"
    for kind, name in (("python", "flange.py"), ("toml", "effect.toml")):
        block = re.search(rf"^```{kind}\n(.*?)^```", text, re.M | re.S)
        assert block
        assert block[1].strip() == (folder / name).read_text(encoding="utf-8").strip()


def test_the_citation_is_that_of_this_version() -> None:
    """As GitHub and Zenodo read it (Citation File Format 1.2.0): what they need is there, and the version is ours."""
    import tomllib

    yaml = pytest.importorskip("yaml")
    cited = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert {"cff-version", "message", "title", "authors", "version", "license"} <= set(cited)
    assert cited["cff-version"] == "1.2.0"
    assert (cited["version"], cited["license"]) == (project["version"], project["license"])
    assert all({"type", "title", "authors"} <= set(reference) for reference in cited["references"])


def test_the_page_for_language_models_names_pages_that_are_there() -> None:
    """A heading, a summary, and lists of links (llmstxt.org); each to a file of this tree."""
    text = (ROOT / "llms.txt").read_text(encoding="utf-8")
    lines = [line for line in text.splitlines() if line]
    assert lines[0].startswith("# ")
    assert lines[1].startswith("> ")
    links = LINK.findall(text)
    assert len(links) > 15
    assert [link for link in links if not (ROOT / link).is_file()] == []


def test_answers_to_questions_say_what_the_pages_behind_them_say() -> None:
    """Figures of the page of questions are those of the pages that it leads to, rounded."""
    questions = (DOCS / "start" / "questions.md").read_text(encoding="utf-8")
    assert len(re.findall(r"^### .*\?$", questions, re.MULTILINE)) >= 30
    study = (DOCS / "validation" / "diagnosis_study.md").read_text(encoding="utf-8")
    family = re.search(r"the right family leads in \d+ \(([\d.]+) %\)", study)
    wrong = re.search(r"A wrong name was given in \d+ \(([\d.]+) %\)", study)
    assert family
    assert wrong
    said = " ".join(questions.split())
    assert f"the right kind of effect ranks first in {float(family[1]):.0f} % of the sets" in said
    assert f"a wrong name is given in {float(wrong[1]):.0f} % of all sets" in said
