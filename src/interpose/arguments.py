"""What the functions of the package take: arguments of another kind are refused in words, in one place."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sized
from functools import wraps
from os import PathLike
from typing import Any, ParamSpec, TypeVar

from interpose.errors import is_number, unfit

P = ParamSpec("P")
R = TypeVar("R")


def checked(function: Callable[P, R]) -> Callable[P, R]:
    """The function, whose arguments are looked at before: RequestError for those of a kind that is none of
    theirs in `KINDS`, by name. What is left for the function is whether their values make sense."""
    names = function.__code__.co_varnames[
        : function.__code__.co_argcount + function.__code__.co_kwonlyargcount
    ]

    @wraps(function)
    def looked_at(*args: P.args, **kwargs: P.kwargs) -> R:
        for name, value in (*zip(names, args), *kwargs.items()):
            if name in KINDS and not KINDS[name][0](value):
                raise unfit(name, value, KINDS[name][1])
        return function(*args, **kwargs)

    return looked_at


def _is_path(value: Any) -> bool:
    return isinstance(value, str | PathLike)


def _is_clip(value: Any) -> bool:
    from interpose.clip import Clip

    return isinstance(value, Clip) or _is_path(value)


def _is_switch(value: Any) -> bool:
    """Yes or no; NumPy's, too, and 0 or 1."""
    return type(value).__name__ in ("bool", "bool_") or is_number(value, 0, 1, whole=True)


def _one_or_several(value: Any, fits: Callable[[Any], bool]) -> bool:
    """Something that fits, or some of it; what can be gone through only once is not looked into."""
    if not isinstance(value, Iterable) or isinstance(value, str | bytes | Mapping):
        return fits(value)
    return not isinstance(value, Sized) or fits(value) or all(map(fits, value))


def _are_clips(value: Any) -> bool:
    return _one_or_several(value, _is_clip)


def _are_parts(value: Any) -> bool:
    from interpose.observation import Part

    return _one_or_several(value, lambda one: isinstance(one, Part))


def _are_pins(value: Any) -> bool:
    from interpose.observation import Pin

    return _one_or_several(value, lambda one: isinstance(one, Pin))


def _is_observation(value: Any) -> bool:
    from interpose.observation import Observation

    return value is None or isinstance(value, Observation)


def _is_method(value: Any) -> bool:
    """A name, a folder, or an object that has what makes a method: what it lacks is said later."""
    return _is_path(value) or hasattr(value, "complete") or hasattr(value, "refuses")


CLIP = (_is_clip, "a clip, or the path of one")
SWITCH = (_is_switch, "True or False")
KINDS: dict[str, tuple[Callable[[Any], bool], str]] = {
    "clip": CLIP,
    "like": CLIP,
    "start": CLIP,
    "target": CLIP,
    "anchors": (
        lambda value: value is None or (isinstance(value, Mapping) and all(map(_is_clip, value.values()))),
        "clips, or paths, by frame, such as {20: clip}, or None",
    ),
    "clips": (_are_clips, "clips, or paths of some"),
    "observation": (_is_observation, "an Observation, or None"),
    "method": (
        _is_method,
        'the name of a method: "auto", or one of method_names(); or an object that is one',
    ),
    "action": (lambda value: isinstance(value, str), 'a text, such as "walk"'),
    "keys": (lambda value: _one_or_several(value, is_number), "numbers of frames, such as [0, 30, 75]"),
    "joints": (
        lambda value: value is None or _one_or_several(value, lambda one: isinstance(one, str)),
        'names of joints, such as ["LeftArm"], or None',
    ),
    "parts": (_are_parts, "a Part, or several"),
    "pins": (_are_pins, "a Pin, or several"),
    "path": (
        lambda value: value is None or isinstance(value, Mapping),
        "points of the floor by frame, such as {130: (1.2, 0.4)}, or None",
    ),
    "progress": (lambda value: value is None or callable(value), "a function of the share done, or None"),
    "place": SWITCH,
    "align": SWITCH,
    "loop": SWITCH,
}
