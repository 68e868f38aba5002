"""A mapping in a JSON file: written by `interpose skeleton --save-map`, corrected by hand, obeyed with --map.

{"root": "Bip01", "joints": {"Hips": "Bip01 Pelvis", "LeftUpLeg": "Bip01 L Thigh", "LeftToe": ""}}

"joints" names the skeleton's own joint for each canonical one; "" or null says that it has none; what is left
out is found as ever. "root" may name the topmost joint of the character that is meant, "hand" say "left" or
"right" of the file's axes. Other keys are for the reader: "unused" lists the joints that are none of these.
"""

from __future__ import annotations

import json
from pathlib import Path

from interpose.errors import FileError, unknown
from interpose.skeletons.canonical import JOINTS
from interpose.skeletons.mapping import HANDS, Mapping
from interpose.smallfile import text_of

EXAMPLE = '{"joints": {"Hips": "pelvis", "LeftToe": ""}}'


def read_map(path: str | Path) -> dict[str, str]:
    """The roles (see `Skeleton`) that a file gives to joints.

    Raises FileError for what is no such file, and RequestError with a list for an unknown canonical joint.
    """
    path = Path(path)
    try:
        content = json.loads(text_of(path))
    except OSError as error:
        raise FileError(
            f"cannot read the map {path}", error.strerror or str(error), "Check the path."
        ) from None
    except (ValueError, RecursionError) as error:
        raise FileError(
            f"the map {path} is no JSON", str(error).splitlines()[0], f"Write {EXAMPLE}"
        ) from None
    joints = content.get("joints") if isinstance(content, dict) else None
    if not isinstance(joints, dict):
        raise FileError(f"there is no mapping in {path}", 'it has no object "joints"', f"Write {EXAMPLE}")
    roles = {str(name): own for name, own in joints.items()}
    for key in ("root", "hand"):
        if content.get(key) is not None:
            roles[key] = content[key]
    if roles.get("hand") not in (None, *HANDS):
        raise FileError(f"the map {path} is wrong", "a hand is left or right", 'Write {"hand": "left", ...}')
    for name, own in roles.items():
        if name not in (*JOINTS, "root", "hand"):
            raise unknown("canonical joint", name, JOINTS)
        if own is not None and not isinstance(own, str):
            raise FileError(f"the map {path} is wrong", f"{name} is {own!r}, not a name", f"Write {EXAMPLE}")
    return {name: own or "" for name, own in roles.items()}


def map_text(mapping: Mapping) -> str:
    """What such a file holds for a mapping: every canonical joint, "" for those that were not found, and the
    joints of the skeleton that are none of them."""
    names, roles = mapping.skeleton.names, mapping.skeleton.roles
    own = {name: "" if joint is None else names[joint] for name, joint in zip(JOINTS, mapping.joints)}
    content = {key: roles[key] for key in ("root", "hand") if roles.get(key)}
    unused = [name for name in names if name not in own.values()]
    return json.dumps({**content, "joints": own, "unused": unused}, indent=2) + "\n"


def is_map(path: Path) -> bool:
    """Whether a file is such a mapping."""
    try:
        return isinstance(json.loads(text_of(path))["joints"], dict)
    except (OSError, ValueError, RecursionError, KeyError, TypeError):
        return False
