"""interpose puts poses between poses: fills what is missing in human motion clips.

    import interpose

    done = interpose.fill("take.bvh", "120:160")
    print(done.report)
    interpose.save(done.clip, "take.filled.bvh")

Units and axes: metres, Y up, right-handed; unit quaternions (w, x, y, z); frames are 0-based and ranges
half-open. Nothing heavy is imported before it is used.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from importlib import import_module
from numbers import Real
from typing import TYPE_CHECKING, Any, TypeAlias

from interpose.arguments import checked

if TYPE_CHECKING:
    from pathlib import Path

    import numpy as np

    from interpose.clip import Clip, Skeleton
    from interpose.errors import FileError, InterposeError, NothingError, RequestError
    from interpose.finish import Completion
    from interpose.formats import load, save
    from interpose.methods.protocol import Method
    from interpose.methods.registry import names as method_names
    from interpose.methods.weights import licensed as license
    from interpose.observation import Gap, Observation, Part, Pin
    from interpose.observation.finding import Finding
    from interpose.resampling import resample
    from interpose.tasks import Cycle, Forecast, Stitched

__version__ = "0.1.0"

__all__ = [
    "Clip",
    "Completion",
    "FileError",
    "Gap",
    "InterposeError",
    "NothingError",
    "Observation",
    "Part",
    "Pin",
    "RequestError",
    "Skeleton",
    "__version__",
    "between",
    "cycle",
    "denoise",
    "fill",
    "forecast",
    "license",
    "load",
    "method_names",
    "pose_to_pose",
    "recover",
    "resample",
    "retarget",
    "save",
    "scan",
    "stitch",
]

# Where each public name lives: PEP 562, so that `import interpose` costs next to nothing.
_HOMES = {
    "Clip": "interpose.clip",
    "Completion": "interpose.finish",
    "FileError": "interpose.errors",
    "Gap": "interpose.observation",
    "InterposeError": "interpose.errors",
    "NothingError": "interpose.errors",
    "Observation": "interpose.observation",
    "Part": "interpose.observation",
    "Pin": "interpose.observation",
    "RequestError": "interpose.errors",
    "Skeleton": "interpose.clip",
    "license": "interpose.methods.weights:licensed",
    "load": "interpose.formats",
    "method_names": "interpose.methods.registry:names",
    "resample": "interpose.resampling",
    "save": "interpose.formats",
}

AnyGap: TypeAlias = "Gap | str | tuple[int, int] | tuple[int, int, Sequence[str]] | np.ndarray"


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'interpose' has no attribute {name!r}")
    module, _, attribute = _HOMES[name].partition(":")
    value = getattr(import_module(module), attribute or name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*__all__, *(name for name in globals() if name.startswith("__"))})


@checked
def scan(clip: Clip | str | Path, observation: Observation | None = None) -> list[Finding]:
    """What looks missing in a clip, in order of time: frozen, broken and rest poses, and what `observation`
    says is unknown.

    Args:
        clip: a clip, or the path of one.
        observation: what is known of it; all of it without.

    Raises:
        FileError: the file cannot be read.
    """
    from interpose.observation.scan import scan as look

    return look(_clip(clip), observation)


@checked
def fill(
    clip: Clip | str | Path,
    gaps: AnyGap | Sequence[AnyGap] | np.ndarray | Observation | None = None,
    *,
    method: str | Path | Method = "auto",
    max_gap: int | str | None = None,
    only: Iterable[int] | int | None = None,
    seed: int | None = None,
    progress: Callable[[float], None] | None = None,
    parts: Part | Sequence[Part] = (),
    path: Mapping[int, Any] | None = None,
    pins: Pin | Sequence[Pin] = (),
) -> Completion:
    """Fill gaps of a clip; what is observed comes back unchanged, bit for bit.

    But for IK targets that sit on what is lost in gaps of joints: they go along, and the report says so.

    Args:
        clip: a clip, or the path of one. Its values inside the gaps have no influence.
        gaps: one or several, each a Gap, "120:160" for frames 120 to 159, "4s:5.3s", "120:" to the end,
            (120, 160) or (120, 160, ["LeftArm"]), or a row of an array (n, 2). An Observation says for
            every value whether it is known. None: what a scan of the clip finds; of an empty list nothing is
            filled.
        method: one of `method_names()`, or "auto" for what measured best at each gap's length; a folder with
            weights, or an object of your own, as `interpose.methods.protocol.Method` says.
        max_gap: frames, or seconds as in "2s"; longer gaps stay open.
        only: numbers of the gaps to fill, one or several, counted from 1 in order of time; the others stay
            open.
        seed: for methods that sample.
        progress: called with the share done, 0 to 1.
        parts: poses of single joints that other clips give inside of the gaps. They count as observed, and
            come back as they are: they are eased in and out where a gap is wider than they are.
        path: floor points (x and z in metres) that the hips are led over, by frame: {130: (1.2, 0.4)}.
        pins: where joints are to be at frames inside of gaps: Pin("LeftHand", [130], [[0.3, 1.4, 0.2]]) in
            metres, Y up. What is out of reach is met as nearly as it can be, and reported. Networks are told
            of pins, and the body goes along: by some centimetres also where a joint was there anyway.

    Returns:
        The completion: `.clip`, `.report` (one entry a gap; `.report.open` lists what was left), `.raw` and
        `.provenance`.

    Raises:
        NothingError: gaps are None, and a scan finds none.
        RequestError: a range, joint, number or method that does not exist.
        FileError: the file cannot be read.
    """
    from interpose import tasks
    from interpose.errors import NothingError
    from interpose.observation import Observation, Part, Pin
    from interpose.observation.finding import to_gaps

    clip = _clip(clip)
    if gaps is None:
        found = scan(clip)
        wanted: Observation | list[Gap] = to_gaps(found)
        if not wanted:
            others = sorted({one.kind for one in found})
            but = f" but these, of which scan(clip) says more: {', '.join(others)}" if others else ""
            raise NothingError(
                "nothing to fill",
                f"no gaps were given, and a scan finds nothing missing{but}",
                'Give gaps="120:160".',
            )
    else:
        wanted = gaps if isinstance(gaps, Observation) else [_gap(gap, clip) for gap in _several(gaps)]
    given = [parts] if isinstance(parts, Part) else list(parts)
    return tasks.fill(
        clip,
        wanted,
        method,
        max_gap=max_gap,
        only=only,
        seed=seed,
        progress=progress,
        parts=given,
        path=path,
        pins=[pins] if isinstance(pins, Pin) else list(pins),
    )


@checked
def recover(
    clip: Clip | str | Path,
    joints: str | Sequence[str] | None = None,
    frames: str | tuple[int, int] | None = None,
    *,
    method: str | Path | Method = "auto",
    seed: int | None = None,
    progress: Callable[[float], None] | None = None,
    place: bool = False,
) -> Completion:
    """Recover joints whose local rotations are unknown, over the whole clip or in a range of frames.

    Args:
        clip: a clip, or the path of one.
        joints: names; one name may stand alone. Without any, what was lost is found: joints that snap to
            their rest pose and spikes, at any frames, and hips that stand still while they turn. A clip in
            which nothing was comes back as it is.
        frames: "120:160" or (120, 160); None for all.
        method, seed, progress: as in `fill`.
        place: where the body is, is lost, and how it is turned is known: feet that stand tell it. Of a whole
            clip the first frame counts.

    Returns and raises what `fill` does.
    """
    from interpose import tasks

    clip = _clip(clip)
    return tasks.recover(
        clip,
        [joints] if isinstance(joints, str) else joints if joints is None else list(joints),
        _range(frames, clip),
        method=method,
        seed=seed,
        progress=progress,
        place=place,
    )


@checked
def denoise(
    clip: Clip | str | Path,
    strength: float = 1.0,
    *,
    joints: str | Sequence[str] | None = None,
    frames: str | tuple[int, int] | None = None,
    method: str | Path | Method = "auto",
    seed: int | None = None,
) -> Completion:
    """Smooth noise, and fill values that were lost: joints that snap to their rest pose, spikes.

    How noisy the clip is, is estimated from it, joint by joint, so that a clean one hardly changes. Bones
    keep their lengths, and no frame is lost.

    Args:
        clip: a clip, or the path of one.
        strength: what the estimated noise is multiplied with: 0 changes nothing, 2 is smoother.
        joints: names of the joints that may turn, of a root that moves, too; None for all.
        frames: "120:160" or (120, 160); the noise is estimated from these. None for all.
        method: what fills values that were lost, one of `method_names()`; "auto" interpolates.
        seed: for methods that sample.

    Returns:
        The completion: `.report.noise` says how noisy the clip was and what was done, `.provenance` where
        values were smoothed or filled.

    Raises:
        RequestError: too few frames, a strength below 0 or above 100, a joint or range that does not exist.
        FileError: the file cannot be read.
    """
    from interpose import tasks

    clip = _clip(clip)
    return tasks.denoise(
        clip,
        strength,
        [joints] if isinstance(joints, str) else joints,
        _range(frames, clip),
        method,
        seed,
    )


@checked
def between(
    clip: Clip | str | Path,
    keys: Sequence[int],
    action: str = "",
    *,
    method: str | Path | Method = "auto",
    seed: int | None = None,
    progress: Callable[[float], None] | None = None,
    path: Mapping[int, Any] | None = None,
    pins: Pin | Sequence[Pin] = (),
) -> Completion:
    """Generate the motion between key frames of a clip; the keys come back unchanged, bit for bit.

    Args:
        clip: a clip, or the path of one. Its poses between the keys have no influence; what lies before the
            first and after the last key stays as it is.
        keys: frame numbers, two or more.
        action: what the motion is ("walk", ...), for methods that know actions: "base", "small" and "cmib".
        method, seed, progress, path, pins: as in `fill`.

    Returns and raises what `fill` does; RequestError also for keys with nothing between them and for an
    unknown action, with the list of those there are.
    """
    from interpose import tasks
    from interpose.observation import Pin

    several = [pins] if isinstance(pins, Pin) else list(pins)
    return tasks.between(_clip(clip), keys, action, method, seed, progress, path=path, pins=several)


@checked
def pose_to_pose(
    start: Clip | str | Path,
    target: Clip | str | Path,
    frames: int | str = "auto",
    anchors: Mapping[int, Clip | str | Path] | None = None,
    action: str = "",
    *,
    method: str | Path | Method = "auto",
    seed: int | None = None,
    progress: Callable[[float], None] | None = None,
    path: Mapping[int, Any] | None = None,
    pins: Pin | Sequence[Pin] = (),
) -> Completion:
    """Generate the motion from the last pose of one clip to the first pose of another; both come back
    unchanged, on the body of `start`, where they are in their clips.

    Args:
        start, target: clips, or paths; `clip.slice(0, 81)` is one that ends with frame 80, and
            `clip.slice(12, 13)` a pose alone. What lies before the first pose and after the last one tells
            how the body leaves and meets them. What is of another rig than `start` is retargeted.
        frames: how many to generate between the two, or "1.5s"; "auto" chooses what is unhurried, and the
            report says why.
        anchors: poses to be met on the way, by frame: the first of each clip. `start`'s is frame 0.
        action: what the motion is, as in `between`.
        method, seed, progress, path, pins: as in `fill`; frames count from `start`'s pose, which is 0.

    Returns what `fill` does; `.clip` begins with the one pose and ends with the other. Raises what `between`
    does, and RequestError for clips that cannot be brought onto one rig.
    """
    from interpose import tasks
    from interpose.errors import is_number, unfit
    from interpose.observation import Pin

    first = _clip(start)
    count = _count(frames, first)
    if count != "auto" and not is_number(count, 1, whole=True):
        raise unfit("frames", frames, 'a number from 1 on, seconds such as "1.5s", or "auto"')
    poses = {when: _clip(clip) for when, clip in (anchors or {}).items()}
    several = [pins] if isinstance(pins, Pin) else list(pins)
    told = None if count == "auto" else int(count)
    return tasks.pose_to_pose(
        first, _clip(target), told, poses, action, method, seed, progress, path, several
    )


@checked
def forecast(
    clip: Clip | str | Path,
    frames: int | str | None = None,
    *,
    samples: int = 1,
    method: str | Path | Method = "auto",
    seed: int | None = None,
    temperature: float = 1.0,
    progress: Callable[[float], None] | None = None,
) -> Forecast:
    """Go on with a clip, from its last pose and where that is. The clip comes back unchanged, but for a
    last frame that is no part of the motion, as a rest pose: it is made anew, and a note says so.

    Args:
        clip: a clip, or the path of one. Two seconds of it or more tell best how it goes on.
        frames: how many are added, at the clip's own rate, or "3s"; 2 s of them without it.
        samples: in how many ways; each has a seed of its own, counted up from `seed` or from 1.
        method: one of `method_names()`, or "auto".
        seed: of what is drawn at random. A single sample without a seed is the most likely one.
        temperature: how much is drawn at random, 0 to 10; 1 is what the network was trained with.
        progress: called with the share done, 0 to 1.

    Returns:
        What `fill` does: `.clip` is the whole clip with its forecast, which begins at `.start`. `.samples`
        lists all of them, and `.spread()` tells how far they lie apart in each new frame, in cm.

    Raises:
        RequestError: no frame or sample asked for, several samples of a method that has one answer, and what
            `fill` refuses.
        FileError: the file cannot be read.
    """
    from interpose import tasks

    clip = _clip(clip)
    return tasks.forecast(clip, _count(frames, clip), samples, method, seed, temperature, progress)


@checked
def cycle(clip: Clip | str | Path) -> Cycle:
    """The part of a motion that goes round best already: of a walk one stride or several.

    Args:
        clip: a clip, or the path of one.

    Returns:
        The frames to keep and how many lead back: `found = cycle(clip)`, then
        `stitch(clip.slice(found.start, found.stop), found.frames, loop=True)` is as long as the motion took.

    Raises:
        RequestError: no humanoid, or nothing in it comes back.
        FileError: the file cannot be read.
    """
    from interpose import tasks

    return tasks.cycle(_clip(clip))


@checked
def stitch(
    clips: Clip | str | Path | Sequence[Clip | str | Path],
    frames: str | int | Sequence[int] = "auto",
    action: str = "",
    *,
    align: bool = True,
    loop: bool = False,
    method: str | Path | Method = "auto",
    seed: int | None = None,
    progress: Callable[[float], None] | None = None,
) -> Stitched:
    """Lay clips one after another on one timeline, and generate the motion that leads from each to the next.

    All frames of the clips are kept, at the frame rate and on the skeleton of the first one. The first one
    stays where it is; following ones are turned about the vertical and shifted over the floor as a whole.

    Args:
        clips: clips or paths; one is enough for a loop. `clip.slice(12, 80)` is a part of one. What is of
            another rig than the first is brought onto its skeleton (`retarget`).
        frames: how many frames to generate: one number, or one for each gap, or "1s"; "auto" chooses what
            is unhurried.
        action: what the motion in the gaps is ("walk", ...), for methods that know actions.
        align: each following clip heads on where the one before it was heading, as far ahead as their paces
            lead. Without it clips stay where they lie.
        loop: one more gap leads back to the beginning, so that the motion can be played round and round.
        method, seed, progress: as in `fill`.

    Returns:
        What `fill` does; `.clip` is the whole timeline, and `.report` counts in its frames. `.clips` tells
        where each clip lies, and `.loop` how a loop closes.

    Raises:
        RequestError: nothing to stitch, an empty clip, another skeleton that is no humanoid, lengths that do
            not fit, and what `fill` refuses.
        FileError: a file cannot be read.
    """
    from pathlib import Path

    from interpose import tasks
    from interpose.clip import Clip

    several = [_clip(clip) for clip in ([clips] if isinstance(clips, Clip | str | Path) else clips)]
    if several:
        frames = _count(frames, several[0])
    return tasks.stitch(several, frames, align, loop, action, method, seed, progress)


@checked
def retarget(clip: Clip | str | Path, like: Clip | str | Path) -> Clip:
    """The motion of one humanoid on the skeleton of another one.

    Joints are turned from their T-pose as the other body's are; ways and heights go by the legs' lengths,
    floors are at height 0, and feet that stand still stand still. Clips of one rig keep their own rotations.
    A clip begins over the same floor point.

    Args:
        clip: the motion, a clip or a path.
        like: a clip or a path: the skeleton, and the layout of its file.

    Returns:
        As many frames as `clip` has, at its rate. `save` writes them in the layout of `like`.

    Raises:
        RequestError: the rigs differ, and one is no humanoid, has no frames, or has no T-pose to be found.
        FileError: a file cannot be read.
    """
    from interpose import finish

    return finish.retarget(_clip(clip), _clip(like))


def _clip(clip: Clip | str | Path) -> Clip:
    from interpose.clip import Clip
    from interpose.formats import load

    return clip if isinstance(clip, Clip) else load(clip)


def _several(gaps: Any) -> list[Any]:
    """The gaps of a list, or a list of the one that was given: a pair of numbers is one.
    Those of an array are its rows."""
    from interpose.observation import Gap

    if isinstance(gaps, Gap | str) or not isinstance(gaps, Iterable):
        return [gaps]
    gaps = list(gaps)
    return [tuple(gaps)] if gaps and isinstance(gaps[0], Real) else gaps


def _range(frames: Any, clip: Clip) -> tuple[int, int] | None:
    """A range of frames, or None for all of them."""
    from interpose.errors import RequestError

    if frames is None:
        return None
    chosen = _gap(frames, clip)
    if chosen.joints is not None:
        raise RequestError(
            "a range of frames has no joints", "they are an argument of their own", "Write joints=."
        )
    return chosen.start, chosen.stop


def _count(frames: Any, clip: Clip) -> Any:
    """How many frames to generate: texts such as "2s" as a number, all else as it is."""
    from interpose.observation.observation import frames_of

    return frames_of(frames, clip.fps) if isinstance(frames, str) and frames != "auto" else frames


def _gap(gap: Any, clip: Clip) -> Gap:
    from interpose.errors import RequestError
    from interpose.observation import Gap

    if isinstance(gap, Gap):
        return gap
    if isinstance(gap, str):
        return Gap.parse(gap, clip=clip)
    try:
        start, stop, *joints = gap
        one = joints[0] if len(joints) == 1 else joints or None
        names = [one] if isinstance(one, str) else one
        if names is None or (len(names) and all(isinstance(name, str) for name in names)):
            return Gap(start, stop, tuple(names) if names is not None else None)
        raise ValueError
    except (TypeError, ValueError):
        raise RequestError(
            f"cannot read the gap {str(gap)[:60]}",
            "a gap is a Gap, a text or a tuple",
            'Write "120:160", (120, 160) or (120, 160, ["LeftArm"]).',
        ) from None
