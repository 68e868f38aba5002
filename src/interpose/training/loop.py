"""The training loop shared by all recipes: budget, schedule, averaged weights, checkpoints, log."""

from __future__ import annotations

import copy
import json
import math
import os
import pickle
import re
import signal
import subprocess
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import asdict, dataclass, fields
from importlib.util import find_spec
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import torch
from filelock import FileLock, Timeout
from torch import Tensor, nn
from torch import distributed as dist

from interpose.datasets import Pack
from interpose.errors import FileError, RequestError
from interpose.methods.weights import Card
from interpose.training.budget import Budget
from interpose.training.device import processes, rank
from interpose.training.optimizers import Muon

SHARE, SWITCH = (0, 1), (0, 1)
SOME = (1, math.inf)  # of what is counted


@dataclass
class Settings:
    """What all recipes share.

    The learning rate warms up over the first hundredth of the budget and falls to zero along half a
    cosine over the rest of it; weights are averaged exponentially.
    """

    # The least and the most of settings that are numbers: 0 and anything finite where it is not said.
    LIMITS: ClassVar[dict[str, tuple[float, float]]] = {
        "learning_rate": (1e-12, 10),
        "average": SHARE,
        "seed": (0, 2**32 - 1),
        "batch": SOME,
    }

    learning_rate: float = 1e-3
    warm_up: float = 0.01
    average: float = 0.999
    seed: int = 1
    every_seconds: float = 300.0

    def __post_init__(self) -> None:
        """Raises RequestError for what no run can do."""
        if not 0 < self.warm_up <= 1:
            raise RequestError(
                f"cannot warm up over {self.warm_up:g} of the budget", "it is a share", "Choose 0.001 to 1."
            )
        for one in fields(self):
            value, (low, high) = getattr(self, one.name), self.LIMITS.get(one.name, (0, math.inf))
            if isinstance(value, int | float) and not (low <= value <= high and math.isfinite(value)):
                most = f" to {high:g}" if math.isfinite(high) else " on, and finite"
                raise RequestError(
                    f"cannot train with {one.name}={value}",
                    f"it is a number from {low:g}{most}",
                    f"Write --set {one.name}={one.default}, as in the recipe, or another one in that range.",
                )
        shortest, longest = (getattr(self, name, 0) for name in ("shortest", "longest"))
        if shortest > longest:
            raise RequestError(
                f"cannot train with shortest={shortest}",
                f"it is more than longest={longest}",
                "Choose a smaller --set shortest, or a larger --set longest.",
            )


def commit() -> str:
    """The commit of the code that trains, when it lies in a repository."""
    try:
        asked = ["git", "rev-parse", "--short", "HEAD"]
        answer = subprocess.run(asked, capture_output=True, text=True, check=True, cwd=Path(__file__).parent)
        return answer.stdout.strip()
    except (OSError, subprocess.CalledProcessError):
        return "unknown"


def shard_paths(path: Path) -> list[Path]:
    """The files of safetensors that lie beside a graph: one of its name, or numbered ones."""
    numbered = path.parent.glob(f"{path.stem}-[0-9]*-of-*.safetensors")
    return sorted([*path.parent.glob(f"{path.stem}.safetensors"), *numbered])


def _exported(path: Path) -> dict[str, Tensor]:
    """The weights of an exported graph by name: those beside it, or else those that it holds itself."""
    if shards := shard_paths(path):
        from safetensors import SafetensorError
        from safetensors.torch import load_file

        numbered = re.fullmatch(r".*-of-(\d+)", shards[0].stem)
        if numbered and len(shards) != int(numbered[1]):
            raise FileError(
                f"cannot read the weights beside {path}",
                f"of {int(numbered[1])} files {len(shards)} are there",
                "Copy all files of the folder.",
            )
        try:
            return {name: value for shard in shards for name, value in load_file(shard).items()}
        except SafetensorError as reason:
            raise FileError(
                f"cannot read the weights beside {path}", str(reason), "Copy them once more."
            ) from None
    import onnx
    from onnx import numpy_helper

    graph = onnx.load(path).graph
    return {
        one.name.removesuffix(".half"): torch.from_numpy(numpy_helper.to_array(one).astype(np.float32))
        for one in graph.initializer
    }


