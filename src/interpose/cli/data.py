"""interpose data: the public data sets."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

from cyclopts import App

from interpose.cli.console import say, say_json, say_table
from interpose.errors import RequestError

data = App(name="data", help="The public data sets: what is there, and packing it for training.")


@data.command
def info(*, data: Path = Path("data"), json: bool = False) -> None:
    """Count the clips of each data set, and how they are split by performer.

    Args:
        data: the folder with the unpacked data sets; docs/data.md says where to get them.
        json: print JSON for other programs.
    """
    from interpose.datasets import DATASETS, clips
    from interpose.errors import FileError

    found = {}
    for name in DATASETS:
        try:
            entries = clips(name, data)
        except FileError:
            entries = []
        found[name] = {
            "clips": len(entries),
            "performers": len({entry.performer for entry in entries}),
            **{
                split: Counter(entry.split for entry in entries)[split]
                for split in ("train", "validation", "test")
            },
        }
    if json:
        say_json({"data": str(data), "sets": found})
        return
    columns = ("clips", "performers", "train", "validation", "test")
    rows = [[name, *(str(counts[column]) for column in columns)] for name, counts in found.items()]
    say_table(("data set", *columns), rows, right=columns)


@data.command
def pack(*names: str, data: Path = Path("data"), out: Path = Path("packs"), force: bool = False) -> None:
    """Pack data sets for training: one small file each, without the test performers.

    Try:
      interpose data pack lafan1 bandai --data data --out packs

    Args:
        names: the data sets; all without any.
        data: the folder with the unpacked data sets.
        out: the folder for the packs.
        force: replace existing packs.
    """
    from interpose.datasets import DATASETS, build_pack
    from interpose.errors import unknown

    for name in names:
        if name not in DATASETS:
            raise unknown("data set", name, DATASETS)
    chosen = names or tuple(DATASETS)
    for name in chosen:
        if (out / f"{name}.npz").exists() and not force:
            what = f"cannot write {out / name}.npz"
            raise RequestError(
                what, "the file exists already", "Choose another folder with --out, or add --force."
            )
    out.mkdir(parents=True, exist_ok=True)
    for name in chosen:
        packed = build_pack(name, data, progress=say)
        part = out / f".{name}.part.npz"
        try:
            packed.save(part)
            part.replace(out / f"{name}.npz")
        finally:
            part.unlink(missing_ok=True)
        size = (out / f"{name}.npz").stat().st_size / 1e6
        say(f"wrote {out / name}.npz: {len(packed.names)} clips, {len(packed.hips):,} frames, {size:.1f} MB")
