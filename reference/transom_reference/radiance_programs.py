"""Radiance's own programs, as the pyradiance wheel brings them: octrees, rays traced with progress, clear errors."""

from __future__ import annotations

import contextlib
import os
import subprocess
import threading
from collections.abc import Iterable, Iterator, Sequence
from functools import cache
from importlib import metadata, util
from pathlib import Path
from typing import IO

import numpy as np
from numpy.typing import NDArray

from transom.errors import InputError
from transom.renderer import Progress

Float32 = NDArray[np.float32]
Float64 = NDArray[np.float64]

RAYS_PER_READ = 4096
"""Rays between two reports of progress."""

FATAL_WORDS = ("fatal", "system", "internal", "user")
"""How Radiance's error lines begin after the program's name; warnings begin otherwise."""


@cache
def radiance_folder() -> Path:
    """Folder of the pyradiance package, with bin/ and lib/. Raises InputError when it is not installed."""
    found = util.find_spec("pyradiance")
    if found is None or found.origin is None:
        raise InputError(
            "is not installed: it brings the Radiance programs", field="pyradiance", remedy="pip install pyradiance"
        )
    return Path(found.origin).parent


def program_path(name: str) -> Path:
    """The program's file. Raises InputError when pyradiance lacks it."""
    path = radiance_folder() / "bin" / name
    if not path.is_file():
        version = metadata.version("pyradiance")
        raise InputError(
            f"is not among the programs of pyradiance {version}",
            file=path,
            remedy="Install the pyradiance version of requirements.lock: pip install -r requirements.lock",
        )
    return path


@cache
def radiance_version() -> str:
    """What rtrace says of itself, with the wheel's version."""
    command = [str(program_path("rtrace")), "-version"]
    said = subprocess.run(command, env=_environment(), capture_output=True, check=True).stdout.decode().strip()
    return f"{said}, pyradiance {metadata.version('pyradiance')}"


def make_octree(description: Path, octree: Path) -> None:
    """oconv: the scene description as an octree, beside it. Raises InputError with what oconv said."""
    # The description names its function files relative to its own folder.
    command = [str(program_path("oconv")), "-w", description.name]
    finished = subprocess.run(command, cwd=description.parent, env=_environment(), capture_output=True, check=False)
    if finished.returncode != 0:
        raise InputError(f"is refused by oconv: {finished.stderr.decode().strip()}", file=description)
    octree.write_bytes(finished.stdout)


def trace(
    octree: Path, arguments: Sequence[str], rays: Float64, progress: Progress | None = None, *, irradiance: bool = False
) -> Float32:
    """rtrace: the radiance (N, 3) [W/(m² sr)] along rays (N, 6), origin and direction.

    irradiance: at points with normals instead [W/m²] (rtrace -I). arguments: rendering parameters.
    Raises InputError with what rtrace said when it fails or leaves rays without an answer.
    """
    parts = []
    for part in trace_parts(octree, arguments, [rays], min(RAYS_PER_READ, len(rays)), irradiance=irradiance):
        parts.append(part)
        if progress is not None:
            progress(sum(len(done) for done in parts), len(rays))
    return np.concatenate(parts)


def trace_parts(
    octree: Path,
    arguments: Sequence[str],
    chunks: Iterable[Float64],
    part_size: int,
    *,
    irradiance: bool = False,
) -> Iterator[Float32]:
    """The same for many rays that come in chunks (N, 6), all by one process and so with one stream of random numbers:
    answers by `part_size` (the last part may be smaller), in the order of the rays."""
    kind = ["-I"] if irradiance else []
    command = [str(program_path("rtrace")), "-h", "-w", "-fdf", *kind, *arguments, octree.name]
    process = subprocess.Popen(
        command,
        cwd=octree.parent,
        env=_environment(),
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    complaints: list[bytes] = []
    asked = [0]
    done = 0
    with process:  # Closes the pipes and waits.
        assert process.stdin is not None and process.stdout is not None and process.stderr is not None
        writer = threading.Thread(target=_feed, args=(process.stdin, chunks, asked))
        listener = threading.Thread(target=lambda stream: complaints.append(stream.read()), args=(process.stderr,))
        writer.start()
        listener.start()
        try:
            while values := process.stdout.read(12 * part_size):
                done += len(values) // 12
                yield np.frombuffer(values, "<f4").reshape(-1, 3)
        except BaseException:
            process.kill()  # An interrupt must not leave rtrace at work.
            raise
        finally:
            writer.join()
            listener.join()
        status = process.wait()
    if status != 0 or done != asked[0]:
        said = b"".join(complaints).decode(errors="replace").strip()
        raise InputError(
            f"failed with {done} of {asked[0]} rays traced (status {status}): {said}",
            field="rtrace",
            value=" ".join(arguments),
        )


def _feed(stream: IO[bytes], chunks: Iterable[Float64], asked: list[int]) -> None:
    """Writes all rays and counts them; a program that has ended says so by itself."""
    with contextlib.suppress(BrokenPipeError):
        for chunk in chunks:
            asked[0] += len(chunk)
            stream.write(np.ascontiguousarray(chunk, "<f8").tobytes())
    with contextlib.suppress(BrokenPipeError):
        stream.close()


def _environment() -> dict[str, str]:
    return {**os.environ, "RAYPATH": f".:{radiance_folder() / 'lib'}"}
