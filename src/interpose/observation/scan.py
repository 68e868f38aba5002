"""Finding what is missing in a clip that does not say so: frozen runs, rest poses at the ends, values that
drop out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy import ndimage

from interpose.clip import Clip
from interpose.geometry import rotations
from interpose.geometry.time import runs
from interpose.observation.broken import AROUND, broken
from interpose.observation.exchange import crossovers, exchanges, put_back
from interpose.observation.finding import STUCK, Finding, spoken_of
from interpose.observation.frozen import but_whole, frozen, held_or_led, measured
from interpose.observation.observation import Observation
from interpose.observation.repeated import but_repeated, doubled, repeated, repeats
from interpose.observation.steps import STILL, Steps, turns
from interpose.observation.stiff import TELEPORTS, TIMES
from interpose.observation.tremor import FEWEST, NOISY, body_of, bursts, deviation, restless
from interpose.skeletons import find_mapping
from interpose.skeletons.carrier import STILL as UNMOVED
from interpose.skeletons.carrier import hips_of, placed
from interpose.skeletons.performers import Joints, by_itself, clip_of, meant

OR = "or in all other frames"  # where limbs change sides once, nobody knows which side of it is wrong
TOLD = 1 / 3  # of the frames in which a joint trembles: found otherwise, it is that


def scan(clip: Clip, observation: Observation | None = None, held: bool = False) -> list[Finding]:
    """What looks missing, in order of time; if it is `held` that is meant, only what is frozen or stuck.

    - "missing": what `observation` says is unknown.
    - "rest pose" or "outlier": a first or last frame that has nothing to do with its neighbour, as in the
      BVH files of the CMU library.
    - "frozen": joints whose local rotation stops changing altogether while it moves elsewhere in the clip,
      for at least .1 s (and 3 frames) with a jump at one end; or for a second in which the joint would
      usually have turned 11 degrees, away from the rest pose: a hinge at its limit has no jump, and files
      write it as their rest pose; or in the very frames in which another does. When everything that moves
      stands still at once, the root's position included, it is one finding of the whole pose; of all joints
      that turn, when the position goes on.
      A limb, or its end, that hardly moves for .3 s (a joint alone for .6 s) and then is elsewhere from one
      frame to the next is frozen, too: trackers hold what they lose with the noise of what they see.
    - "still": a whole pose that stands still without a jump at either end, and that is not met or left at a
      pace of .3 m/s: a statue; or a rest pose of half a second at the beginning or the end, for measuring.
      Nothing is missing.
    - "straight": joints that turn evenly for .3 s, as other programs interpolate; more than a third of all
      that move are the whole pose. Not those that do so in much of the clip: they were animated so.
    - "splined": joints that turn for .4 s along a curve smoother than anybody's motion, as programs ease or
      spline over what they miss, and as animators mend by hand: so that is no gap.
    - "frozen position": the same for a root, or hips, whose position stands still while the pose does not; or
      that stops from one frame to the next.
    - "frozen body": the same, and the hips do not turn either, nor whichever of the listed joints, while
      something else goes on: fingers, a prop, somebody else. `recover` restores both at once.
    - "lost": joints that snap to their rest pose, or jump away and back, for up to a second (where the body
      is, or how its hips face, for up to three), or spikes of up to three frames: what `recover` restores.
    - "exchanged": arms, or legs, that have each other's turns for a while, hands and fingers with them where
      they do: `recover` puts them back.
      Where they do not change back within three seconds it may be in all other frames, and `recover` is told
      which (`frames`).
    - "flipped": a thigh and its shin, or an arm, that are turned by half a turn about the line between their
      ends for a while, so that the knee bends backwards; or a shin that bends so by itself, for however long,
      as where signs were lost: `recover` turns them back.
    - "jump": the body, or joints against its hips, that are elsewhere from one frame to the next, and stay
      there: frames that were cut out, or a tracker that goes on with another marker. Nothing is missing.
    - "doubled": whole frames that are the one before while the body moves at .2 m/s or more on both sides,
      fewer than are frozen: frames that were dropped, and the last one shown once more.
    - "repeated": the same again and again: fewer frames a second than the file says.
    - "noisy": frames in which the body, or a joint by itself, trembles by more than recorded motion does:
      what `denoise` smooths.

    Of several bodies each is looked at as if it were alone, or the one that somebody said is meant
    (`roles["root"]`).

    Joints that never move are "frozen" where those of the other side do. Else they are not reported, nor are
    those that stand still for half of the clip at a stretch, or for nine tenths of it in all: they have no
    data to be filled from.
    """
    known = observation or Observation.full(clip)
    known.check(clip)
    if several := meant(clip.skeleton):
        return _each(several, clip, known, held)
    gaps = known.gaps(clip.skeleton)
    findings = [Finding("missing", gap.joints, gap.start, gap.stop, "no values") for gap in gaps]
    if len(clip) > 2:
        findings = _looked_at(clip, known, findings, held)
    return sorted(findings, key=lambda f: (f.start, f.stop, f.joints or ()))


def _each(several: Sequence[Joints], clip: Clip, known: Observation, held: bool) -> list[Finding]:
    """What is found of each of several bodies by itself, and of all of them at once what each shows."""
    found = []
    for joints in several:
        own = list(joints)
        seen = Observation(known.rotation[:, own], known.translation[:, own])
        found.append(scan(clip_of(clip, joints), seen, held))
    if len(several) == 1:
        return found[0]  # of the one that is meant, a whole pose is that one's
    whole = [{(one.kind, one.start, one.stop) for one in some if one.joints is None} for some in found]
    every = set.intersection(*whole)
    told = [one for one in found[0] if one.joints is None and (one.kind, one.start, one.stop) in every]
    for joints, some in zip(several, found):
        names = by_itself(clip.skeleton, joints).names
        told += [
            one if one.joints else replace(one, joints=names)
            for one in some
            if one.joints or (one.kind, one.start, one.stop) not in every
        ]
    return sorted(told, key=lambda f: (f.start, f.stop, f.joints or ()))


def _looked_at(clip: Clip, known: Observation, findings: list[Finding], held: bool) -> list[Finding]:
    """`findings`, and what the values themselves tell: each look leaves out what an earlier one explains."""
    steps = Steps.of(clip, known)
    findings = frozen(steps, [*findings, *steps.strays])
    swapped, names = exchanges(clip), clip.skeleton.names
    findings += [
        Finding(one.kind, tuple(names[j] for j in one.joints), one.start, one.stop, one.note)
        for one in swapped
    ]
    clip = put_back(clip, swapped)
    either = [
        Finding(one.kind, tuple(names[j] for j in one.joints), one.start, one.stop, f"{one.note}, {OR}")
        for one in crossovers(clip)
    ]
    # They explain what jumps at their ends, and nothing in between.
    ends = [
        replace(one, start=end - 1, stop=end + 1)
        for one in either
        for end in (one.start, one.stop)
        if end < len(clip)
    ]
    findings += ends
    led = held_or_led(clip, findings)
    findings = but_whole(findings, led) + led
    again = repeated(steps)
    findings = but_repeated(findings, again, clip.fps)
    if held:
        return [one for one in findings if one.kind in ("frozen", *STUCK)]
    # What repeats spans all else, and says nothing of it.
    if not again:
        findings += doubled(steps)
    findings += again + _lost(clip, findings)
    if not again:
        findings += _jumps(clip, known, findings)
        findings += _noisy(clip, known, findings)
    return [one for one in findings if one not in ends] + either


def strays(clip: Clip) -> list[int]:
    """The frames among the first and the last that `scan` calls a rest pose or an outlier."""
    return [one.start for one in Steps.of(clip).strays]


def intact(clip: Clip) -> Observation:
    """What is left of a clip without values that were lost for moments, as `broken`: where frames are
    repeated, in steps that are none, by the others. Who stands in the rest pose to be measured is there."""
    again = repeats(clip)
    if not again.any():
        seen = broken(clip)
        there = measured(clip)
        seen.rotation[there], seen.translation[there] = True, True
        return seen
    kept = ~again
    seen = broken(replace(clip.take(kept), fps=clip.fps * float(kept.mean())))
    at = np.cumsum(kept) - 1
    return Observation(seen.rotation[at], seen.translation[at])


def stays(clip: Clip) -> bool:
    """Whether nothing ever leaves its place, as of suits that know no places."""
    return len(clip) > 1 and float(np.ptp(clip.translation, axis=0).max()) < UNMOVED


def _lost(clip: Clip, findings: list[Finding]) -> list[Finding]:
    """Values that drop out, but those that have been found already; joints that do so together are one."""
    seen = intact(clip)
    # Joints that stand still for most of the clip have no data to be restored from, but for spikes.
    gone = ~(seen.rotation & seen.translation) & ~spoken_of(clip, findings)
    steady = (turns(clip) > STILL).mean(axis=0) <= 0.5
    # But what carries the body need not turn.
    placing = placed(clip)
    steps = np.diff(clip.translation[:, [clip.translated.index(joint) for joint in placing]], axis=0)
    steady[placing] &= (np.linalg.norm(steps, axis=-1) > STILL).mean(axis=0) <= 0.5
    for joint in np.flatnonzero(steady):
        for start, stop in runs(gone[:, joint]):
            gone[start:stop, joint] = stop - start <= AROUND
    together: dict[tuple[int, int], list[str]] = {}
    for name, column in zip(clip.skeleton.names, gone.T):
        for run in runs(column):
            together.setdefault(run, []).append(name)
    found = []
    for (start, stop), names in together.items():
        at_end = "comes from elsewhere" * (start == 0) or "jumps away" * (stop == len(clip))
        found.append(Finding("lost", tuple(names), start, stop, at_end or "jumps away and back"))
    return found


def _jumps(clip: Clip, known: Observation, findings: list[Finding]) -> list[Finding]:
    """Where the body, or joints of it, are elsewhere from one frame to the next; not beside what has been
    found already, which begins and ends so, nor within it what hangs from what is lost."""
    positions, hips = clip.positions(), hips_of(clip.skeleton)
    around = positions - positions[:, [hips]]
    around[:, hips] = positions[:, hips]
    seen = known.positions(clip.skeleton)
    seen = seen[1:] & seen[:-1]
    ways = np.diff(around, axis=0)
    steps = np.linalg.norm(ways, axis=-1)
    # A body that runs goes as far in every step as one that stands jumps.
    unlike = ways[:, hips] - ndimage.median_filter(ways[:, hips], size=(7, 1), mode="nearest")
    leaps = steps.copy()
    leaps[:, hips] = np.linalg.norm(unlike, axis=-1)
    leaps[~seen] = 0.0
    beside = ndimage.maximum_filter(leaps, footprint=[[1]] * 3 + [[0]] + [[1]] * 3, mode="nearest")
    jumps = (leaps > TELEPORTS) & (leaps > TIMES * beside)
    skeleton = clip.skeleton
    for one in findings:
        own = [*range(len(skeleton))] if one.joints is None else [*map(skeleton.index, one.joints)]
        hanging = skeleton.below[:, own].any(axis=1)
        jumps[max(one.start - 2, 0) : one.stop + 1, hanging] = False
        for end in (one.start, one.stop):
            jumps[max(end - 2, 0) : end + 1] = False
    found = []
    for step in np.flatnonzero(jumps.any(axis=1)).tolist():
        joint = int(np.where(jumps[step], steps[step], 0.0).argmax())
        way = float(steps[step, hips] if jumps[step, hips] else steps[step, joint])
        speed = f"{way:.2f} m further from one frame to the next, {way * clip.fps:.0f} m/s"
        what = "the body is" if jumps[step, hips] else f"{clip.skeleton.names[joint]} is"
        joints = None if jumps[step, hips] else _turning(clip, np.flatnonzero(jumps[step]).tolist())
        found.append(Finding("jump", joints, step + 1, step + 2, f"{what} {speed}"))
    return found


def _noisy(clip: Clip, known: Observation, findings: list[Finding]) -> list[Finding]:
    """Frames in which the body trembles, or joints do of which nothing else is found, where all is known."""
    if not known.complete or len(clip) < FEWEST:
        return []
    clip = _led_over(clip, findings)
    places = clip.positions()[:, body_of(clip)]
    limit = NOISY * find_mapping(clip.skeleton).size
    all_along = [(0, len(clip))] if deviation(places).mean() > limit else []
    found = [
        Finding(
            "noisy", None, a, b, f"trembles by {100 * deviation(places[a:b]).mean():.1f} cm along each axis"
        )
        for a, b in bursts(clip) or all_along
    ]
    for a, b, joints in [] if all_along else restless(clip):
        turns = 2 * np.degrees(deviation(rotations.continuous(clip.rotation[a:b, list(joints)])))
        named = tuple(clip.skeleton.names[joint] for joint in joints)
        note = f"trembles by {turns.max():.1f} degrees about each axis"
        told = np.zeros(b - a, bool)
        for one in findings:
            if one.joints and {*one.joints} & {*named}:
                told[max(one.start - a, 0) : max(one.stop - a, 0)] = True
        # Single spikes of what trembles are part of it.
        if told.mean() < TOLD:
            found.append(Finding("noisy", named, a, b, note))
    return found


def _led_over(clip: Clip, findings: list[Finding]) -> Clip:
    """The clip with values that lead straight over what is lost: to jump there and back is no trembling."""
    rotation, translation = clip.rotation.copy(), clip.translation.copy()
    for one in findings:
        if one.kind not in ("lost", "frozen", *STUCK) or not 0 < one.start < one.stop < len(clip):
            continue
        part, ends = slice(one.start, one.stop), [one.start - 1, one.stop]
        joints = [*map(clip.skeleton.index, clip.skeleton.names if one.joints is None else one.joints)]
        columns = [clip.translated.index(joint) for joint in joints if joint in clip.translated]
        share = np.arange(1, len(one) + 1)[:, None] / (len(one) + 1)
        before, after = rotation[ends][:, joints]
        rotation[part, joints] = rotations.slerp(before[None], after[None], share)
        near, far = translation[ends][:, columns]
        translation[part, columns] = near + share[..., None] * (far - near)
    return clip.with_motion(rotation, translation)


def _turning(clip: Clip, joints: list[int]) -> tuple[str, ...]:
    """The names of the joints that jump themselves, where `joints` are elsewhere: what those hang from, of
    those that hang from none of the others; a root by itself."""
    skeleton = clip.skeleton
    top = [joint for joint in joints if not {*skeleton.ancestors(joint)} & {*joints}]
    above = ((joint, skeleton.parents[joint]) for joint in top)
    turned = dict.fromkeys(joint if parent < 0 else parent for joint, parent in above)
    return tuple(skeleton.names[joint] for joint in turned)
