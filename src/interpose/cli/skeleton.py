"""interpose skeleton: how a skeleton is understood."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from interpose.cli.console import say, say_json, say_table
from interpose.cli.reading import Reading, describe, details
from interpose.errors import RequestError

if TYPE_CHECKING:
    from interpose.clip import Clip
    from interpose.skeletons import Humanoid
    from interpose.skeletons.rest import Rest

HOW = {
    "given": "as --map says",
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
    rest_frame: int | None = None,
    json: bool = False,
    force: bool = False,
    reading: Reading = Reading(),  # noqa: B008
) -> int:
    """Print the tree of joints: which of the 22 that networks know each one is, and what just follows.

    Try:
      interpose skeleton take.bvh
      interpose skeleton take.bvh --picture take.svg
      interpose skeleton take.bvh --save-map take.map.json   (correct it, then add --map to any verb)

    Ends with 0 when the skeleton is a humanoid, 4 when networks cannot use it.

    Args:
        file: the clip (.bvh, .npz, .amc).
        save_map: write the mapping to a JSON file, to be corrected and given to --map.
        picture: draw the T-pose that was found, from the front and beside the zero pose, as SVG.
        rest_frame: the frame in which the body stands in a rest pose, if the zero pose is none.
        json: print JSON for other programs.
        force: replace existing files.
    """
    from interpose.cli.outputs import write_text
    from interpose.skeletons import find_humanoid
    from interpose.skeletons.mapfile import map_text
    from interpose.skeletons.rest import find_rest

    clip = reading.load(file)
    body = find_humanoid(clip)
    mapping = body.mapping
    if rest_frame is not None:
        body = find_humanoid(clip, find_rest(mapping, clip, rest_frame))
    rest = body.rest if mapping.usable else None
    for path in (save_map, picture):
        if path is not None and path.exists() and not force:
            raise RequestError(
                f"cannot write {path}", "the file exists already", "Choose another, or add --force."
            )
    if save_map is not None:
        write_text(save_map, map_text(mapping))
    if picture is not None:
        write_text(picture, _picture(clip, body, file))
    if json:
        say_json({"input": str(file), **details(clip), **_details(body, rest)})
    else:
        _print(file, clip, body, rest)
        for path in (save_map, picture):
            if path is not None:
                say(f"wrote {path}")
    return 0 if mapping.usable else 4


def _details(body: Humanoid, rest: Rest | None) -> dict[str, Any]:
    from interpose.skeletons import JOINTS

    mapping = body.mapping

    own = [None if joint is None else mapping.skeleton.names[joint] for joint in mapping.joints]
    used = set(own)
    return {
        "humanoid": mapping.usable,
        "sure": mapping.sure,
        "mapping": dict(zip(JOINTS, own)),
        "how": {name: how for name, how in zip(JOINTS, mapping.how) if how},
        "missing": list(mapping.missing),
        "carried_along": [name for name in mapping.skeleton.names if name not in used],
        "left_handed": body.left_handed,
        "leg": mapping.leg_length if mapping.usable else None,
        "rest_pose": None if rest is None else rest.pose,
        "rest_pose_how": None if rest is None else rest.how,
    }


def _print(file: Path, clip: Clip, body: Humanoid, rest: Rest | None) -> None:
    from interpose.skeletons import JOINTS

    mapping = body.mapping
    say("\n".join(describe(file, clip)))
    role = {joint: (name, how) for name, joint, how in zip(JOINTS, mapping.joints, mapping.how)}
    count = len(mapping.mapped[0])
    if rest is not None:
        say(f"  a humanoid: {count} of the 22 joints that networks know, {100 * mapping.sure:.0f} % sure")
        zero = "its zero pose is none" if rest.pose == "none" else f"its zero pose: {rest.pose}"
        say(f"  leg {mapping.leg_length:.2f} m; {zero}, T-pose from the {rest.how}")
        if body.left_handed:
            say("  left-handed: its knees bend forward, so networks see it in a mirror")
    else:
        lacking = ", ".join(mapping.lacking)
        say(f"  no humanoid: nothing found for {lacking}")
        say("  Networks cannot fill it, classical methods can. --save-map writes a map to correct.")
    skeleton, depth = mapping.skeleton, [0] * len(mapping.skeleton)
    rows = []
    for joint, parent in enumerate(skeleton.parents):
        depth[joint] = depth[parent] + 1 if parent >= 0 else 0
        name, how = role.get(joint, ("", ""))
        rows.append(("  " * depth[joint] + skeleton.names[joint], name or "-", HOW.get(how, "carried along")))
    say()
    say_table(("joint", "is", ""), rows)
    if mapping.missing and rest is not None:
        say()
        say(f"missing, so derived from the others: {', '.join(mapping.missing)}")


def _picture(clip: Clip, body: Humanoid, file: Path) -> str:
    """The T-pose (or without a humanoid the zero pose) and a frame of the motion, side by side."""
    import numpy as np

    from interpose.show import Take, strip
    from interpose.skeletons import JOINTS, PARENTS
    from interpose.skeletons.humanoid import canonical_positions

    if not body.mapping.usable:
        raise RequestError(
            "there is no T-pose to draw", "the skeleton is no humanoid", "Map it first: --save-map, --map."
        )
    turned = body.rotations(clip)
    still = np.zeros_like(turned[:1])
    still[..., 0] = 1.0
    frames = np.linspace(0, len(clip) - 1, min(len(clip), 7)).astype(int)
    poses = np.concatenate([still, turned[frames]])
    root = np.concatenate([body.root(clip)[frames[:1]], body.root(clip)[frames]])
    placed = canonical_positions(poses, root, body.bones)
    take = Take(f"{file.name} as the canonical humanoid", placed, "#2463c8")
    return strip([take], PARENTS, clip.fps, [], title="T-pose, and the motion", names=JOINTS)
