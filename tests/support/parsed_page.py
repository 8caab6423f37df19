"""Parse the HTML of a report; fail on tags that do not match."""

from __future__ import annotations

import json
from html.parser import HTMLParser
from typing import Any

VOID = {"meta", "wbr", "br", "hr", "img", "link", "input"}


class Checker(HTMLParser):
    """Fails on tags that do not match; collects visible text, attributes, and charts by name."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.tags: list[str] = []
        self.attributes: list[tuple[str, str]] = []
        self.text = ""
        self.charts: dict[str, dict[str, Any]] = {}

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self.attributes.extend((name, value or "") for name, value in attrs)
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self.attributes.extend((name, value or "") for name, value in attrs)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if self.open[-1:] == ["script"]:
            if self.attributes[-1] == ("type", "application/json"):
                chart = json.loads(data)
                self.charts[chart["file"]] = chart
        elif self.open[-1:] != ["style"]:
            self.text += data


def own_part(html: str) -> str:
    """Return a page without plotly.js."""
    before, _, rest = html.partition("<script>/**")
    return before + rest.partition("</script>")[2]


def parsed(html: str) -> Checker:
    checker = Checker()
    checker.feed(html)
    checker.close()
    assert checker.open == []
    return checker
