"""The documentation names files that exist, and the site says where each page is."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGES = sorted([*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md"), *ROOT.glob("firmware/*.md")])
SOURCES = [
    path
    for folder in ("flightstack", "sim_bridge", "gcs_cli", "firmware", "tests", "tools", "benchmarks")
    for path in (ROOT / folder).rglob("*.*")
    if path.suffix in {".py", ".c", ".h", ".toml"}
]
_LINK = re.compile(r"\]\(([^)#:]+)(?:#[^)]*)?\)")
_PATH = re.compile(
    r"`((?:flightstack|sim_bridge|gcs_cli|firmware|tests|tools|benchmarks|missions|examples)/[\w./-]+)`"
)
_DOCS = re.compile(r"docs/[\w/-]+\.md")


def name(page: Path) -> str:
    return str(page.relative_to(ROOT))


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_links_of_a_page_lead_to_files(page: Path) -> None:
    links = _LINK.findall(page.read_text(encoding="utf-8"))
    assert [link for link in links if not (page.parent / link).exists()] == []


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_paths_named_on_a_page_exist(page: Path) -> None:
    paths = _PATH.findall(page.read_text(encoding="utf-8"))
    assert [path for path in paths if not (ROOT / path).exists()] == []


def test_pages_named_in_the_sources_exist() -> None:
    named = {
        page for path in SOURCES for page in _DOCS.findall(path.read_text(encoding="utf-8", errors="replace"))
    }
    assert named
    assert sorted(page for page in named if not (ROOT / page).exists()) == []


def test_site_navigation_has_every_page() -> None:
    listed = set(
        re.findall(r": ([\w/-]+\.md)$", (ROOT / "mkdocs.yml").read_text(encoding="utf-8"), re.MULTILINE)
    )
    assert listed == {str(page.relative_to(ROOT / "docs")) for page in ROOT.glob("docs/**/*.md")}
