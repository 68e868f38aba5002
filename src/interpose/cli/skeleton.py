"""interpose skeleton: how a skeleton is understood."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from interpose.cli.console import say, say_json, say_table
from interpose.cli.reading import Reading, describe, details
from interpose.cli.whole import Whole
from interpose.errors import RequestError

if TYPE_CHECKING:
    import numpy as np

    from interpose.clip import Clip
    from interpose.skeletons.humanoid import Humanoid

HOW = {
    "given": "as the map says",
    "name": "by its name",
    "chain": "by its place",
    "shape": "by the body's shape",
}


def skeleton(
    file: Path,
    /,
    *,
    save_map: Path | None = None,
    picture: Path | None = None,
    rest_frame: Whole | None = None,
    at: str | None = None,
    json: bool = False,
    force: bool = False,
    reading: Reading = Reading(),
) -> int:
    """Print the joint hierarchy, and which of the 22 joints that networks know each joint is.

    Try:
      interpose skeleton take.bvh
      interpose skeleton take.bvh --picture take.svg
      interpose skeleton take.bvh --save-map take.map.json
      interpose skeleton take.bvh --at 140   (where its joints are, to pin them)

    A saved map can be corrected by hand and given to any verb with --map.

    Exit code: 0 if the skeleton is a humanoid, 4 if networks cannot use it.

    Args:
        file: the clip (.bvh, .npz, .amc).
        save_map: write the mapping to a .json file, to be corrected and given to --map.
        picture: draw the skeleton's zero pose and the T-pose that was found for it, as .svg.
        rest_frame: look at the T-pose that a frame would give in which the body stands in a rest pose.
        at: a frame, counted from 0, or a time, 3.5s: print where joints are in it, in the file's unit and
            axes, as `fill --pin` and `--path` take them.
        json: print JSON for other programs.
        force: replace an earlier map or picture.
    """
    from interpose.cli.outputs import write_text
    from interpose.cli.request import frame_of
    from interpose.skeletons import find_humanoid
    from interpose.skeletons.mapfile import map_text

    _check_free(file, save_map, picture, force)
    clip = reading.load(file)
    body = find_humanoid(clip, frame=rest_frame)
    mapping = body.mapping
    if picture is not None and not mapping.usable:
        raise RequestError(
            "there is no T-pose to draw",
            f"the skeleton is no humanoid: nothing was found for {', '.join(mapping.lacking)}",
            "Map it first: --save-map, then --map.",
        )
    drawn = _picture(body) if picture is not None else ""
    frame = None if at is None else frame_of(at, clip)
    if json:
        where = {} if frame is None else {"frame": frame, "positions": _places(clip, frame)}
        say_json({"input": str(file), **details(clip), **_details(body), **where})
    else:
        _print(file, clip, body, frame)
    for path, text in ((save_map, map_text(mapping)), (picture, drawn)):
        if path is not None:
            write_text(path, text)
            if not json:
                say(f"wrote {path}")
    return 0 if mapping.usable else 4


def _check_free(file: Path, save_map: Path | None, picture: Path | None, force: bool) -> None:
    """Before any work: RequestError if an output is the input, another kind of file, or in the way."""
    from interpose.skeletons.mapfile import is_map

    for path, suffix, option in ((save_map, ".json", "--save-map"), (picture, ".svg", "--picture")):
        if path is None:
            continue
        what, other = f"cannot write {path}", f"Choose another name: {option} NAME{suffix}."
        if path.suffix.lower() != suffix:
            raise RequestError(what, f"{option} writes {suffix} files", other)
        if path.is_dir():
            raise RequestError(what, "it is a directory", other)
        if not path.parent.is_dir():
            raise RequestError(what, f"there is no folder {path.parent}", "Make the folder first.")
        if not path.exists():
            continue
        if file.exists() and path.samefile(file):
            raise RequestError(what, "it is the input, which stays as it is", other)
        if suffix == ".json" and not is_map(path):
            raise RequestError(what, "it is a file of another kind", f"{other} --force replaces maps only.")
        if not force:
            raise RequestError(what, "the file exists already", f"{other[:-1]}, or add --force.")


def _details(body: Humanoid) -> dict[str, Any]:
    from interpose.skeletons import JOINTS

    mapping = body.mapping
    rest = body.rest if mapping.usable else None
    own = [None if joint is None else mapping.skeleton.names[joint] for joint in mapping.joints]
    return {
        "humanoid": mapping.usable,
        "mapping": dict(zip(JOINTS, own)),
        "how": {name: how for name, how in zip(JOINTS, mapping.how) if how},
        "missing": list(mapping.missing),
        "lacking": list(mapping.lacking),
        "carried_along": [name for name in mapping.skeleton.names if name not in own],
        "left_handed": body.left_handed,
        "leg": mapping.leg_length if mapping.usable else None,
        "zero_pose": rest.pose if rest else None,
        "t_pose_from": rest.how if rest else None,
        **(_as_canonical(body) if rest else {}),
    }


def _as_canonical(body: Humanoid) -> dict[str, Any]:
    """What other programs need to bring motion to the canonical body and back (docs/networks.md)."""
    from interpose.skeletons import JOINTS, PARENTS

    rows, joints = body.mapping.mapped
    names = body.mapping.skeleton.names
    return {
        "parents": {JOINTS[row]: JOINTS[parent] for row, parent in enumerate(PARENTS) if parent >= 0},
        "t_pose": {names[joint]: _rounded(body.rest.rotation[row]) for row, joint in zip(rows, joints)},
        "bones": {name: _rounded(bone) for name, bone in zip(JOINTS, body.bones)},
        "scale": float(body.scale),
    }


def _rounded(values: np.ndarray) -> list[float]:
    return [round(float(value), 6) for value in values]


def _places(clip: Clip, frame: int) -> dict[str, list[float]]:
    """Where joints are in a frame, by name, in the file's unit and axes."""
    from interpose.formats.place import vectors_in_file

    unit, up = getattr(clip.source, "unit", 1.0), getattr(clip.source, "up", "y")
    placed = vectors_in_file(clip.slice(frame, frame + 1).positions()[0], unit, up)
    return {name: [round(float(x), 4) for x in row] for name, row in zip(clip.skeleton.names, placed)}


