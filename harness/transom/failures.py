"""Failure bundles: failed.json in the folder of a case says why it failed, and what shows it again."""

from __future__ import annotations

import traceback
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict, ValidationError

from transom.bundle import Case, cache_store
from transom.claims import running_command
from transom.errors import InputError
from transom.files import json_text, write_atomic
from transom.provenance import Provenance, current_provenance

FAILURE_FORMAT = 1
FILE = "failed.json"


class FailureRecord(BaseModel):
    """failed.json. inputs: what the case's key was made of. command: what shows the failure again."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    format: int
    key: str
    label: str
    inputs: dict[str, Any]
    error: str
    traceback: str
    command: str
    failed: datetime
    provenance: Provenance


def error_words(error: BaseException) -> str:
    """An error as one line: bad input in its own words, anything else with its kind."""
    if isinstance(error, InputError):
        return str(error)
    return " ".join("".join(traceback.format_exception_only(error)).split())


def failure_file(case: Case) -> Path:
    """Where the failure of a case is: always in the cache, never among the published references."""
    return cache_store().folder(case) / FILE


def write_failure(case: Case, error: Exception, command: str = "") -> None:
    """Keeps the failure of a case. A disk that takes no file loses this note, and not the error."""
    record = FailureRecord(
        format=FAILURE_FORMAT,
        key=case.key,
        label=case.label,
        inputs=case.inputs(),
        error=error_words(error),
        traceback="".join(traceback.format_exception(error)),
        command=command or running_command(),
        failed=datetime.now(UTC).replace(microsecond=0),
        provenance=current_provenance(),
    )
    with suppress(InputError):
        write_atomic(failure_file(case), json_text(record.model_dump(mode="json")))


def read_failure(case: Case) -> FailureRecord | None:
    """The last failure of a case that has not been answered since, or None."""
    try:
        record = FailureRecord.model_validate_json(failure_file(case).read_bytes())
    except (OSError, ValidationError):
        return None
    return record if record.key == case.key else None


def clear_failure(case: Case) -> None:
    """Forgets the failure of a case that has an answer now."""
    with suppress(OSError):
        failure_file(case).unlink(missing_ok=True)
