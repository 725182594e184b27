"""Tables of the chapter on complex fenestration: transport by product, speed, and how well lobes stand for products."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter, ValidationError

from transom.bench import Bench
from transom.errors import InputError, invalid_field
from transom.fenestration.choice import is_file
from transom.fenestration.evaluation import COUNTS, WIDTHS_DEG, Errors, ProductEvaluation
from transom.fenestration.paper_modes import COUNT as PAPER_COUNT
from transom.judge import Outcome
from transom.products import load_product
from transom.report.numbers import seconds, words
from transom.report.rows_images import HEADLINE_METHOD, verdict_cell
from transom.report.rows_speed import bench_source, timing_words
from transom.report.table import Cell, Row, Table, TablesFile, number, signed_number
from transom.scene.model import Opening, Scene

RUN = "transom run fenestration"
BENCH = "transom bench test_room --glazing south_upper=lumitop_like"


EVALUATE = "transom lobes --evaluate"
REFEREES = "transom referees"
REFERENCES = "cfs_references"


def glazing_words(scene: Scene) -> str:
    """What a variant has in place of its scene's glazing: "Laser cut panel", or "Clear glass, 0.82"."""
    replaced = {text.partition("=")[0] for text in scene.glazings}
    return "; ".join(_opening_words(opening) for opening in scene.openings if opening.name in replaced)


def _opening_words(opening: Opening) -> str:
    if opening.product is None:
        return "No glass" if opening.glazing == "none" else f"Clear glass, {opening.visible_transmittance:g}"
    if is_file(opening.product.name):
        return Path(opening.product.name).name
    changes = [f"{words(name).lower()} {value:g}" for name, value in opening.product.parameters]
    return ", ".join([load_product(opening.product.name).title.partition(",")[0], *changes])


def transport(images: Iterable[Any], sensors: Sequence[Any], scenes: Mapping[str, Scene]) -> Table:
    """One row a product and view: errors of the interior, the worst sensor, and their verdicts. scenes: by name."""
    rows = []
    for row in images:
        if row.region != "interior" or row.method != HEADLINE_METHOD:
            continue
        measured = [entry for entry in sensors if (entry.scene, entry.condition) == (row.scene, row.condition)]
        worst = max(measured, key=lambda entry: abs(entry.error_percent), default=None)
        outcomes: list[Outcome | None] = [row.mean_relative_error_verdict, row.bias_verdict, row.block_verdict]
        cells = (
            Cell(glazing_words(scenes[row.scene])),
            number(row.mean_relative_error_percent, 2),
            number(row.mean_relative_error_raw_percent, 2),
            signed_number(row.bias_percent, 2),
            number(row.block_p95_percent, 1),
            signed_number(worst.error_percent, 2) if worst else Cell("–"),
            number(row.reference_standard_error_percent, 2),
            verdict_cell([*outcomes, *(entry.verdict for entry in measured)]),
        )
        rows.append(Row(cells, row.origin, f"{words(scenes[row.scene].variant_of)}, {words(row.view).lower()}"))
    head = (
        "Product",
        "Mean error [%]",
        "raw [%]",
        "Bias [%]",
        "Blocks, p95 [%]",
        "Worst sensor [%]",
        "Noise [%]",
        "Verdict, with sensors",
    )
    return Table("cfs_transport", "Transport: the same light behind every panel", head, tuple(rows), RUN)


def speed(benches: Iterable[Bench]) -> Table:
    """Every time of scenes with products at default settings, by the number of beams."""
    rows = []
    for bench in benches:
        for entry in bench.measurements:
            if entry.sweep != "default" or entry.unit != "s":
                continue
            size = f", {entry.width}×{entry.height}" if entry.width else ""
            values = [Cell(seconds(value), value) for value in (entry.first, entry.median, entry.p95)]
            cells = (Cell(timing_words(entry.quantity) + size), number(entry.beams, 0), *values)
            group = f"{words(bench.scene)}: {entry.patches} patches"
            rows.append(Row(cells, bench_source(bench), group))
    head = ("", "Beams", "First", "Median", "p95")
    return Table("cfs_speed", "Speed with products", head, tuple(rows), BENCH)


def read_evaluations(file: Path) -> list[ProductEvaluation]:
    """What `transom lobes --evaluate` wrote; none where it has not run. Raises InputError for another form."""
    if not file.is_file():
        return []
    try:
        return TypeAdapter(list[ProductEvaluation]).validate_json(file.read_bytes())
    except ValidationError as error:
        raise invalid_field(error, file) from error


