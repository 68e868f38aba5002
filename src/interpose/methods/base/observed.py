"""What is observed of a clip, as interpose's own networks are told it."""

from __future__ import annotations

import numpy as np

from interpose.clip import Clip
from interpose.geometry import rotations
from interpose.geometry.time import runs, sample_rotations
from interpose.observation import ROUGH, Observation, Pin
from interpose.skeletons import PARENTS, Humanoid, Mapping

# By what share it goes faster through a lone key between two gaps of a second than it says, and slower in
# between; in longer ones by as many frames. Knowing a pose alone it slows down there, as if each key were an
# end: joints go at 89, 88 and 82 % of their true speed through keys 15, 30 and 60 frames apart (`base`, 20
# windows of LAFAN1's validation performer), and at 97, 96 and 86 % so. They are off by 1 % less, 1 less, and
# as much.
THROUGH = 0.1
COLUMNS = len(PARENTS) + 1  # what can be known in a frame: a rotation for each joint, and where the hips are


def knowledge(observation: Observation, mapping: Mapping) -> np.ndarray:
    """(F, 23) which canonical rotations, relative to the parent's, and last which hips' places are known.

    A rotation needs those of all joints between it and the canonical joint that it hangs from; joints that
    the skeleton does not have are known to turn with their parent.
    """
    skeleton, rows = mapping.skeleton, dict(zip(*mapping.mapped))
    found = np.ones((len(observation.rotation), COLUMNS), bool)
    ends = set(rows.values())
    for row, joint in rows.items():
        chain = [joint]
        while skeleton.parents[chain[-1]] >= 0 and skeleton.parents[chain[-1]] not in ends:
            chain.append(skeleton.parents[chain[-1]])
        found[:, row] = observation.rotation[:, chain].all(axis=1)
    hips = mapping["Hips"]
    assert hips is not None
    found[:, -1] = observation.positions(skeleton)[:, hips]
    return found


def pinned(
    observation: Observation, mapping: Mapping, times: np.ndarray, scale: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Where pins say that canonical joints are (T, 22, 3), in metres of the scaled body, and of which (T, 22)
    they do.

    times: of the network's frames (T), in frames of the clip; a pin speaks of the nearest one.
    scale: (3,) of the body to the canonical one, along each axis: negative where that is its mirror image's.
    """
    rows = {joint: row for row, joint in zip(*mapping.mapped)}
    places, said = np.zeros((len(times), len(PARENTS), 3)), np.zeros((len(times), len(PARENTS)), bool)
    for pin in observation.pins:
        row = rows.get(mapping.skeleton.index(pin.joint))
        if row is not None and pin.position is not None and not leads(pin, row):
            at = np.round(np.interp(pin.frames, times, np.arange(len(times)))).astype(int)
            places[at, row], said[at, row] = np.asarray(pin.position) * scale, True
    return places, said


def leads(pin: Pin, row: int) -> bool:
    """Whether a pin of a canonical joint only says roughly where the body goes."""
    return row == 0 and pin.position is not None and pin.tolerance >= ROUGH


def way(observation: Observation, mapping: Mapping, times: np.ndarray, scale: np.ndarray) -> np.ndarray:
    """(T, 3) metres of the scaled body, where the hips go roughly, NaN where nothing says so; arguments as in
    `pinned`."""
    found = np.full((len(times), 3), np.nan)
    for pin in observation.pins:
        if mapping.skeleton.index(pin.joint) == mapping["Hips"] and leads(pin, 0):
            assert pin.position is not None
            told = (times >= pin.frames[0]) & (times <= pin.frames[-1])
            places = [np.interp(times[told], pin.frames, one) for one in np.transpose(pin.position)]
            found[told] = np.transpose(places) * scale
    return found


def faces(observation: Observation, body: Humanoid, clip: Clip, times: np.ndarray) -> np.ndarray:
    """(T, 4) how the hips are turned roughly, canonical; NaN where nothing says so.

    clip: of the body, whose hips need be turned anyhow.
    """
    found, hips = np.full((len(times), 4), np.nan), body.mapping["Hips"]
    for pin in observation.pins:
        if body.mapping.skeleton.index(pin.joint) == hips and leads(pin, 0) and pin.orientation is not None:
            rotation, above = clip.rotation.copy(), clip.skeleton.parents[hips]
            beneath = clip.kinematics()[0][pin.frames, above] if above >= 0 else rotations.identity(1)
            rotation[pin.frames, hips] = rotations.relative(beneath, pin.orientation)
            turned = body.rotations(clip.with_motion(rotation, clip.translation))[:, 0]
            told = (times >= pin.frames[0]) & (times <= pin.frames[-1])
            found[told] = sample_rotations(rotations.continuous(turned[:, None]), times[told])[:, 0]
    return found


def through(observation: Observation, placed: np.ndarray, fps: float) -> np.ndarray:
    """(F,) at which of its frames to look for what happens in each frame of a clip, so that motion goes
    through lone keys between gaps of the whole pose, and does not slow down there.

    placed: (F,) in which it is known where the hips are.
    """
    whole, empty = observation.frames, ~(observation.rotation.any(axis=1) | placed)
    time = np.arange(len(whole), dtype=float)
    lone = whole.copy()
    lone[[0, -1]] = False
    lone[1:-1] &= empty[:-2] & empty[2:]
    for start, stop in runs(empty):
        if start > 0 and stop < len(whole):
            length = stop - start + 1
            share = np.arange(1, length) / length
            leave, meet = THROUGH * min(1.0, fps / length) * lone[[start - 1, stop]]
            time[start:stop] += length * share * (1 - share) * (leave * (1 - share) - meet * share)
    return time
