"""interpose data: the public data sets."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Any

from cyclopts import App

from interpose.cli.console import say, say_json, say_table
from interpose.errors import RequestError

LABELS = 12  # as many are printed, the frequent ones first

data = App(name="data", help="The public data sets: what is there, and packing it for training.")


@data.command
def info(*, data: Path = Path("data"), json: bool = False) -> None:
    """Count the clips, hours, performers and labels of each data set, and say how they are split.

    Args:
        data: the folder with the unpacked data sets; docs/data.md says where to get them.
        json: print JSON for other programs.
    """
    from interpose.datasets import DATASETS, SPLITS, clips
    from interpose.errors import FileError

    if not data.is_dir():
        raise FileError(
            f"{data} is no folder",
            "the unpacked data sets are expected there",
            "Give the folder with --data; docs/data.md says where to get the data sets.",
        )
    found: dict[str, dict[str, Any]] = {}
    for name in DATASETS:
        try:
            entries = clips(name, data)
        except FileError:
            entries = []
        hours = dict.fromkeys(SPLITS, 0.0)
        for entry in entries:
            hours[entry.split] += entry.seconds() / 3600
        found[name] = {
            "clips": len(entries),
            "hours": round(sum(hours.values()), 3),
            "performers": sorted({entry.performer for entry in entries}),
            "labels": Counter(entry.label for entry in entries if entry.label),
            **{
                split: {
                    "clips": sum(entry.split == split for entry in entries),
                    "hours": round(hours[split], 3),
                    "performers": sorted({entry.performer for entry in entries if entry.split == split}),
                }
                for split in SPLITS
            },
        }
    if json:
        say_json({"data": str(data), "sets": found})
        return
    columns = ("clips", "hours", "performers", *SPLITS)
    rows = []
    for name, one in found.items():
        parts = [f"{one[split]['clips']} ({one[split]['hours']:.2f} h)" for split in SPLITS]
        rows.append([name, str(one["clips"]), f"{one['hours']:.2f}", str(len(one["performers"])), *parts])
    say_table(("data set", *columns), rows, right=columns)
    for name, one in found.items():
        if not one["clips"]:
            continue
        say()
        for split in ("validation", "test"):
            if one[split]["performers"]:
                say(f"{name}, {split}: {', '.join(one[split]['performers'])}")
        if one["labels"]:
            most = [f"{label} {count}" for label, count in one["labels"].most_common(LABELS)]
            more = len(one["labels"]) - len(most)
            say(f"{name}, labels: {', '.join(most)}" + (f" and {more} more" if more > 0 else ""))


@data.command
def pack(*names: str, data: Path = Path("data"), out: Path = Path("packs"), force: bool = False) -> None:
    """Pack data sets for training: one small file each, without the test performers.

    Try:
      interpose data pack lafan1 bandai --data data --out packs

    Args:
        names: the data sets; all that are there without any.
        data: the folder with the unpacked data sets.
        out: the folder for the packs.
        force: replace existing packs.
    """
    from interpose.datasets import DATASETS, build_pack
    from interpose.errors import unknown

    for name in names:
        if name not in DATASETS:
            raise unknown("data set", name, DATASETS)
    chosen = names or tuple(name for name in DATASETS if (data / name).is_dir()) or tuple(DATASETS)
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
        hours = packed.seconds.sum() / 3600
        say(f"wrote {out / name}.npz: {len(packed.names)} clips, {hours:.2f} h, {size:.1f} MB")
