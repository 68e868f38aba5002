"""Files that are there whole or not at all, whoever else writes into the folder."""

from __future__ import annotations

import os
import secrets
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from interpose.errors import FileError


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """What is written into the file that this gives takes the place of `path` at the end.

    Where anything goes wrong before, `path` stays as it was, and nothing else is left. Raises FileError when
    it cannot be written.
    """
    # Short, as a long name may have no room for more; and drawn, as processes in several containers or on
    # several machines can share a folder and their numbers.
    part = path.with_name(f".interpose-{secrets.token_hex(8)}.part")
    try:
        try:
            yield part
            os.replace(part, path)
        finally:
            part.unlink(missing_ok=True)
    except OSError as error:
        why = error.strerror or str(error)
        raise FileError(f"cannot write {path}", why, "Choose another folder.") from None
