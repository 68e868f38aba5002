"""The command line: one file a verb, thin (parse, call, print). Nothing heavy is imported before it is used.

Exit codes: 0 done, 1 a fault of the program, 2 wrong usage, 3 unreadable input, 4 something left unfilled,
130 interrupted.
"""

from __future__ import annotations

import os
import sys
import warnings
from collections.abc import Sequence

from cyclopts import App, CycloptsError, Group, Parameter

from interpose import __version__
from interpose.cli import bench, convert, data, demo, doctor, export, fill, models, recover, scan, train
from interpose.cli.console import complain, usage_error
from interpose.errors import InterposeError

HELP = """
Fills gaps in human motion clips (.bvh, .npz): your skeleton, your file.

First:
  interpose demo                          see a gap filled in a real clip
  interpose scan take.bvh                 find what is missing in your clip
  interpose fill take.bvh --gap 120:160   fill frames 120 to 159 of it
  interpose fill --help                   all about a verb

Frames count from 0; a range stops before its second number.
With --debug (or INTERPOSE_DEBUG=1) errors show where they come from.
"""

app = App(
    name="interpose",
    help=HELP,
    version=f"interpose {__version__}",
    help_format="plaintext",
    version_format="plaintext",
    default_parameter=Parameter(negative=(), show_default=False),
    suppress_keyboard_interrupt=False,
)
app["--help"].group = app["--version"].group = Group("About", sort_key=9)

VERBS = {
    Group("Your clips", sort_key=1): (scan.scan, fill.fill, recover.recover, convert.convert),
    Group("Getting to know it", sort_key=2): (demo.demo, models.models, doctor.doctor),
    Group("Research", sort_key=3): (bench.app, data.app, train.app, export.app),
}
for group, verbs in VERBS.items():
    for place, verb in enumerate(verbs):
        if isinstance(verb, App):
            verb.group, verb.sort_key = group, place
            app.command(verb)
        else:
            app.command(verb, group=group, sort_key=place)


def main(tokens: Sequence[str] | None = None) -> int:
    """Run the command line `tokens` (default: the program's arguments); returns the exit code."""
    tokens = list(sys.argv[1:] if tokens is None else tokens)
    debug = "--debug" in tokens or os.environ.get("INTERPOSE_DEBUG", "0") not in ("", "0")
    tokens = [token for token in tokens if token != "--debug"]
    try:
        with warnings.catch_warnings():
            if not debug:
                warnings.simplefilter("ignore")
            code = app(
                tokens,
                exit_on_error=False,
                print_error=False,
                help_on_error=False,
                result_action="return_value",
            )
        sys.stdout.flush()
        return code if isinstance(code, int) else 0
    except CycloptsError as error:
        complain(usage_error(error))
        return 2
    except InterposeError as error:
        if debug:
            raise
        complain(error)
        return error.exit_code
    except KeyboardInterrupt:
        return 130
    except BrokenPipeError:
        # Who read our output has had enough. The interpreter flushes once more when it ends.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except Exception as error:
        if debug:
            raise
        kind = type(error).__name__
        complain(
            InterposeError(
                f"interpose failed: {error or kind}",
                f"a {kind} that it should have foreseen",
                "Run it again with --debug and report what that prints.",
            )
        )
        return 1
