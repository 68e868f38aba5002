"""The parser: verbs are imported when they are used, and its errors speak like all others."""

from __future__ import annotations

import difflib
from collections.abc import Sequence
from pathlib import Path

from cyclopts import (
    App,
    CoercionError,
    CycloptsError,
    MissingArgumentError,
    Parameter,
    RepeatArgumentError,
    UnknownCommandError,
    UnknownOptionError,
    UnusedCliTokensError,
)

from interpose.cli import VERBS
from interpose.cli.console import screen
from interpose.cli.helping import Flowing
from interpose.errors import RequestError
from interpose.methods.weights import asked_anew

app = App(
    name="interpose",
    help_format="plaintext",
    help_formatter=Flowing(),
    version_flags=(),
    default_parameter=Parameter(negative=(), show_default=False),
    suppress_keyboard_interrupt=False,
)
for verbs in VERBS.values():
    for verb in verbs:
        app.command(f"interpose.cli.{verb}:{verb}", name=verb)


def run(tokens: list[str]) -> int:
    """Parse and call; returns the exit code. Raises RequestError when the tokens make no sense."""
    try:
        with asked_anew():  # what a command line says of licences holds for it alone
            code = app(
                tokens,
                console=screen(),
                exit_on_error=False,
                print_error=False,
                help_on_error=False,
                result_action="return_value",
            )
    except CycloptsError as error:
        raise translate(error, tokens) from None
    return code if isinstance(code, int) else 0


def translate(error: CycloptsError, tokens: Sequence[str]) -> RequestError:
    """What is wrong with a command line, in the words of all other errors."""
    chain = error.command_chain or ()
    verb = " ".join(["interpose", *chain])
    see = f"{verb} --help explains it."
    verbs = [name for name in error.app or () if not name.startswith("-")]
    # A verb with verbs of its own may do something without one: what stands in their place is none of these.
    name = next(iter(tokens[len(chain) :]), "-")
    misspelt = isinstance(error, MissingArgumentError) and verbs and not name.startswith("-")
    if isinstance(error, UnknownCommandError) or misspelt:
        name = (error.unused_tokens or [name])[0]
        return RequestError(
            f"unknown verb: {name}", f"{verb} knows: {', '.join(verbs)}", _near(name, verbs) + see
        )
    if isinstance(error, UnknownOptionError):
        name = error.token.keyword or error.token.value
        known = [name for argument in error.argument_collection for name in argument.names if argument.parse]
        if Path(name).exists():
            return RequestError(f"unknown option: {name}", "it is a file", f"Write ./{name} for the file.")
        return RequestError(f"unknown option: {name}", f"{verb} has no such option", _near(name, known) + see)
    if isinstance(error, MissingArgumentError) and error.argument is not None:
        given = error.keyword or next((t.keyword for t in error.argument.tokens if t.keyword), None)
        if given:
            dashed = f"Write {given}=VALUE if that begins with a dash. "
            return RequestError(f"{given} is incomplete", "no value follows it", dashed + see)
        return RequestError(f"{error.argument.name} is missing", f"{verb} needs it", see)
    if isinstance(error, CoercionError) and error.token is not None and error.token.keyword:
        kinds: dict[object, str] = {int: "a whole number", float: "a number"}
        why = f"its value must be {kinds[error.target_type]}" if error.target_type in kinds else str(error)
        return RequestError(f"cannot use {error.token.keyword} {error.token.value}", why, see)
    if isinstance(error, RepeatArgumentError) and error.token.keyword:
        return RequestError(f"{error.token.keyword} is given twice", "it takes one value", see)
    if isinstance(error, UnusedCliTokensError):
        extra = " ".join(error.unused_tokens or ())
        return RequestError(f"unexpected argument: {extra}", f"{verb} takes fewer arguments", see)
    return RequestError("the command line is wrong", str(error), see)


# What the same thing is called with other verbs.
ALIKE = {"--gap": "--frames", "--frames": "--gap", "--out": "--output", "--output": "--out"}


def _near(name: str, known: list[str]) -> str:
    near = [*(n for n in [ALIKE.get(name)] if n in known), *difflib.get_close_matches(name, known, n=1)]
    return f"Did you mean {near[0]}? " if near else ""
