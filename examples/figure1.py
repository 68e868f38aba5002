"""Figure 1 of Kaufmann et al. 2020: seed clips on one timeline, and about two thirds of it filled.

    python examples/figure1.py --data data --out docs/pictures

The 16 seeds, of a second each, are trials of CMU's test performers (mocap.cs.cmu.edu), at 30 fps: the eight
of subject 16 and the first eight of subject 49 in turns, each from a third of its length on. Each is turned
and placed to go on from the one before. Writes figure1.svg, and to --clip the motion with a page that plays
it.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import interpose
from interpose.cli.outputs import compare
from interpose.datasets import Entry, clips
from interpose.resampling import resample
from interpose.show import Take, sheet, strip

SECOND, GAP = 30, 60  # frames
ROW = 3  # gaps in a row of the picture


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, required=True, help="the folder that holds cmu/")
    parser.add_argument("--out", type=Path, default=Path("docs/pictures"))
    parser.add_argument("--clip", type=Path, help="where to write the motion, too: figure1.bvh")
    parser.add_argument("--method", default="auto")
    given = parser.parse_args()
    done = interpose.stitch(seeds(given.data), GAP, method=given.method)
    print(told(done))
    path = given.out / "figure1.svg"
    path.write_text(picture(done.clip, done.report.gaps), encoding="utf-8")
    print(f"wrote {path}")
    if given.clip:
        write(done, given.clip)


def seeds(data: Path) -> list[interpose.Clip]:
    """The seeds in order, each of a second."""
    test = clips("cmu", data, "test")
    eight = ([one for one in test if one.performer == who][:8] for who in ("16", "49"))
    return [seed(entry) for pair in zip(*eight) for entry in pair]


def seed(entry: Entry) -> interpose.Clip:
    """A second of a trial."""
    clip = resample(entry.load(), SECOND)
    start = min(len(clip) // 3, len(clip) - SECOND)
    return clip.slice(start, start + SECOND)


def told(done: interpose.Completion) -> str:
    """What the report says of each gap, how long the motion is, and how much of it was filled."""
    share = sum(gap.stop - gap.start for gap in done.report.gaps) / len(done.clip)
    return f"{done.report}\n{len(done.clip)} frames, {100 * share:.0f} % of them filled"


def write(done: interpose.Completion, path: Path) -> None:
    """The motion as a file, and a page that plays it."""
    page = path.with_suffix(".html")
    interpose.save(done.clip, path, force=True)
    page.write_text(compare(done.clip, done, path.name), encoding="utf-8")
    print(f"wrote {path}, {page}")


def picture(clip: interpose.Clip, gaps: list[interpose.Gap]) -> str:
    """The timeline as strips one below the other; the seed that ends one begins the next."""
    take, skeleton = Take("filled", clip.positions(), "#2463c8"), clip.skeleton
    strips = []
    for some in (gaps[i : i + ROW] for i in range(0, len(gaps), ROW)):
        strips.append(
            strip(
                [take],
                skeleton.parents,
                clip.fps,
                [(gap.start, gap.stop) for gap in some],
                title="" if strips else "Sixteen seeds of a second, and two seconds filled between them",
                names=skeleton.names,
                count=21,
                span=(some[0].start - SECOND, some[-1].stop + SECOND),
            )
        )
    return sheet(strips)


if __name__ == "__main__":
    main()
