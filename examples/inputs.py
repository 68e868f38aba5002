"""Motion as the network sees it, an image with holes: Kaufmann et al. 2020, figures 6 and 9.

    python examples/inputs.py --data data --out docs/pictures

The first picture is the beginning of the timeline of figure1.py: seeds, and what is missing between them.
Below it, the first four seconds of a walk of a CMU test performer (mocap.cs.cmu.edu, at 30 fps) are spoilt in
the ways of the paper's appendix, and on their right is what the network makes of them. It draws the whole
image anew, what is known, too. What is printed is how far its joints are off. Needs the `train` extra.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch
from figure1 import GAP, SECOND, seeds

import interpose
from interpose.datasets import clips
from interpose.evaluation.denoising import UNIT
from interpose.methods import weights
from interpose.models.cae import Image, Infiller, to_image
from interpose.observation import Observation, timeline
from interpose.observation.corruption import gaussian_noise, joints_per_frame_mask
from interpose.resampling import resample
from interpose.show import image, sheet
from interpose.skeletons import JOINTS, find_humanoid
from interpose.training.loop import restore

EXCERPT = 13 * SECOND  # frames
TRIAL, LENGTH = "49_01", 120
LOST = ("LeftForeArm", "LeftHand")
GROUPS = {
    "hips": 3,
    "left leg": 12,
    "right leg": 12,
    "spine, head": 15,
    "left arm": 12,
    "right arm": 12,
    "velocities": 3,
}
POSITIONS = slice(3, 3 * len(JOINTS))  # rows; the hips lie over the origin


def noise(seen: Image, rng: np.random.Generator) -> Image:
    """Noise on all positions."""
    rows = seen.rows.clone()
    rows[:, POSITIONS] = torch.from_numpy(gaussian_noise(rng, rows[:, POSITIONS].numpy(), UNIT))
    return replace(seen, rows=rows)


def drop(seen: Image, rng: np.random.Generator) -> Image:
    """Each joint missing in each frame with a probability of .3."""
    return hide(seen, joints_per_frame_mask(rng, 1, LENGTH, len(JOINTS), 0.3))


def lose(seen: Image, rng: np.random.Generator) -> Image:
    """Joints missing all the time."""
    return hide(seen, np.broadcast_to(~np.isin(JOINTS, LOST), (1, LENGTH, len(JOINTS))))


def hide(seen: Image, joints: np.ndarray) -> Image:
    """The image without the positions of joints (1, T, 22) that are not known."""
    known = seen.known.clone()
    known[:, : 3 * len(JOINTS)] &= torch.from_numpy(joints.repeat(3, axis=2)).transpose(1, 2)
    return replace(seen, known=known)


SPOILT: dict[str, Callable[[Image, np.random.Generator], Image]] = {
    f"noise of {100 * UNIT:g} cm": noise,
    "joints dropped, p .3": drop,
    "left elbow and hand lost": lose,
}


def seen(clip: interpose.Clip, observation: Observation) -> Image:
    """A clip at 30 fps as the image of its motion."""
    body = find_humanoid(clip)
    known = body.observed(observation.positions(clip.skeleton), observation.rotation)
    positions = torch.from_numpy(body.as_canonical(clip)).float()
    return to_image(positions[None], torch.from_numpy(known)[None])


def draw(rows: torch.Tensor, known: torch.Tensor, title: str, width: int) -> str:
    return image(rows[0].numpy(), known[0].numpy(), SECOND, title=title, groups=GROUPS, width=width)


@torch.no_grad()
def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, required=True, help="the folder that holds cmu/")
    parser.add_argument("--out", type=Path, default=Path("docs/pictures"))
    given = parser.parse_args()
    model = Infiller().eval()
    restore(model, weights.find("cae").onnx)

    line = timeline.lay(seeds(given.data), GAP)
    timed = seen(line.clip, Observation.from_gaps(line.clip, line.gaps))
    rows, known = (values[..., :EXCERPT] for values in model.normalised(timed))
    pictures = [draw(rows, known, "Seeds of a second and gaps of two, as the network sees them", 1280)]

    trial = next(one for one in clips("cmu", given.data, "test") if one.path.stem == TRIAL)
    clip = resample(trial.load(), SECOND).slice(0, LENGTH)
    truth = seen(clip, Observation.full(clip))
    print(f"as recorded: {errors(model, truth, truth)}")
    pairs = []
    for number, (name, spoil) in enumerate(SPOILT.items()):
        spoilt = spoil(truth, np.random.default_rng(number))
        rows, known = model.normalised(spoilt)
        answer = model.predict(spoilt)
        pairs += [
            draw(rows, known, name[0].upper() + name[1:], 640),
            draw(answer, torch.ones_like(known), "What the network makes of it", 640),
        ]
        print(f"{name}: {errors(model, spoilt, truth)}")
    path = given.out / "inputs.svg"
    sheet([*pictures, sheet(pairs, columns=2)], path)
    print(f"wrote {path}")


def errors(model: Infiller, spoilt: Image, truth: Image) -> str:
    """How far joints are off in the body's frame: known ones in the input, all in the network's answer."""
    given, answer = (
        100 * (rows - truth.rows)[:, POSITIONS].unflatten(1, (-1, 3)).norm(dim=2)
        for rows in (spoilt.rows, model.answer(spoilt))
    )
    known = spoilt.known[:, POSITIONS][:, ::3]
    words = f"joints off by {given[known].mean():.2f} cm, in the network's answer by {answer.mean():.2f} cm"
    return words if known.all() else f"{words}, missing ones by {answer[~known].mean():.2f} cm"


if __name__ == "__main__":
    main()
