"""The report: one HTML page and one JSON file, from the same tables."""

from transom.report.build import write_report

__all__ = ["write_report"]
