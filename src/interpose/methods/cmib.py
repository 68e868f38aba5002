"""Conditional in-betweening (Kim et al. 2022) as a method: from keys on the user's skeleton and back."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy import ndimage

from interpose.clip import Clip
from interpose.errors import unknown
from interpose.geometry import rotations
from interpose.geometry.time import sample_rotations_smooth, sample_smooth
from interpose.methods import weights
from interpose.methods.bodies import no_humanoid, observed_body, on_the_floor
from interpose.methods.classical import Spline
from interpose.methods.protocol import Raw
from interpose.observation import Gap, Observation
from interpose.skeletons import find_mapping
from interpose.skeletons.humanoid import canonical_positions

ANCHORS = 3  # at most, as in training
# Frames (standard deviation) over which its motion is smoothed: frame by frame the network trembles. On the
# validation performer (60 frames, two keys) L2P falls from 2.83 to 2.82, and no further with 2 frames.
SMOOTH = 1.0


def passes(complete: np.ndarray, longest: float) -> list[list[int]]:
    """The key frames of each pass of the network over a motion of which frames (F,) are complete.

    A gap is generated between the frames right before and after it. Gaps that share a lone key are generated
    as one motion with that key as an anchor, up to ANCHORS of them and `longest` frames. Gaps that are open
    at one end are in no pass.
    """
    edges = np.flatnonzero(np.diff(complete.astype(int)))  # the last frames of runs
    bounds = [(a, b + 1) for a, b in zip(edges, edges[1:]) if not complete[a + 1]]
    done: list[list[int]] = []
    for start, stop in bounds:
        keys = done[-1] if done else []
        if keys and keys[-1] == start and len(keys) <= ANCHORS + 1 and stop - keys[0] < longest:
            keys.append(int(stop))
        else:
            done.append([int(start), int(stop)])
    return done


def run(
    path: Path, positions: np.ndarray, rotation: np.ndarray, keys: np.ndarray, label: int, bones: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Run the graph on one motion at 30 fps.

    Args:
        path: of the graph.
        positions: (T, 22, 3) metres of a body scaled to the canonical leg; only key frames count.
        rotation: (T, 22, 4) canonical rotations.
        keys: (T,) booleans; the first and the last frame are keys.
        label: index of the action.
        bones: (22,) lengths in metres.

    Returns:
        The hips (T, 3), canonical rotations (T, 22, 4), and by how much the network itself missed the hips of
        keys (T,) before its motion was moved onto them, in metres; float64.
    """
    # Far from the origin float32 would lose millimetres.
    origin = positions[0, 0] * [1.0, 0.0, 1.0]
    feed = {
        "positions": (positions - origin)[None].astype(np.float32),
        "rotation": rotation[None].astype(np.float32),
        "keys": keys[None],
        "label": np.array([label]),
        "bones": bones[None].astype(np.float32),
    }
    placed, turned, missed = (out[0].astype(float) for out in weights.session(path).run(None, feed))
    return placed[:, 0] + origin, rotations.normalize(turned), missed


