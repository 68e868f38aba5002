"""Small text files that people, or this program, wrote: lists of gaps, reports, maps of joints."""

from __future__ import annotations

import errno
from pathlib import Path

LIMIT = 256 << 20  # bytes: reports of hours have a few million


def text_of(path: Path, encoding: str = "utf-8") -> str:
    """What a file holds. OSError for what is no regular file, and would be waited for or never end, or is too
    large; UnicodeDecodeError for what is no text."""
    if path.exists() and not path.is_file():
        raise OSError(errno.EINVAL, "it is no regular file: save it to disk first")
    if path.exists() and path.stat().st_size > LIMIT:
        raise OSError(errno.EFBIG, f"it is larger than {LIMIT >> 20} MB")
    return path.read_text(encoding=encoding)
