"""Methods by name. Nothing is imported before it is asked for, so that listing names costs nothing."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import fields, is_dataclass, replace
from functools import cache
from importlib import import_module
from importlib.metadata import EntryPoint, entry_points
from os import PathLike, fspath
from pathlib import Path
from typing import Any, cast

from interpose.errors import RequestError, unknown
from interpose.methods import weights
from interpose.methods.protocol import Actor, Method, Sampler

# name: (module, class); the class is called without arguments.
METHODS: dict[str, tuple[str, str]] = {
    "zero-velocity": ("interpose.methods.classical", "ZeroVelocity"),
    "linear": ("interpose.methods.classical", "Linear"),
    "spline": ("interpose.methods.classical", "Spline"),
    "kalman": ("interpose.methods.kalman", "Kalman"),
    "cae": ("interpose.methods.cae", "Cae"),
    "cmib": ("interpose.methods.cmib", "Cmib"),
    "stmi-gan": ("interpose.methods.stmi_gan", "StmiGan"),
    "stmi-gan-dense": ("interpose.methods.stmi_gan", "dense"),
    "base": ("interpose.methods.base", "base"),
    "small": ("interpose.methods.base", "small"),
    "small-open": ("interpose.methods.base", "small_open"),
}

# The entry-point group in which other packages offer methods: name = "package.module:Class".
GROUP = "interpose.methods"


def _offered() -> dict[str, EntryPoint]:
    """Methods of other packages; our own names cannot be taken over."""
    ours = {*METHODS, "auto"}
    return {entry.name: entry for entry in entry_points(group=GROUP) if entry.name not in ours}


def names() -> tuple[str, ...]:
    """The names of all methods, our own first."""
    return (*METHODS, *sorted(_offered()))


def get(name: str | Path | Method) -> Method:
    """The method of that name, always the same object; of a folder with weights, the method that runs them
    as they are now; an object that is one, as it is.

    Raises RequestError for unknown names (with the list of known ones), for a method of another package that
    cannot be loaded, for a folder that is no model, and for an object that is no method.
    """
    if isinstance(name, type):
        raise RequestError(
            f"cannot use {name.__name__} as a method",
            "it is a class, and a method is an object",
            f"Give {name.__name__}().",
        )
    if not isinstance(name, str | PathLike):
        if lacking := _lacking(name):
            raise RequestError(
                f"cannot use a {type(name).__name__} as a method",
                f"it has {lacking}",
                "Give a name, or an object as interpose.methods.protocol.Method says.",
            )
        return name
    folder, name = isinstance(name, PathLike), fspath(name)
    if not folder and (name in METHODS or name in _offered()):
        return _named(name)
    if not (name and Path(name).is_dir()):
        if folder and name in names():
            why = f"a path names a folder with weights, and {name} is the name of a method"
            raise RequestError(f"there is no folder {name}", why, f'Give the text "{name}".')
        raise unknown("method", name, [*names(), "a folder with weights"])
    card = weights.within(name)
    method: Any = _named(card.method) if card.method in METHODS else None
    held = {field.name for field in fields(method)} if is_dataclass(method) else set()
    if "trained" not in held:
        why = f"its card says that {card.method} runs it, which is no method that runs weights"
        raise RequestError(f"the folder {name} is no model", why, "Export the weights again.")
    # By the folder's name where a method can have one: only then can its report be repeated.
    return cast("Method", replace(method, trained=card, **({"name": name} if "name" in held else {})))


@cache
def _named(name: str) -> Method:
    """One of our own methods, or of another package's."""
    if name in METHODS:
        module, kind = METHODS[name]
        return getattr(import_module(module), kind)()
    entry = _offered()[name]
    what, fix = (
        f"the method {name} cannot be loaded",
        "Repair or remove that package, or choose another method.",
    )
    try:
        method = entry.load()()
    except Exception as error:
        raise RequestError(what, f"{entry.value} of another package fails with: {error}", fix) from error
    if lacking := _lacking(method):
        raise RequestError(what, f"{entry.value} of another package has {lacking}", fix)
    if method.name != name:
        # A report names methods as they do themselves, and is repeated by the name of the entry point.
        why = f"{entry.value} of another package says that its name is {method.name}"
        raise RequestError(what, why, f"Call it {name} there, or {method.name} in the entry point.")
    return method


def _lacking(method: object) -> str:
    """What an object lacks of a method: "no refuses and no complete"; "" for nothing."""
    return " and ".join(f"no {part}" for part in ("name", "refuses", "complete") if not hasattr(method, part))


def name_of(method: str | Path | Method) -> str:
    """The name that reports call a method by."""
    return str(method) if isinstance(method, str | PathLike) else method.name


def told(name: str | Path | Method, action: str = "", temperature: float = 1.0) -> Method:
    """The method of that name, told what the motion is ("" for nothing) and how far answers may lie apart.

    Raises RequestError for a method that knows no actions or has one answer only, and for an action that it
    does not know.
    """
    return warmed(acting(get(name), action), temperature)


def acting(method: Method, action: str) -> Method:
    """The method, told what the motion is; raises as `told` does."""
    if not action:
        return method
    if not isinstance(method, Actor):
        what = f"cannot make it {action} with {method.name}"
        if not (others := usable(("base", "cmib"))):
            raise nobody(what, "knows actions")
        why = f"{method.name} knows no actions"
        raise RequestError(what, why, f"Use the method {' or '.join(others)}.")
    return method.for_action(action)


def warmed(method: Method, temperature: float) -> Method:
    """The method, told how far answers may lie apart: 1 as in training. Raises as `told` does."""
    if temperature == 1.0:
        return method
    if not isinstance(method, Sampler):
        raise one_answer(f"{method.name} has no temperature")
    return method.at(temperature)


def one_answer(what: str) -> RequestError:
    """That a method has one answer only, and which ones have more."""
    others = usable(tuple(name for name in METHODS if isinstance(get(name), Sampler)))
    if not others:
        return nobody(what, "has more than one answer")
    return RequestError(what, "it has one answer only", f"Use the method {' or '.join(others)}.")


def usable(names: tuple[str, ...]) -> list[str]:
    """Those of some methods with weights of which these are installed, and may be used."""
    found = []
    for name in names:
        with suppress(RequestError):
            weights.find(name)
            found.append(name)
    return found


def nobody(what: str, does: str) -> RequestError:
    """That no method does something whose weights are installed, and may be used."""
    return RequestError(
        what,
        f"no method {does} whose weights are installed, and may be used",
        "Leave that out; or install those for research (pip install ./weights) and allow any licence.",
    )
