"""Makes every test run the same: random examples are chosen from the test's source, and no example has a time limit."""

from __future__ import annotations

from hypothesis import settings

settings.register_profile("repeatable", derandomize=True, deadline=None, database=None, print_blob=False)
settings.load_profile("repeatable")
