"""The report: one HTML page, PDF, JUnit, JSON and CSV, from the same tables. `transom.report.build` writes them."""