@dataclass(frozen=True)
class Cmib:
    """Generates whole poses between keys; thinks at 30 fps on 22 joints scaled to one leg.

    Attributes:
        action: a label of its card; "" leaves it open.
        trained: the weights; the installed ones without any.
        name: of the method, or of the folder with the weights.
    """

    action: str = ""
    trained: weights.Card | None = None
    name: str = "cmib"

    @property
    def card(self) -> weights.Card:
        return weights.of(self.name, self.trained)

    def for_action(self, action: str) -> Cmib:
        """The same method, told what the motion is. RequestError lists the actions for an unknown one."""
        if action not in self.card.labels:
            raise unknown("action", action, [label for label in self.card.labels if label])
        return replace(self, action=action)

    def refuses(self, clip: Clip, gap: Gap) -> str | None:
        """Why not: no humanoid, single joints, no key on one side, or more frames than it knows."""
        if reason := no_humanoid(find_mapping(clip.skeleton)):
            return reason
        if gap.joints is not None:
            return "it generates whole poses only"
        if gap.start == 0 or gap.stop == len(clip):
            return "it needs a whole pose on both sides"
        # From key to key: at low frame rates that is far more than the frames between them.
        length = self.card.frames(len(gap) + 1, clip.fps) - 1
        if length > self.card.max_gap:
            at = f"{length:.0f} frames at {self.card.fps:g} fps"
            return f"{at} are more than the {self.card.max_gap} it can fill: give keys inside of them"
        return None

    @on_the_floor
    def complete(self, clip: Clip, observation: Observation, seed: int | None = None) -> Raw:
        """Rotations of the mapped joints and the way of the hips between keys; a spline for all else."""
        card, body = self.card, observed_body(clip, observation)
        base = Spline().complete(clip, observation).clip
        turned, root, bones = body.rotations(base), body.root(base) * body.scale, body.bones * body.scale
        placed = canonical_positions(turned, root, bones)
        label, lengths = card.labels.index(self.action), np.linalg.norm(bones, axis=-1)
        step, remarks = clip.fps / card.fps, {}
        missed: dict[int, float] = {}
        for keys in passes(observation.frames, (card.max_gap + 1) * step + 1):
            first, last = keys[0], keys[-1]
            # Both ends lie on the network's grid; its frames may be a little longer or shorter for that.
            count = max(3, round((last - first) / step) + 1)
            scale = (count - 1) / (last - first)
            slots = np.rint((np.array(keys) - first) * scale).astype(int)
            # Keys closer than the grid: the first of them, but for the last one, counts.
            kept = np.unique(slots, return_index=True)[1]
            kept[-1] = len(slots) - 1
            known = np.zeros(count, bool)
            positions = np.zeros((count, *placed.shape[1:]))
            rotation = np.tile([1.0, 0.0, 0.0, 0.0], (count, turned.shape[1], 1))
            at, poses = slots[kept], np.array(keys)[kept]
            known[at], positions[at], rotation[at] = True, placed[poses], turned[poses]
            hips, said, off = run(card.onnx, positions, rotation, known, label, lengths)
            missed |= {key: float(off[slot] / body.scale) for key, slot in zip(keys, slots)}
            for a, b in zip(keys, keys[1:]):
                if remark := self._odd(root[a], root[b], (b - a) / clip.fps):
                    remarks[f"{a + 1}:{b}"] = [remark]
            said = rotations.continuous(said)
            for values in (hips, said):
                calm = ndimage.gaussian_filter1d(values, SMOOTH, axis=0, mode="nearest")
                # Keys are not noisy: above 30 fps frames lie between them and the frame beside.
                values[~known] = calm[~known]
            inside = np.setdiff1d(np.arange(first, last), keys)
            # Keys lie on the grid, up to half a step from where they were: what is between goes along.
            back = np.interp(inside, poses, at)
            root[inside] = sample_smooth(hips, back)
            turned[inside] = sample_rotations_smooth(rotations.normalize(said), back)
        done = body.to_clip(turned, root / body.scale, base)
        return Raw(done, notes={**weights.told(card), "remarks": remarks, "missed": missed})

    def _odd(self, here: np.ndarray, there: np.ndarray, seconds: float) -> str | None:
        """How two keys contradict the action, if they do: by the pace that they ask for (figure 9).

        Only keys within two seconds tell: in longer times people turn around.
        """
        if self.action not in self.card.paces or seconds > 2.0:
            return None
        low, high = self.card.paces[self.action]
        pace = float(np.linalg.norm((there - here)[[0, 2]])) / seconds
        if low <= pace <= high:
            return None
        usual = f"{self.action} in the training data keeps between {low:.1f} and {high:.1f}"
        return f"the keys ask for {pace:.1f} m/s, and {usual}: they contradict the action"