def restore(model: nn.Module, path: Path) -> None:
    """Fill a model with the weights of an exported graph (16 bits of them).

    A part that begins with nothing may be missing: without it the network is the one that was exported. Of a
    table of labels that has grown, the rows that are new stay as they are.
    """
    held = _exported(path)
    with torch.no_grad():
        for name, value in model.state_dict().items():
            if name not in held and not value.any():
                continue
            if name.endswith("label.weight") and name in held and len(held[name]) < len(value):
                value[: len(held[name])] = held[name]
                continue
            if name not in held or held[name].shape != value.shape:
                raise FileError(
                    f"cannot start from {path.name}",
                    f"it has no {name} of the shape {list(value.shape)}",
                    "Name weights of the same network.",
                )
            value.copy_(held[name])


@dataclass
class Opponent:
    """What a model is trained against: in every step it learns first.

    Attributes:
        model: the network.
        loss: from a random generator and the fraction of the budget spent to a scalar loss.
        optimizer: of its parameters; its learning rate follows the schedule of the run.
        pace: its learning rate, as a multiple of the model's.
    """

    model: nn.Module
    loss: Callable[[np.random.Generator, float], Tensor]
    optimizer: torch.optim.Optimizer
    pace: float = 1.0


class Stop:
    """The signal by which somebody asked to stop, SIGINT or SIGTERM, or 0. Once more, and what happened
    before happens."""

    def __init__(self) -> None:
        self.asked = 0
        self._before: dict[int, Any] = {}
        # Of several processes one could stop a step before the others, which would wait for it.
        alone = processes() == 1 and threading.current_thread() is threading.main_thread()
        if alone:
            for number in (signal.SIGINT, signal.SIGTERM):
                if signal.getsignal(number) is not signal.SIG_IGN:
                    self._before[number] = signal.signal(number, self._ask)

    def _ask(self, number: int, _: Any) -> None:
        self.asked = number
        self.over()

    def over(self) -> None:
        """Listen no more."""
        for number, handler in self._before.items():
            signal.signal(number, handler)


@contextmanager
def _alone(folder: Path) -> Iterator[None]:
    """Within it no other run may write into the folder. RequestError where one does so already."""
    try:
        with FileLock(folder / "run.lock", timeout=0):
            yield
    except Timeout:
        raise RequestError(
            f"cannot train in {folder}",
            "another run is training there",
            "Wait for its end, or name another folder with --out.",
        ) from None


def _without(values: dict[str, Any], *names: str) -> dict[str, Any]:
    return {name: value for name, value in values.items() if name not in names}


def _listed(values: dict[str, Any]) -> str:
    """name=value, as options say it."""
    texts = {name: ",".join(map(str, v)) if isinstance(v, list) else v for name, v in values.items()}
    return ", ".join(f"{name}={text}" for name, text in texts.items())


def _write(path: Path, text: str) -> None:
    """Whole or not at all: other processes of the run read it."""
    new = path.with_name(path.name + ".new")
    new.write_text(text)
    os.replace(new, path)


def taught(packs: Sequence[Pack], splits: Sequence[str]) -> dict[str, Any]:
    """What a run learns from, for its record."""
    held = {str(pack.dataset): sizes(pack, splits) for pack in packs}
    return {"packs": sorted(held), "splits": sorted({*splits}), "held": held}


def sizes(pack: Pack, splits: Sequence[str]) -> dict[str, int]:
    """How many clips of some splits a pack holds, and how many frames of them."""
    kept = np.isin(pack.splits, list(splits))
    return {"clips": int(kept.sum()), "frames": int(np.diff(pack.starts)[kept].sum())}


def recorded(folder: Path, network: str = "") -> dict[str, Any] | None:
    """What is on record of the run that goes on in a folder, under the name `network` what its network is, if
    that is asked for; None where none has begun."""
    path = folder / "checkpoint.pt"
    if not path.exists():
        return None
    try:
        kept: dict[str, Any] = json.loads((folder / "settings.json").read_text())
        if isinstance(found := kept[network] if network else kept, dict):
            return found
    except (OSError, ValueError, KeyError, TypeError):
        pass
    raise FileError(
        f"cannot go on from {path}",
        "settings.json beside it is missing or damaged, or it is of a run of another recipe",
        "Name another folder with --out.",
    )


def of_kind(start: Card, *methods: str) -> None:
    """RequestError for weights of a network of another kind than one of these methods runs."""
    if start.method not in methods:
        why = f"it is a network of another kind, of {start.method}"
        fix = f"Name weights of {' or '.join(methods)}, or train from nothing, without --start."
        raise RequestError(f"cannot begin with {start.name}", why, fix)


