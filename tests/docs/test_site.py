"""The built site: complete, without a broken link, and without anything that a browser would fetch from elsewhere."""

import os
import re
import subprocess
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest

ROOT = Path(__file__).parents[2]


class References(HTMLParser):
    """Links, what is fetched, and anchors of a page."""

    def __init__(self) -> None:
        super().__init__()
        self.links: list[str] = []
        self.fetched: list[str] = []
        self.anchors: set[str] = set()

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        values = {key: value for key, value in attributes if value is not None}
        self.anchors.update(values[key] for key in ("id", "name") if key in values)
        if tag == "a" and "href" in values:
            self.links.append(values["href"])
        elif tag == "link" and values.get("rel") not in ("canonical", "next", "prev"):
            self.fetched.append(values.get("href", ""))
        elif "src" in values:
            self.fetched.append(values["src"])


@pytest.fixture(scope="module")
def site() -> Path:
    """The site as `make docs` builds it."""
    done = subprocess.run(["make", "docs"], cwd=ROOT, capture_output=True, text=True, env=os.environ, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return ROOT / "site"


def pages(site: Path) -> Iterator[tuple[Path, References]]:
    """Our own pages; those of rustdoc are rustdoc's."""
    for path in sorted(site.rglob("*.html")):
        if path.relative_to(site).parts[0] != "rust":
            found = References()
            found.feed(path.read_text(encoding="utf-8"))
            yield path, found


def test_nothing_is_fetched_from_elsewhere(site: Path) -> None:
    for path, found in pages(site):
        remote = [reference for reference in found.fetched if urlsplit(reference).netloc]
        assert remote == [], path
    for sheet in site.rglob("*.css"):
        text = sheet.read_text(encoding="utf-8")
        assert not re.search(r"(url\(|@import)\s*['\"]?(https?:)?//", text), sheet


def test_every_link_leads_somewhere(site: Path) -> None:
    anchors = {path: found.anchors for path, found in pages(site)}
    broken = []
    for path, found in pages(site):
        for reference in [*found.links, *found.fetched]:
            parts = urlsplit(reference)
            if parts.scheme or parts.netloc or path.name == "404.html":
                continue
            target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            target = target / "index.html" if target.is_dir() else target
            if not target.is_file():
                broken.append(f"{path.relative_to(site)}: {reference}")
            elif parts.fragment and target in anchors and unquote(parts.fragment) not in anchors[target]:
                broken.append(f"{path.relative_to(site)}: {reference} has no such anchor")
    assert broken == []


def test_pictures_search_and_rustdoc_are_there(site: Path) -> None:
    scripts = [path.stem for path in (ROOT / "docs" / "figures").glob("[!_]*.py")]
    assert scripts and all((site / "pictures" / f"{name}.png").stat().st_size > 10_000 for name in scripts)
    assert "friction" in (site / "search" / "search_index.json").read_text(encoding="utf-8")
    assert (site / "rust" / "fg_core" / "index.html").is_file()


def test_every_picture_is_shown() -> None:
    text = "".join(path.read_text(encoding="utf-8") for path in (ROOT / "docs").rglob("*.md"))
    for script in (ROOT / "docs" / "figures").glob("[!_]*.py"):
        assert f"pictures/{script.stem}.png" in text, script
