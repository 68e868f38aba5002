"""interpose doctor: does everything work here?"""

from __future__ import annotations

import os
import platform
import tempfile
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

from interpose import __version__
from interpose.cli.console import console, say, say_json
from interpose.errors import InterposeError


@dataclass(frozen=True)
class Check:
    """One line of the doctor's."""

    name: str
    ok: bool
    found: str
    advice: str = ""


def doctor(*, json: bool = False) -> int:
    """Check that everything works on this machine.

    Ends with 0 when all is well, and 2 when something is not; each problem comes
    with what to do.

    Args:
        json: print JSON for other programs.
    """
    checks = [_versions(), _threads()]
    checks += _each(
        "network runtime", _runtime, "Install it again: pip install --force-reinstall onnxruntime"
    )
    checks += _each("trained weights", _weights, "Install interpose again; until then --method spline works.")
    checks += _each("a small fill", _fill, "Install interpose again; if that does not help, report this.")
    well = all(check.ok for check in checks)
    if json:
        say_json({"ok": well, "checks": [asdict(check) for check in checks]})
        return 0 if well else 2
    screen = console()
    for check in checks:
        screen.print(
            "ok      " if check.ok else "PROBLEM ", style="green" if check.ok else "bold red", end=""
        )
        screen.print(f"{check.name}: {check.found}")
        if check.advice and not check.ok:
            screen.print(f"        {check.advice}")
    say("All is well. Try: interpose demo" if well else "Something is wrong: see PROBLEM above.")
    return 0 if well else 2


def _versions() -> Check:
    import numpy
    import scipy

    ours = f"interpose {__version__}, Python {platform.python_version()}"
    theirs = f"NumPy {numpy.__version__}, SciPy {scipy.__version__}"
    return Check("versions", True, f"{ours}, {theirs}, {platform.system()} {platform.machine()}")


def _threads() -> Check:
    told = os.environ.get("OMP_NUM_THREADS")
    return Check("processor", True, f"{os.cpu_count()} cores" + (f", OMP_NUM_THREADS={told}" if told else ""))


def _each(name: str, check: Callable[[], str], advice: str) -> list[Check]:
    """What a check finds; whatever it raises is a problem."""
    try:
        return [Check(name, True, check())]
    except InterposeError as error:
        return [Check(name, False, " ".join(f"{error.what}: {error.why}".split()), error.fix or advice)]
    except Exception as error:
        return [Check(name, False, " ".join(f"{type(error).__name__}: {error}".split()), advice)]


def _runtime() -> str:
    import onnxruntime

    return f"ONNX Runtime {onnxruntime.__version__}, on {', '.join(onnxruntime.get_available_providers())}"


def _weights() -> str:
    from interpose.methods import weights

    cards = weights.cards()
    if not cards:
        weights.find("cae")  # says where they should be
    for card in cards:
        weights.session(card.onnx)
    return ", ".join(f"{card.name} ({card.licence})" for card in cards)


def _fill() -> str:
    from interpose import tasks
    from interpose.cli.demo import GAP, example
    from interpose.formats import load, save
    from interpose.observation import Gap

    with tempfile.TemporaryDirectory() as folder:
        clip = load(example(Path(folder), "walk"))
        start = time.perf_counter()
        done = tasks.fill(clip, [Gap(*GAP)])
        spent = time.perf_counter() - start
        save(done.clip, Path(folder) / "walk.filled.bvh")
    return f"{GAP[1] - GAP[0]} frames of the bundled clip by {done.report.gaps[0].method} in {spent:.2f} s"
