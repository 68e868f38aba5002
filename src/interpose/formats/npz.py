"""interpose's own arrays in NumPy's .npz: every value of a clip, exactly, without pickle.

Arrays: version; names (J,) text; parents (J,); rest_translation (J, 3), rest_rotation (J, 4),
rest_scale (J,); rotation (F, J, 4); translation (F, K, 3); translated (K,); fps; and, where somebody said
something about the joints, roles, as JSON in a text. Metres, Y up, quaternions (w, x, y, z).
"""

from __future__ import annotations

import json
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import BinaryIO

import numpy as np

from interpose.clip import Clip, Skeleton
from interpose.errors import FileError, InterposeError, RequestError
from interpose.formats.text import VALUE_LIMIT

VERSION = 1
WHOLE = ("parents", "translated")
SIZE_LIMIT = 4 << 30  # bytes, unpacked
ARRAYS = (
    *("version", "names", "parents", "rest_translation", "rest_rotation", "rest_scale"),
    *("rotation", "translation", "translated", "fps"),
)


def read(path: Path, roles: Mapping[str, str] | None = None) -> Clip:
    """The clip in an .npz file; `roles` as in Skeleton. Raises FileError when it is damaged or no clip."""
    what = f"cannot read {path.name} as a clip"
    again = "Write it again with interpose.save."
    try:
        with zipfile.ZipFile(path) as archive:
            size = sum(member.file_size for member in archive.infolist())
        if size > SIZE_LIMIT:
            raise FileError(what, f"unpacked it is larger than {SIZE_LIMIT >> 30} GiB", "Split the clip.")
        with np.load(path, allow_pickle=False) as file:
            missing = [name for name in ARRAYS if name not in file.files]
            if missing:
                raise FileError(what, f"it has no array {', '.join(missing)}", again)
            if int(file["version"]) != VERSION:
                why = f"its version is {file['version']}, known is {VERSION}"
                raise FileError(what, why, "Install a newer interpose.")
            held = {name: file[name] for name in ARRAYS}
            for name in ARRAYS[1:]:
                if held[name].dtype.kind not in (
                    "U" if name == "names" else "iu" if name in WHOLE else "fiu"
                ):
                    raise FileError(what, f"its {name} are of type {held[name].dtype}", again)
            count = len(held["names"])
            skeleton = Skeleton(
                tuple(str(name) for name in held["names"]),
                tuple(int(parent) for parent in held["parents"]),
                np.asarray(held["rest_translation"], float).reshape(count, 3),
                np.asarray(held["rest_rotation"], float).reshape(count, 4),
                np.asarray(held["rest_scale"], float).reshape(count),
                roles or (json.loads(str(file["roles"])) if "roles" in file.files else {}),
            )
            translated = tuple(int(joint) for joint in held["translated"])
            once = len(set(translated)) == len(translated)
            if not once or not set(skeleton.roots) <= set(translated) <= set(range(count)):
                raise FileError(what, f"its translated joints are {translated}", again)
            if not len(held["rotation"]):
                raise FileError(what, "its motion has no frames", again)
            rest = _rest(skeleton)
            motion = held["rotation"], held["translation"]
            # What is not known may be no number; what is above is damage, and would overflow later.
            if any(np.nanmax(np.abs(values), initial=0.0) > VALUE_LIMIT for values in (*rest, *motion)):
                raise FileError(what, f"it has values beyond {VALUE_LIMIT:g}", again)
            return Clip(skeleton, *motion, float(held["fps"]), translated, path.stem)
    except FileError:
        raise
    except InterposeError as error:
        raise FileError(what, f"{error.what}: {error.why}", again) from None
    except MemoryError:
        raise FileError(what, "what it says that it holds does not fit into memory", again) from None
    except OSError:
        raise
    except Exception as error:  # zipfile and NumPy raise whatever a damaged file makes them stumble over
        detail = (str(error) or type(error).__name__).splitlines()[0]
        raise FileError(what, f"it is no .npz file or damaged ({detail})", again) from None


def write(clip: Clip, stream: BinaryIO) -> tuple[str, ...]:
    """Write all arrays of the clip; returns no notes, as nothing is lost but a text format's layout.

    Raises RequestError for values that are not read again.
    """
    skeleton = clip.skeleton
    if any(np.abs(values).max(initial=0.0) > VALUE_LIMIT for values in (clip.translation, *_rest(skeleton))):
        why = f"it has values beyond {VALUE_LIMIT:g} metres"
        raise RequestError("cannot write this motion", why, "Bring it nearer to the origin.")
    np.savez(
        stream,
        allow_pickle=False,
        version=np.array(VERSION),
        names=np.array(skeleton.names),
        parents=np.array(skeleton.parents),
        rest_translation=skeleton.rest_translation,
        rest_rotation=skeleton.rest_rotation,
        rest_scale=skeleton.rest_scale,
        rotation=clip.rotation,
        translation=clip.translation,
        translated=np.array(clip.translated),
        fps=np.array(float(clip.fps)),
        roles=np.array(json.dumps(dict(skeleton.roles))),
    )
    return ()


def _rest(skeleton: Skeleton) -> tuple[np.ndarray, ...]:
    return skeleton.rest_translation, skeleton.rest_rotation, skeleton.rest_scale