def _print(file: Path, clip: Clip, body: Humanoid, frame: int | None) -> None:
    from interpose.skeletons import JOINTS
    from interpose.skeletons.humanoid import inside_out

    mapping = body.mapping
    say("\n".join(describe(file, clip)))
    if mapping.usable:
        say(f"  {_t_pose(body)}; leg {mapping.leg_length:.2f} m")
        if body.left_handed:
            why = inside_out(mapping, clip) or "as it is said"
            say(f"  left-handed: {why}, so networks see it in a mirror")
    else:
        say("  Networks cannot fill it, classical methods can. --save-map writes a map to complete.")
    of = {joint: (name, how) for name, joint, how in zip(JOINTS, mapping.joints, mapping.how)}
    skeleton, depth = mapping.skeleton, [0] * len(mapping.skeleton)
    hips = mapping["Hips"]
    rows = []
    for joint, parent in enumerate(skeleton.parents):
        depth[joint] = depth[parent] + 1 if parent >= 0 else 0
        name, how = of.get(joint, ("-", ""))
        beside = hips is not None and hips not in (joint, *skeleton.ancestors(joint))
        follows = "not part of this body" if beside else "carried along"
        follows = "above it" if hips is not None and joint in skeleton.ancestors(hips) else follows
        rows.append(("  " * depth[joint] + skeleton.names[joint], name, HOW.get(how, follows)))
    say()
    if frame is None:
        say_table(("joint", "is", ""), rows)
    else:
        where = _places(clip, frame)
        # All digits that --json has, as pins are written with them; and no -0.
        said = [",".join(f"{x + 0.0:.10g}" for x in where[name]) for name in skeleton.names]
        say_table(("joint", "is", "", f"at frame {frame}"), [(*row, one) for row, one in zip(rows, said)])
    if mapping.missing and mapping.usable:
        say()
        say(f"missing, so derived from the others: {', '.join(mapping.missing)}")


def _t_pose(body: Humanoid) -> str:
    """Where the T-pose comes from, in words."""
    if body.rest.how == "motion":
        return "its zero pose (all rotations 0) is no T- or A-pose: the T-pose was worked out from the motion"
    if body.rest.how == "rig":
        return "its zero pose (all rotations 0) is no T- or A-pose: the T-pose is the one known of this rig"
    if body.rest.how == "zero pose":
        kinds = {"T": "a T-pose", "A": "an A-pose", "arms down": "a pose with arms down"}
        return f"its zero pose is {kinds[body.rest.pose]}"
    return f"T-pose from {body.rest.how}"


def _picture(body: Humanoid) -> str:
    """The zero pose, and the T-pose that was found, of the canonical joints."""
    import numpy as np

    from interpose.geometry import kinematics
    from interpose.show import Take, strip
    from interpose.skeletons import JOINTS, PARENTS, canonical_positions

    skeleton = body.mapping.skeleton
    bones = skeleton.rest_translation * skeleton.scale_above[:, None]
    placed = kinematics.forward(skeleton.rest_rotation, bones, skeleton.parents)[1]
    zero = (body.mapping.weights @ placed * body.hand)[None]
    for row, (joint, _) in body.mapping.levers.items():
        zero[:, row] = placed[joint] * body.hand
    still = np.tile([1.0, 0, 0, 0], (1, len(JOINTS), 1))
    found = canonical_positions(still, zero[:, 0], body.bones)
    takes = [
        Take("zero pose: all rotations 0", zero - zero[:, :1], "#dd5f28"),
        Take("the T-pose that was found", found - found[:, :1], "#2463c8"),
    ]
    return strip(takes, PARENTS, 30, [], title="How the skeleton is understood", names=JOINTS)