def representation(found: Sequence[ProductEvaluation], source: str) -> Table:
    """Errors of floor and desk illuminance by what stands for the product, against an independent tracer."""
    parts = ("traced", "tabulated", "sky", "tracer")
    rows = [
        Row((Cell(words(entry.product)), *(_quantiles(getattr(entry, part)) for part in parts)), source)
        for entry in found
    ]
    head = ("Product", "Sun, traced there", "Sun, from a table", "Clear sky", "Rays without lobes")
    title = "Representation: error of floor and desks, median / p90 [%]"
    return Table("cfs_representation", title, head, tuple(rows), EVALUATE)


def represented(found: Sequence[ProductEvaluation], source: str) -> Table:
    """Share of the transmitted light in k greedy cones of full angle alpha: mean over incident directions."""
    rows = []
    for entry in found:
        for width, mean, least in zip(WIDTHS_DEG, entry.represented, entry.represented_least, strict=True):
            shares = [number(100 * value, 1) for value in mean]
            worst = number(100 * least[PAPER_COUNT - 1], 1)
            rows.append(Row((number(width, 0), *shares, worst), source, words(entry.product)))
    head = ("alpha [°]", *(f"k = {count} [%]" for count in COUNTS), f"least of k = {PAPER_COUNT} [%]")
    title = "Represented fraction over number k and width alpha of lobes"
    return Table("cfs_represented", title, head, tuple(rows), EVALUATE)


def interpolation(found: Sequence[ProductEvaluation], source: str) -> Table:
    """Light that a direction left out of the table puts more than 11.5 degrees from where it goes."""
    rows = []
    for entry in found:
        moved = (entry.moved_ours, entry.moved_rank, entry.moved_paper, entry.moved_nearest)
        ratio = entry.moved_ours / entry.moved_rank if entry.moved_rank > 0 else None
        cells = (*(number(100 * share, 1) for share in moved), number(ratio, 2))
        rows.append(Row((Cell(words(entry.product)), *cells), source))
    head = (
        "Product",
        "Ours [%]",
        "Same lobes by rank [%]",
        "Paper: 3 of 23° by rank [%]",
        "Nearest [%]",
        "Ours / rank",
    )
    title = "Interpolation: light moved by more than 11.5°, directions left out of a 12° grid"
    return Table("cfs_interpolation", title, head, tuple(rows), EVALUATE)


def energy(found: Sequence[ProductEvaluation], source: str) -> Table:
    """Transmittance against the second tracer's, and of lobes with their residual against the rays that were split."""
    rows = []
    for entry in found:
        difference, uncertainty, split = (
            1e4 * value
            for value in (
                entry.transmittance_mean_difference,
                entry.transmittance_uncertainty,
                entry.split_difference,
            )
        )
        cells = (signed_number(difference, 2), number(uncertainty, 2), Cell(f"{split:.1e}", split))
        rows.append(Row((Cell(words(entry.product)), *cells), source))
    head = ("Product", "T against another tracer [1e-4]", "its uncertainty [1e-4]", "Lobes + residual − T [1e-4]")
    return Table(
        "cfs_energy", "Energy: mean over 24 suns, in shares of the incident light", head, tuple(rows), EVALUATE
    )


def references(folder: Path) -> Table:
    """References of rooms with products against each other, as `transom referees` wrote them; without rows where it
    did not. Raises InputError for a malformed file."""
    title, file = "References of rooms with products, against each other", folder / f"{REFERENCES}.json"
    if not file.is_file():
        return Table(REFERENCES, title, ("",), (), REFEREES)
    try:
        tables = TablesFile.model_validate_json(file.read_bytes()).tables
    except ValidationError as error:
        raise invalid_field(error, file) from error
    found = next((table for table in tables if table.name == REFERENCES), None)
    if found is None:
        names = [table.name for table in tables]
        raise InputError("has no table of that name", file=file, field="tables", value=names, remedy=REFEREES)
    rows = [Row(tuple(Cell(cell.text, cell.value) for cell in row.cells), row.source, row.group) for row in found.rows]
    return Table(REFERENCES, found.title, tuple(found.head), tuple(rows), found.command or REFEREES)


def _quantiles(errors: Errors) -> Cell:
    median, high = (100 * errors.quantile(share) for share in (0.5, 0.9))
    return Cell(f"{median:.2f} / {high:.2f}", high)
