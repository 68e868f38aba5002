"""What the researchers' verbs share."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from interpose.errors import RequestError


def shown(default: Any) -> str | None:
    """How help shows a default; not at all where it is off, or nothing."""
    return None if default is None or default is False or default == [] else str(default)


@contextmanager
def needs_torch(what: str) -> Iterator[None]:
    """Around imports: says how to install what is missing."""
    try:
        yield
    except ModuleNotFoundError as error:
        missing = (error.name or "").partition(".")[0]
        if missing not in ("torch", "onnx", "onnxscript", "matplotlib"):
            raise
        raise RequestError(
            f"cannot {what}",
            f"it needs {'PyTorch' if missing == 'torch' else missing}, which is not installed",
            "Install it with: pip install 'interpose[train]'",
        ) from None