def from_weights(folder: Path, start: Card | None) -> bool:
    """Whether a run starts from weights, or goes on and did so; then `start` need not be named again."""
    return bool(start) or (recorded(folder) is not None and (folder / "earlier.json").exists())


def _history(start: Card) -> list[dict[str, Any]]:
    """How weights came to be, from the first run on."""
    return [*start.training.get("earlier", []), _without(start.training, "earlier", "statistics")]


class Trainer:
    """Runs one recipe in one folder: `checkpoint.pt`, `averaged.pt` and `log.jsonl` are in there.

    Where TensorBoard is installed its event files are, too: `tensorboard --logdir FOLDER` shows the curves.

    Args:
        model: what is trained.
        loss: from a random generator and the fraction of the budget spent to a scalar loss; one without
            gradients leaves the model as it is.
        validate: measures the averaged model; its figures go to the log.
        optimizer: makes the optimiser from the parameters; Adam without one.
        clip: the largest norm of the gradients.
        about: what else the card should say of the model; kept with the settings.
        opponent: a network that the model plays against, for adversarial training.
        data: what it learns from, as `taught` says.
    """

    def __init__(
        self,
        model: nn.Module,
        loss: Callable[[np.random.Generator, float], Tensor],
        validate: Callable[[nn.Module], dict[str, float]],
        folder: Path,
        budget: Budget,
        settings: Settings,
        say: Callable[[str], None] = print,
        optimizer: Callable[[list[nn.Parameter]], torch.optim.Optimizer | Muon] | None = None,
        clip: float | None = None,
        about: dict[str, Any] | None = None,
        opponent: Opponent | None = None,
        data: dict[str, Any] | None = None,
    ) -> None:
        self.model, self.loss, self.validate = model, loss, validate
        self.folder, self.budget, self.settings, self.say = folder, budget, settings, say
        self.device = next(model.parameters()).device
        make: Callable[[list[nn.Parameter]], torch.optim.Optimizer | Muon] = optimizer or (
            lambda some: torch.optim.Adam(some, settings.learning_rate)
        )
        self.optimizer, self.clip, self.about = make(list(model.parameters())), clip, about or {}
        self.opponent, self.data = opponent, data or {}
        self.board: Any = None  # TensorBoard's, where it is installed
        self.averaged = copy.deepcopy(model).eval().requires_grad_(False)
        # Every process draws batches of its own.
        self.rng = np.random.default_rng([settings.seed, rank()])
        folder.mkdir(parents=True, exist_ok=True)

    def resume(self) -> bool:
        """Go on where an interrupted run stopped, when the folder holds one.

        RequestError where it would go on with another recipe: the card tells of one.
        """
        path, kept = self.folder / "checkpoint.pt", recorded(self.folder)
        if kept is None:
            return False
        self._stay(kept)
        try:
            state = torch.load(path, map_location=self.device, weights_only=False)
            self.model.load_state_dict(state["model"])
            self.averaged.load_state_dict(state["averaged"])
            self.optimizer.load_state_dict(state["optimizer"])
            if self.opponent:
                self.opponent.model.load_state_dict(state["opponent"])
                self.opponent.optimizer.load_state_dict(state["opponent_optimizer"])
        except (RuntimeError, KeyError, EOFError, OSError, pickle.UnpicklingError) as reason:
            raise FileError(
                f"cannot go on from {path}", str(reason).splitlines()[0], "Delete it or name another folder."
            ) from None
        self.rng = np.random.default_rng([self.settings.seed, rank(), state["steps"]])
        self.budget.spent_seconds, self.budget.spent_steps = state["seconds"], state["steps"]
        if rank() == 0 and not (self.folder / "averaged.pt").exists():
            self.save()  # what is exported: a run that has spent its budget would write it no more
        return True

    def _stay(self, kept: dict[str, Any]) -> None:
        """Compare with what is on record; older runs have less of it there."""
        recipe = _without(asdict(self.settings), "every_seconds")
        asked = json.loads(json.dumps({**recipe, **self.data}))
        others = {name: value for name, value in asked.items() if kept.get(name, value) != value}
        if others:
            raise RequestError(
                f"the run in {self.folder} cannot go on with {_listed(others)}",
                f"it began with {_listed({name: kept[name] for name in others})}",
                "Repeat that (--set, --splits, --packs), or name another --out.",
            )
        # What the first part of such a run learned from is not known.
        self.data = {name: value for name, value in self.data.items() if name in kept}

    def _begin(self, start: Card | None) -> None:
        """Keep where the run starts, unless it goes on. RequestError where it started elsewhere."""
        path = self.folder / "earlier.json"
        if recorded(self.folder) is None:
            if rank() == 0 and not start:
                path.unlink(missing_ok=True)  # of a run that never came to save anything
            if rank() == 0:
                (self.folder / "log.jsonl").unlink(missing_ok=True)
        elif start and not (path.exists() and json.loads(path.read_text())["training"] == _history(start)):
            raise RequestError(
                f"the run in {self.folder} cannot go on from {start.name}",
                f"it began with {'other weights' if path.exists() else 'none'}",
                "Name another --out, or leave out --start where it was given.",
            )
        if start:
            self.follow(start)

    def follow(self, start: Card) -> None:
        """Keep the history of the weights that the run starts from, for the card of what comes out."""
        if rank() == 0:
            kept = {
                "training": _history(start),
                "auto": start.auto,
                "licence": start.licence,
                "data": start.data,
            }
            _write(self.folder / "earlier.json", json.dumps(kept, indent=2) + "\n")
            log = start.path.with_name("log.jsonl")
            (self.folder / "earlier.jsonl").write_text(log.read_text() if log.exists() else "")

    def go(self, what: str, start: Card | None = None) -> nn.Module:
        """Say what is trained, and train it or go on with it; the averaged model comes back.

        Args:
            what: in words.
            start: the weights that the model was filled with, if any.
        """
        with _alone(self.folder) if rank() == 0 else nullcontext():
            return self._go(what, start)

    def _go(self, what: str, start: Card | None) -> nn.Module:
        self._begin(start)
        if start:
            # Else weights that were trained with the same seed would learn from the same batches once more.
            self.rng = np.random.default_rng([self.settings.seed, rank(), start.training.get("steps", 0)])
        self.say(what)
        if self.resume():
            self.say(f"goes on at {100 * self.budget.fraction:.0f} % of the budget")
        return self.run()

    def save(self) -> None:
        state = {
            "model": self.model.state_dict(),
            "averaged": self.averaged.state_dict(),
            "optimizer": self.optimizer.state_dict(),
            "seconds": self.budget.spent_seconds,
            "steps": self.budget.spent_steps,
        }
        if self.opponent:
            state["opponent"] = self.opponent.model.state_dict()
            state["opponent_optimizer"] = self.opponent.optimizer.state_dict()
        for name, what in (("checkpoint.pt", state), ("averaged.pt", self.averaged.state_dict())):
            new = self.folder / (name + ".new")
            try:
                torch.save(what, new)
            except RuntimeError as error:  # so it says that a disk is full
                new.unlink(missing_ok=True)
                why = str(error).splitlines()[0]
                raise FileError(f"cannot write {new}", why, "Check whether there is room.") from None
            os.replace(new, self.folder / name)

    def _rate(self) -> float:
        fraction = self.budget.fraction
        warm = min(1.0, max(fraction, 1e-4) / self.settings.warm_up)
        return self.settings.learning_rate * warm * 0.5 * (1 + math.cos(math.pi * fraction))

    def _share(self, model: nn.Module) -> float | None:
        """Average the gradients over all processes; the device time that all of them have spent."""
        if not dist.is_initialized():
            return None
        gradients = [p.grad for p in model.parameters() if p.grad is not None]
        spent = torch.tensor([self.budget.clock()], device=self.device)
        flat = torch.cat([spent, *(g.flatten() for g in gradients)])
        dist.all_reduce(flat)
        for gradient, total in zip(gradients, flat[1:].split([g.numel() for g in gradients])):
            gradient.copy_(total.view_as(gradient) / processes())
        return float(flat[0])

    def run(self) -> nn.Module:
        """Train until the budget is spent; the averaged model comes back.

        Asked to stop, by Ctrl-C or a signal to terminate, it ends the step and saves; then the signal does
        what it does without a run: KeyboardInterrupt, or the end of the process.
        """
        # Where nothing is left to do, what was done stays on record.
        if rank() == 0 and self.budget.fraction < 1:
            kept = {
                **asdict(self.settings),
                **self.about,
                **self.data,
                "budget": str(self.budget),
                "processes": processes(),
                "device": torch.cuda.get_device_name() if self.device.type == "cuda" else "CPU",
            }
            kept["commit"] = commit()
            _write(self.folder / "settings.json", json.dumps(kept, indent=2) + "\n")
        # What is drawn on the device differs between processes, and is not drawn again by a run that goes on.
        own = np.random.SeedSequence([self.settings.seed, rank(), self.budget.spent_steps])
        torch.manual_seed(int(own.generate_state(1)[0]))
        self.budget.start(gpu=self.device.type == "cuda")
        stop = Stop()
        try:
            self._steps(stop)
        finally:
            stop.over()
        if stop.asked:
            signal.raise_signal(stop.asked)
            raise KeyboardInterrupt  # for those who ignore the signal now
        if dist.is_initialized():
            dist.barrier()
        return self.averaged

    def _steps(self, stop: Stop) -> None:
        """Step by step, until the budget is spent or somebody asks to stop."""
        told = time.monotonic() - self.settings.every_seconds * 0.8
        losses: list[Tensor] = []
        against: list[Tensor] = []
        while self.budget.fraction < 1 and not stop.asked:
            opponents = [self.opponent] if self.opponent else []
            paces = [(self.optimizer, 1.0), *((one.optimizer, one.pace) for one in opponents)]
            for optimizer, pace in paces:
                for group in optimizer.param_groups:
                    group["lr"] = pace * self._rate()
            for one in opponents:
                one.optimizer.zero_grad(set_to_none=True)
                theirs = one.loss(self.rng, self.budget.fraction)
                theirs.backward()
                against.append(theirs.detach())
                self._share(one.model)
                one.optimizer.step()
            loss = self.loss(self.rng, self.budget.fraction)
            self.optimizer.zero_grad(set_to_none=True)
            # A loss of nothing is no step of size 0: an optimiser that has seen such ones for long takes the
            # first real gradients for far larger than usual.
            if loss.requires_grad:
                loss.backward()
            self.budget.step(self._share(self.model))
            if self.clip is not None:
                nn.utils.clip_grad_norm_(self.model.parameters(), self.clip)
            self.optimizer.step()
            losses.append(loss.detach())
            with torch.no_grad():
                # Early on the average follows closely, so that it never carries the random start along.
                keep = min(
                    self.settings.average, (1 + self.budget.spent_steps) / (10 + self.budget.spent_steps)
                )
                means, now = list(self.averaged.parameters()), list(self.model.parameters())
                torch._foreach_lerp_(means, now, 1 - keep)
                for held, new in zip(self.averaged.buffers(), self.model.buffers()):
                    held.copy_(new)
            ends = self.budget.fraction >= 1 or stop.asked
            due = time.monotonic() - told > self.settings.every_seconds or ends
            if due and rank() == 0:
                said = {"loss": losses, **({"opponent": against} if against else {})}
                so_far = {name: round(float(torch.stack(some).mean()), 5) for name, some in said.items()}
                self._check(so_far)
                self._tell(so_far)
                told, losses, against = time.monotonic(), [], []

    def _check(self, losses: dict[str, float]) -> None:
        """RequestError where the network got lost: what was saved last stays as it is."""
        weights = torch.stack([held.isfinite().all() for held in self.averaged.parameters()])
        if not all(map(math.isfinite, losses.values())) or not weights.all():
            raise RequestError(
                f"the run in {self.folder} got lost",
                f"its loss or its weights are no numbers any more, at step {self.budget.spent_steps}",
                "Train anew, in another --out, with a smaller --set learning_rate.",
            )

    def _draw(self, entry: dict[str, float]) -> None:
        """Curves over steps, for those who look at them in TensorBoard."""
        if find_spec("tensorboard") is None:
            return
        from torch.utils.tensorboard import SummaryWriter

        self.board = self.board or SummaryWriter(self.folder)
        for name, value in entry.items():
            if name != "step":
                self.board.add_scalar(name, value, int(entry["step"]))
        self.board.flush()

    def _tell(self, losses: dict[str, float]) -> None:
        entry: dict[str, float] = {
            "step": self.budget.spent_steps,
            "hours": round(self.budget.spent_seconds / 3600, 4),
            "fraction": round(self.budget.fraction, 4),
            **losses,
        }
        entry |= {name: round(value, 4) for name, value in self.validate(self.averaged).items()}
        # First: a run that is killed in between would say the same steps twice.
        self.save()
        with (self.folder / "log.jsonl").open("a") as log:
            log.write(json.dumps(entry) + "\n")
        self._draw(entry)
        self.say("  ".join(f"{name} {value}" for name, value in entry.items()))
