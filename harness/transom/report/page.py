"""The page: fills the template with the report's content. One file, nothing loaded from elsewhere."""

from __future__ import annotations

from pathlib import Path

import jinja2
import markupsafe

from transom.errors import InputError
from transom.figures import DIFFERENCE_SCALE, ILLUMINANCE_SCALE, NOISE_SCALE, scale_svg, tone_scale_svg
from transom.files import write_atomic
from transom.report.content import REPRODUCE, Content
from transom.report.viewer import shared_scales

TEMPLATES = Path(__file__).resolve().parents[3] / "reports" / "templates"

SCRIPTS = ("codec.js", "viewer_pixels.js", "viewer.js", "filters.js", "day.js", "prism_optics.js", "prism_figure.js")


def write_page(path: Path, content: Content) -> None:
    """Writes the page. Raises InputError where the templates are missing (outside the project's own checkout)."""
    if not TEMPLATES.is_dir():
        raise InputError("does not exist", file=TEMPLATES, remedy="Run the report from a checkout of the project")
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(TEMPLATES),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["safe_markup"] = markupsafe.Markup
    environment.filters["scale"] = scale_svg
    environment.filters["tone_scale"] = tone_scale_svg
    page = environment.get_template("report.html").render(
        content=content,
        results=content.results,
        tables=content.tables,
        scales={scale.quantity: scale_svg(scale) for scale in (DIFFERENCE_SCALE, ILLUMINANCE_SCALE, NOISE_SCALE)},
        shared_scales=shared_scales(),
        scripts=SCRIPTS,
        reproduce=REPRODUCE,
    )
    write_atomic(path, page)
