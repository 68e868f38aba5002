"""The command line: one file a verb, thin (parse, call, print). Nothing heavy is imported before it is used.

Exit codes: 0 done, 1 a fault of the program, 2 wrong usage, 3 unreadable input, 4 something left unfilled,
130 interrupted, 143 terminated.
"""

from __future__ import annotations

import io
import os
import signal
import sys
import threading
import traceback
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from types import FrameType

from interpose import __version__
from interpose.errors import Fault, FileError, InterposeError

# Before NumPy is imported: its matrices are small here, and threads that wait for cores that others use make
# a fill many times as long.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# Verbs by group, in the order of the help; `app` finds each in the module of its name.
VERBS = {
    "Your clips": {
        "scan": "find what looks missing: frozen runs, swapped limbs, jumps, noise",
        "fill": "fill gaps; what is not missing comes back unchanged",
        "compare": "compare what several methods make of a gap",
        "between": "generate the motion between key poses",
        "stitch": "join clips one after another, and generate the transitions",
        "recover": "recover joints that are missing in the whole clip or in a range",
        "denoise": "smooth noise, and fill joints that drop out or spike",
        "forecast": "continue a clip after its last frame, in one or several ways",
        "skeleton": "show how the joints of a skeleton were identified",
        "convert": "change the format or frame rate, or retarget to another skeleton",
    },
    "Getting to know it": {
        "demo": "see a gap filled in a real clip",
        "models": "list the methods that fill gaps, and the trained models",
        "doctor": "check that everything works on this machine",
    },
    "Research": {
        "bench": "measure how good the methods are, by published protocols",
        "data": "list the public data sets that you have, and pack them for training",
        "train": "train a network (needs PyTorch: pip install 'interpose[train]')",
        "export": "turn a training run into weights with a card (needs PyTorch)",
    },
}

HELP = """\
interpose fills gaps in motion clips (.bvh, .npz, .amc): your skeleton, your file.

Start here:
  interpose demo                          see a gap filled in a real clip
  interpose scan take.bvh                 find what is missing in your clip
  interpose fill take.bvh --gap 120:160   fill frames 120 to 159 of it
  interpose fill --help                   explain one command

{verbs}
Options:
  --help, --version
  --debug   show where an error comes from (or set INTERPOSE_DEBUG=1)

Frames count from 0, and the end of a range is excluded: 120:160 ends at frame 159.
"""


def root_help() -> str:
    """What `interpose --help` prints."""
    groups = []
    for group, verbs in VERBS.items():
        groups += [f"{group}:", *(f"  {verb:9} {summary}" for verb, summary in verbs.items()), ""]
    return HELP.format(verbs="\n".join(groups))


class Terminated(BaseException):
    """Somebody wants this process to end; what is half written is deleted on the way out."""


def main(tokens: Sequence[str] | None = None) -> int:
    """Run the command line `tokens` (default: the program's arguments); returns the exit code."""
    tokens = list(sys.argv[1:] if tokens is None else tokens)
    debug = "--debug" in tokens or os.environ.get("INTERPOSE_DEBUG", "0") not in ("", "0")
    tokens = [token for token in tokens if token != "--debug"]
    # Daemons have none to write to, and the result counts all the same.
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, "w"))  # noqa: SIM115 - as long as the program runs
    # A log in a narrow encoding, as on Windows, takes any file's name; without this a result that is written
    # ended as a fault.
    if isinstance(sys.stdout, io.TextIOWrapper) and sys.stdout.errors == "strict":
        sys.stdout.reconfigure(errors="backslashreplace")
    try:
        with _heeding_termination():
            code = _run(tokens, debug)
            sys.stdout.flush()
        return code
    except InterposeError as error:
        if debug:
            traceback.print_exc()
        _complain(error)
        return error.exit_code
    except KeyboardInterrupt:
        return 130
    except Terminated:
        return 143
    except BrokenPipeError:
        # Who read our output has had enough. The interpreter flushes once more when it ends.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except Exception as error:
        if debug:
            traceback.print_exc()
        told = foreseen(error)
        _complain(told)
        return told.exit_code


@contextmanager
def _heeding_termination() -> Iterator[None]:
    """Ask to end: what is half written is deleted on the way out."""

    def end(number: int, frame: FrameType | None) -> None:
        raise Terminated

    # Signals are for the main thread, and who embeds this program may have a mind of their own.
    main = threading.current_thread() is threading.main_thread()
    if not main or signal.getsignal(signal.SIGTERM) is not signal.SIG_DFL:
        yield
        return
    signal.signal(signal.SIGTERM, end)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, signal.SIG_DFL)


def foreseen(error: Exception) -> InterposeError:
    """What the machine refuses, or a fault of this program, in the words of all other errors."""
    if isinstance(error, InterposeError):
        return error
    kind = type(error).__name__
    if isinstance(error, MemoryError):
        fix = "Take a part of the clip, or close other programs."
        return FileError("there is not enough memory", str(error) or "the work takes more than there is", fix)
    if isinstance(error, OSError) and error.strerror:
        what = f"cannot use {error.filename}" if error.filename else "cannot read or write"
        fix = "Check the path, what you may do there, and whether there is room."
        return FileError(what, error.strerror, fix)
    why = f"a {kind} that it should have foreseen"
    fix = "Run it again with --debug and report what that prints."
    return Fault(f"interpose failed: {error or kind}", why, fix)


def _run(tokens: list[str], debug: bool) -> int:
    # Answered without the parser, whose import takes longer than anyone should wait for help.
    if not tokens or tokens[0] in ("--help", "-h"):
        sys.stdout.write(root_help())
        return 0
    if tokens[0] == "--version":
        print(f"interpose {__version__}")
        return 0
    from interpose.cli.app import run

    with warnings.catch_warnings():
        if not debug:
            warnings.simplefilter("ignore")
        return run(tokens)


def _complain(error: InterposeError) -> None:
    """Say what is wrong, by the simplest means where there is no memory for others."""
    try:
        from interpose.cli.console import complain

        complain(error)
    except MemoryError:
        with suppress(Exception):
            sys.stderr.write(f"error: {error}\n")
    except OSError:
        pass  # nobody can be told, and the exit code says it
