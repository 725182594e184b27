"""Reading BSDF files: which form a file has is found from its content."""

from __future__ import annotations

from pathlib import Path as FilePath

from transom.bsdf.bsdf import Bsdf
from transom.bsdf.pab_opto import read_pab_opto
from transom.bsdf.window_xml import read_window_xml
from transom.errors import InputError


def read_bsdf(*files: FilePath | str) -> Bsdf:
    """A product from an LBNL WINDOW XML file (Klems full basis or tensor tree), or from pab-opto text files, one a
    measured incidence. Raises InputError that names the file, the field and what is wrong."""
    paths = [FilePath(file) for file in files]
    for path in paths:
        if not path.is_file():
            raise InputError("does not exist", file=path)
    start = paths[0].read_bytes()[:4096].lstrip(b"\xef\xbb\xbf \t\r\n")
    if start.startswith(b"<"):
        if len(paths) > 1:
            raise InputError("is one product in one file", file=paths[1], remedy="Give one XML file at a time")
        return read_window_xml(paths[0])
    if start.startswith(b"#"):
        return read_pab_opto(paths)
    raise InputError(
        "is neither LBNL WINDOW XML nor pab-opto text",
        file=paths[0],
        remedy="XML begins with <, pab-opto text with a header of lines that begin with #",
    )
