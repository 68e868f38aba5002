"""One joint that trembles for a while in a clean walk, and what `denoise` makes of it.

    python examples/trembling.py --out demo

The walk is a clip of the tests (mocap.cs.cmu.edu). Its left forearm is turned by noise of 6 degrees about
each axis for a second and a half. What is printed is how far the hand is from the recorded one before and
after, by some options, how much it is thrown about, and how far feet are moved. trembling.bvh and
trembling.denoised.bvh are written to --out.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

import interpose
from interpose.geometry import rotations

WALK = Path(__file__).parents[1] / "tests" / "data" / "cmu_walk.bvh"
JOINT, HAND, FEET = "LeftForeArm", "LeftHand", ("LeftFoot", "RightFoot", "LeftToeBase", "RightToeBase")
PART, DEGREES = slice(90, 135), 6.0


def shaken(clip: interpose.Clip) -> interpose.Clip:
    """The clip with noise on one joint."""
    turns = np.radians(DEGREES) * np.random.default_rng(1).standard_normal((PART.stop - PART.start, 3))
    rotation, joint = clip.rotation.copy(), clip.skeleton.index(JOINT)
    rotation[PART, joint] = rotations.multiply(rotation[PART, joint], rotations.exp(turns))
    return clip.with_motion(rotation, clip.translation)


def apart(one: interpose.Clip, other: interpose.Clip, *names: str) -> np.ndarray:
    """(F, n) cm between the named joints of two clips."""
    joints = [one.skeleton.index(name) for name in names]
    return 100 * np.linalg.norm((one.positions() - other.positions())[:, joints], axis=-1)


def accelerated(clip: interpose.Clip) -> float:
    """Metres a second squared of the hand where its arm was shaken, in the median."""
    hand = clip.positions()[PART, clip.skeleton.index(HAND)]
    return float(np.median(np.linalg.norm(np.diff(hand, 2, axis=0), axis=-1)) * clip.fps**2)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("demo"))
    given = parser.parse_args()
    clip = interpose.load(WALK)
    noisy = shaken(clip)
    done = interpose.denoise(noisy)
    print(done.report)
    made = {"recorded": clip, "trembling": noisy, "denoised": done.clip}
    for frames in ((92, 136), (80, 145)):
        said = f"denoised, --joints {JOINT} --frames {frames[0]}:{frames[1]}"
        made[said] = interpose.denoise(noisy, joints=[JOINT], frames=frames).clip
    for strength in (0.5, 2.0):
        made[f"denoised, --strength {strength:g}"] = interpose.denoise(noisy, strength).clip
    for name, one in made.items():
        off = apart(one, clip, HAND)[PART]
        print(
            f"{name}: the hand is off by {off.mean():.1f} cm in the mean, {off.max():.1f} at most, and "
            f"accelerates by {accelerated(one):.0f} m/s^2; feet are moved by "
            f"{10 * apart(one, clip, *FEET).max():.1f} mm at most"
        )
    given.out.mkdir(parents=True, exist_ok=True)
    for name, one in (("trembling.bvh", noisy), ("trembling.denoised.bvh", done.clip)):
        interpose.save(one, given.out / name, force=True)
    print(f"wrote {given.out / 'trembling.bvh'}, {given.out / 'trembling.denoised.bvh'}")


if __name__ == "__main__":
    main()
