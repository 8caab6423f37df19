"""Pages with charts: one HTML file that holds all it needs, plotly.js included. Templates are Jinja2, escaped."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

from gcs_cli.charts.figure import DARK, LIGHT, AnyFigure
from gcs_cli.charts.plotly_json import chart_json
from gcs_cli.errors import CliError

UNKNOWN = "–"
_HERE = Path(__file__).parent
_PLOTLY_JS = Path("package_data", "plotly.min.js")


def render_page(folder: Path, template: str, *, more: Sequence[Path] = (), **values: Any) -> str:
    """Return the page that a template of ``folder`` makes of ``values``; it extends ``page.html``.

    ``more``: folders of other templates that it imports.
    """
    return _environment((folder, *more)).get_template(template).render(**values)


def load_templates(folder: Path, *more: Path) -> None:
    """Compile the templates that pages of ``folder`` need, which takes longer than to render one."""
    environment = _environment((folder, *more))
    for template in environment.list_templates(["html"]):
        environment.get_template(template)


@cache
def _environment(folders: tuple[Path, ...]) -> Environment:
    """Return the templates and assets of the folders; the first one is that of the page."""
    environment = Environment(
        loader=FileSystemLoader([*folders, _HERE / "templates"]),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.filters |= {"shown": shown, "chart_json": _chart_json}
    environment.globals |= {
        "palettes": {"light": LIGHT, "dark": DARK},
        "style": _asset(_HERE / "page.css"),
        "plotly_js": _plotly_js(),
        "charts_js": _asset(_HERE / "charts.js"),
        "is_space": lambda figure: hasattr(figure, "paths"),
        "asset": lambda name: _asset(folders[0] / name),
    }
    return environment


def shown(value: Any, spec: str = "", unit: str = "") -> str:
    """Return a value as text, with its unit; a dash for None."""
    return UNKNOWN if value is None else f"{value:{spec}}{unit}"


def _chart_json(figure: AnyFigure) -> Markup:
    return Markup(chart_json(figure))


def _asset(path: Path) -> Markup:
    return Markup(path.read_text(encoding="utf-8"))


def _plotly_js() -> Markup:
    """Return plotly.js from the wheel of plotly, whose Python package is not imported."""
    spec = find_spec("plotly")
    for folder in (spec.submodule_search_locations or ()) if spec else ():
        path = Path(folder) / _PLOTLY_JS
        if path.is_file():
            return _asset(path)
    raise CliError("plotly.js is missing, which reports are drawn with: pip install plotly")
