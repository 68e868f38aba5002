"""interpose models: what can fill a gap, and what there is to know about trained weights."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from interpose.cli.console import say, say_json, say_table

if TYPE_CHECKING:
    from interpose.methods.weights import Card

METHODS = {
    "zero-velocity": "holds the last pose",
    "linear": "straight line between the poses on both sides",
    "kalman": "low-rank Kalman smoothing: joints that move together tell where a lost limb is",
    "spline": "smooth curve with the velocity on both sides; best for short gaps",
    "cmib": "conditional in-betweening of Kim et al. 2022: between keys, with an action if you like",
    "stmi-gan": "the spatio-temporal inpainting GAN of Hernandez Ruiz et al. 2019: forecasts, with samples",
    "stmi-gan-dense": "the same at 30 frames a second: forecasts that keep moving, and gaps, roughly",
    "base": "interpose's own network: gaps, lost joints and limbs, pins; any part of a pose is enough",
    "small": "the same kind of network, a seventh of its size, four to seven times as fast",
    "small-open": "the same as small, of weights for any use, learned from CMU's data alone",
    "cae": "the convolutional autoencoder of Kaufmann et al. 2020: gaps from half a second to four",
}


def models(name: str | None = None, /, *, json: bool = False) -> None:
    """List the methods that fill gaps, and the trained models.

    Try:
      interpose models
      interpose models cae

    Args:
        name: a model or a method; of a model the whole card is printed: training data, licence,
            limits, measured figures.
        json: print JSON for other programs.
    """
    from interpose.methods import registry, weights

    names = dict.fromkeys(["auto", *registry.names()])
    told = {one: METHODS.get(one, "from another package") for one in names} | {"auto": _auto()}
    if name in names and name not in [card.name for card in weights.cards()]:
        if json:
            say_json({"name": name, "description": told[name]})
            return
        lacks = name != "auto" and hasattr(registry.get(name), "trained")
        there = "no trained weights, and so no card"
        where = "weights for research, which are not installed: pip install ./weights"
        say(f"{name}: {told[name]}\nIt has {where if lacks else there}.")
        return
    if name is not None:
        said = _said(weights.card(name))
        if json:
            say_json(said)
        else:
            say("\n".join(_lines(_brief(said))))
        return
    cards = weights.cards()
    if json:
        methods = [{"name": one, "description": what} for one, what in told.items()]
        say_json({"methods": methods, "models": [_said(card) for card in cards]})
        return
    say_table(("method", "what it does"), [*told.items()])
    say()
    if not cards:
        say("No trained models are installed: auto uses the spline.")
        return
    say_table(
        ("model", "method", "rate", "sees at once", "licence", "trained on"),
        [
            (
                card.name,
                card.method,
                f"{card.fps:g} fps",
                f"{card.max_gap / card.fps:g} s",
                card.licence,
                ", ".join(str(one.get("name", one)) for one in card.data),
            )
            for card in cards
        ],
        right=("rate", "sees at once"),
    )
    say()
    say(f"interpose models {cards[0].name} prints the whole card.")


def _auto() -> str:
    """What `auto` takes of what is installed."""
    from interpose.methods import auto, registry, weights

    found = registry.usable(auto.NETWORKS)
    if not found:
        return "what measured best of what is installed: the spline"
    card = weights.find(found[0])
    from_gap = card.auto["from_gap"]
    brief = "a single frame" if from_gap <= 2 else f"less than {from_gap / card.fps:g} seconds"
    return f"what measured best: {found[0]}, and for gaps of {brief} the spline"


def _said(card: Card) -> dict[str, Any]:
    """A card, and where its graph lies, for other programs to run (docs/networks.md)."""
    said = card.to_dict()
    return {"name": said.pop("name"), "file": str(card.onnx), **said}


def _brief(said: dict[str, Any]) -> dict[str, Any]:
    """A card to be read at a glance: how it was trained comes last, and earlier runs are counted."""
    brief = dict(said)
    training = dict(brief.pop("training"))
    if earlier := training.pop("earlier", None):
        training["earlier"] = f"{len(earlier)} runs, see --json"
    return {**brief, "training": training}


def _lines(value: Any, indent: str = "") -> list[str]:
    """A card as indented text."""
    lines = []
    for name, item in value.items():
        title = str(name).replace("_", " ")
        if isinstance(item, dict) and item:
            lines += [f"{indent}{title}:", *_lines(item, indent + "  ")]
        elif isinstance(item, list) and item and isinstance(item[0], dict):
            lines.append(f"{indent}{title}:")
            for one in item:
                first, *rest = _lines(one, indent + "    ")
                lines += [f"{indent}  - {first.strip()}", *rest]
        elif isinstance(item, list) and len(item) > 24 and not isinstance(item[0], str):
            lines.append(f"{indent}{title}: {len(item)} numbers, see --json")
        elif isinstance(item, list):
            lines.append(f"{indent}{title}: {', '.join(_short(one) for one in item if one != '')}")
        elif item not in ({}, "", None):
            lines.append(f"{indent}{title}: {_short(item)}")
    return lines


def _short(value: Any) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)
