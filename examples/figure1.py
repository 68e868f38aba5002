"""Figure 1 of Kaufmann et al. 2020: seed clips on one timeline, and about two thirds of it filled.

    python examples/figure1.py --data data --out docs/pictures

The 16 seeds, of a second each, are trials of CMU's test performers (mocap.cs.cmu.edu), at 30 fps: the eight
of subject 16 and the first eight of subject 49 in turns, each from a third of its length on. Each is turned
and placed to go on from the one before. Writes figure1.svg, and to --clip the motion with a page that plays
it.
"""

from __future__ import annotations

import argparse
import re
from pathlib import Path

import interpose
from interpose.cli.outputs import compare
from interpose.geometry.time import resample
from interpose.show import Take, strip

SECOND, GAP = 30, 60  # frames
ROW = 3  # gaps in a row of the picture


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, required=True, help="the folder that holds cmu/")
    parser.add_argument("--out", type=Path, default=Path("docs/pictures"))
    parser.add_argument("--clip", type=Path, help="where to write the motion, too: figure1.bvh")
    parser.add_argument("--method", default="auto")
    given = parser.parse_args()
    seeds = [seed(path) for pair in zip(*(trials(given.data, who) for who in ("16", "49"))) for path in pair]
    done = interpose.stitch(seeds, GAP, method=given.method)
    share = sum(gap.stop - gap.start for gap in done.report.gaps) / len(done.clip)
    print(f"{done.report}\n{len(done.clip)} frames, {100 * share:.0f} % of them filled")
    path = given.out / "figure1.svg"
    path.write_text(picture(done.clip, done.report.gaps), encoding="utf-8")
    print(f"wrote {path}")
    if given.clip:
        page = given.clip.with_suffix(".html")
        interpose.save(done.clip, given.clip, force=True)
        page.write_text(compare(done.clip, done, given.clip.name), encoding="utf-8")
        print(f"wrote {given.clip}, {page}")


def trials(data: Path, performer: str) -> list[Path]:
    """The first eight trials of a performer."""
    return sorted((data / "cmu" / "bvh" / performer).glob("*.bvh"))[:8]


def seed(path: Path) -> interpose.Clip:
    """A second of a trial; its file begins with a rest pose."""
    clip = interpose.load(path)
    clip = resample(clip.slice(1, len(clip)), SECOND)
    start = min(len(clip) // 3, len(clip) - SECOND)
    return clip.slice(start, start + SECOND)


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
    sizes = [re.search(r'width="(\d+)" height="(\d+)"', text) for text in strips]
    heights = [int(size[2]) for size in sizes if size]
    tops = [sum(heights[:i]) for i in range(len(strips))]
    inner = [text.replace("<svg ", f'<svg y="{top}" ', 1) for text, top in zip(strips, tops)]
    width, height = sizes[0][1] if sizes[0] else "", sum(heights)
    size = f'viewBox="0 0 {width} {height}" width="{width}" height="{height}"'
    return f'<svg xmlns="http://www.w3.org/2000/svg" {size}>\n{"".join(inner)}</svg>\n'


if __name__ == "__main__":
    main()
