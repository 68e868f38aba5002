"""Twenty fills of clips that no network has seen, as players on one page, the worst five among them.

    python examples/fills.py --data data --out docs/fills.html

Of every window of four seconds of the CMU test performers (mocap.cs.cmu.edu, at 30 fps) the middle two are
missing, and `interpose.fill` fills them as it does without further words. All windows are sorted by the mean
error of joints; the page shows the five worst, and fifteen spread evenly over the ranks of the others.
"""

from __future__ import annotations

import argparse
import html
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import interpose
from interpose.evaluation.windows import windows
from interpose.show import Take, player

GAP, FRAMES, WORST, SHOWN = 60, 120, 5, 20
PAGE = """<!doctype html>
<html lang="en">
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>Twenty fills</title>
<style>
  body {{ margin: 0 auto; max-width: 1500px; padding: 24px; color: #1e293b; }}
  body {{ font: 15px/1.5 system-ui, sans-serif; }}
  main {{ display: grid; grid-template-columns: repeat(auto-fill, minmax(440px, 1fr)); gap: 20px; }}
  figure {{ margin: 0; border: 1px solid #e2e8f0; border-radius: 8px; overflow: hidden; }}
  iframe {{ display: block; width: 100%; height: 340px; border: 0; }}
  figcaption {{ padding: 8px 12px; border-top: 1px solid #e2e8f0; }}
  small {{ color: #64748b; }}
</style>
<h1>Twenty fills of unseen clips</h1>
<p>{intro}</p>
<main>
{figures}
</main>
</html>
"""


@dataclass
class Filled:
    """A window and what became of it; errors in cm."""

    name: str
    start: int
    clip: interpose.Clip
    done: interpose.Completion
    off: float
    linear: float


def fill_all(data: Path) -> list[Filled]:
    """Every window, the least wrong one first."""
    found = []
    seen: dict[str, int] = {}
    for window in windows(data, ("cmu",), "test", FRAMES):
        gap = window.centred(GAP)
        start = seen.get(window.clip.name, 0)
        seen[window.clip.name] = start + FRAMES
        done = interpose.fill(window.clip, gap)
        straight = interpose.fill(window.clip, gap, method="linear")
        off, linear = (
            100
            * np.linalg.norm(window.canonical(one.clip) - window.positions, axis=-1)[
                gap.start : gap.stop
            ].mean()
            for one in (done, straight)
        )
        found.append(Filled(window.clip.name, start, window.clip, done, float(off), float(linear)))
    return sorted(found, key=lambda one: one.off)


def choose(count: int) -> list[int]:
    """Ranks that are shown: the worst five first, then others from the worst to the best."""
    rest = np.linspace(count - WORST - 1, 0, SHOWN - WORST).round().astype(int)
    return [*range(count - 1, count - WORST - 1, -1), *rest.tolist()]


def figure(one: Filled, rank: int, count: int) -> str:
    gap = one.done.report.gaps[0]
    takes = [
        Take("truth", one.clip.positions(), "#64748b", ghost=True),
        Take("filled", one.done.clip.positions(), "#2463c8"),
    ]
    names, fps = one.clip.skeleton.names, one.clip.fps
    page = player(takes, one.clip.skeleton.parents, fps, [gap], title=one.name, names=names, bare=True)
    expected = "" if gap.expected is None else f", {gap.expected:.1f} expected"
    notes = "".join(f"<br><small>{html.escape(note)}</small>" for note in gap.notes)
    inside = f'loading="lazy" title="{html.escape(one.name)}" srcdoc="{html.escape(page)}"'
    return (
        f"<figure><iframe {inside}></iframe>"
        f"<figcaption><b>{html.escape(one.name)}</b>, frames {one.start} to {one.start + FRAMES - 1}, by "
        f"{gap.method}: {one.off:.1f} cm off (linear {one.linear:.1f}{expected}); "
        f"rank {rank + 1} of {count}{notes}</figcaption></figure>"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, required=True, help="the folder that holds cmu/")
    parser.add_argument("--out", type=Path, default=Path("docs/fills.html"))
    given = parser.parse_args()
    found = fill_all(given.data)
    errors = np.array([(one.off, one.linear) for one in found])
    words = (
        f"Two seconds are missing from every window of four seconds of the CMU test performers: {len(found)} "
        f"windows. Filled by interpose, joints are off by {errors[:, 0].mean():.1f} cm in the mean (median "
        f"{np.median(errors[:, 0]):.1f}), by straight lines {errors[:, 1].mean():.1f} (median "
        f"{np.median(errors[:, 1]):.1f}). Shown are the five worst, then fifteen spread evenly over the "
        "ranks of all others, from bad to good. The truth is gray. Data: mocap.cs.cmu.edu. Made by "
        "<code>python examples/fills.py --data data</code>."
    )
    figures = "\n".join(figure(found[rank], rank, len(found)) for rank in choose(len(found)))
    given.out.write_text(PAGE.format(intro=words, figures=figures), encoding="utf-8")
    print(words)
    print(f"wrote {given.out}")


if __name__ == "__main__":
    main()
