"""The benchmark of LAFAN1 on small files in its format: metrics, windows, rows, and that nothing leaks."""

from __future__ import annotations

import json

import numpy as np
import pytest

from interpose.errors import RequestError
from interpose.evaluation import lafan1
from interpose.evaluation.lafan1 import PROTOCOLS, cut, forward, l2p, l2q, npss, resign
from interpose.geometry import rotations
from interpose.methods import registry


def test_windows_are_cut_centred_and_turned_as_the_authors_do(sequence):
    windows = cut([sequence], 65, 40, sequence.skeleton.rest_translation)
    assert len(windows) == len(range(0, len(sequence) - 65, 40)), "strict: start + 65 < frames"
    assert np.abs(windows.root.mean(axis=1)[:, [0, 2]]).max() < 1e-9
    ahead = rotations.rotate(windows.rotation[:, 9, 0], np.array([0.0, 1, 0]))
    assert np.abs(ahead[:, 2]).max() < 1e-9
    assert (ahead[:, 0] > 0.9).all()
    _, placed = forward(windows.rotation, windows.root, windows.bones)
    own = sequence.positions()[40:105]
    height = placed[1, :, :, 1]
    assert np.allclose(height, own[..., 1], atol=1e-9), "turned about the vertical only"


def test_metrics_against_their_definition(sequence):
    windows = cut([sequence], 65, 40, sequence.skeleton.rest_translation)
    turned, placed = forward(windows.rotation, windows.root, windows.bones)
    statistics = lafan1.Statistics(placed.reshape(-1, 66).mean(0), placed.reshape(-1, 66).std(0))
    rng = np.random.default_rng(0)
    moved = placed + rng.normal(0, 0.01, placed.shape)
    other = rotations.multiply(turned, rotations.exp(rng.normal(0, 0.1, (*turned.shape[:-1], 3))))
    slow_p, slow_q = [], []
    for w in range(len(windows)):
        for f in range(65):
            off = (moved[w, f] - placed[w, f]).ravel() / statistics.std
            slow_p.append(np.sqrt((off**2).sum()))
            slow_q.append(np.sqrt(((other[w, f] - turned[w, f]) ** 2).sum()))
    assert l2p(moved, placed, statistics).mean() == pytest.approx(np.mean(slow_p))
    assert l2q(other, turned).mean() == pytest.approx(np.mean(slow_q))

    total, weights = 0.0, 0.0
    for w in range(len(windows)):
        for j in range(22):
            for k in range(4):
                power = [np.real(np.fft.fft(q[w, :, j, k])) ** 2 for q in (other, turned)]
                shares = [np.cumsum(p) / p.sum() for p in power]
                total += np.abs(shares[0] - shares[1]).sum() * power[1].sum()
                weights += power[1].sum()
    assert npss(other, turned) == pytest.approx(total / weights)
    assert npss(turned, turned) == 0
    # What is no number is no result.
    other[3, 20, 5] = np.nan
    assert np.isnan(npss(other, turned))
    assert np.isnan(l2q(other, turned)).sum() == 1
    for metric in (lambda: l2q(turned[:, :1], turned), lambda: l2p(moved[:, :1], placed, statistics)):
        with pytest.raises(RequestError, match="cannot compare"):
            metric()


def test_signs_follow_the_context(sequence):
    """The truth with random signs scores zero; the truth itself is never asked."""
    windows = cut([sequence], 65, 40, sequence.skeleton.rest_translation)
    part = slice(10, 40)
    signs = np.random.default_rng(1).choice([-1.0, 1.0], windows.rotation[:, part].shape[:-1])
    said = resign(windows.rotation[:, part] * signs[..., None], windows.rotation[:, 9])
    turned = forward(said, windows.root[:, part], windows.bones)[0]
    truth = forward(windows.rotation[:, part], windows.root[:, part], windows.bones)[0]
    assert l2q(turned, truth).max() < 1e-12


def test_interpolation_is_the_authors(published):
    """LERP of the hips and SLERP of local rotations with weights linspace(0, 1, gap + 2)."""
    held = lafan1.load(published, "validation")
    windows = cut(held.sequences, 65, 40, held.bones)
    row = lafan1.measure(held, PROTOCOLS["official"], windows, 15, registry.get("linear"), False)
    share = np.linspace(0, 1, 17)[1:-1]
    root = windows.root[:, 9:10] + share[None, :, None] * (windows.root[:, 25:26] - windows.root[:, 9:10])
    local = rotations.slerp(windows.rotation[:, 9:10], windows.rotation[:, 25:26], share[None, :, None])
    _, placed = forward(local, root, windows.bones)
    truth = forward(windows.rotation[:, 10:25], windows.root[:, 10:25], windows.bones)[1]
    assert row.l2p == pytest.approx(l2p(placed, truth, held.statistics).mean(), rel=1e-6)


@pytest.mark.parametrize("protocol", list(PROTOCOLS))
def test_the_truth_itself_scores_zero(published, protocol, monkeypatch):
    held, rules = lafan1.load(published, "validation"), PROTOCOLS[protocol]
    windows = cut(held.sequences, rules.window(30), 40, held.bones)
    clips = list(lafan1.shown_clips(held, rules, windows, 30))
    missing = slice(*(frame - rules.shown(30).start for frame in rules.hidden(30)))
    monkeypatch.setattr(lafan1, "fill", lambda clip, *_: (clip, missing, False))
    row = lafan1.measure(held, rules, windows, 30, registry.get("spline"), False)
    assert len(clips[0]) == 41 if protocol == "official" else 30
    assert max(row.l2p, row.l2q, row.npss) < 1e-9
    # Finished it is seen as the motion was, which the benchmark tells beside.
    row = lafan1.measure(held, rules, windows, 30, registry.get("spline"), True)
    assert str(row.seen) == str(lafan1.as_it_was(held, rules, windows, 30))
    assert row.seen.travel > 0
    assert row.fell_back == 0


@pytest.mark.parametrize("protocol", list(PROTOCOLS))
@pytest.mark.parametrize("method", ["zero-velocity", "linear", "spline", "cae", "cmib"])
def test_nothing_leaks(published, protocol, method):
    """Neither hidden frames nor those after the target nor those before the context change what comes out."""
    held, rules = lafan1.load(published, "validation"), PROTOCOLS[protocol]
    windows = cut(held.sequences, rules.window(20), 40, held.bones).spread(2)
    poisoned = lafan1.Windows(windows.rotation.copy(), windows.root.copy(), windows.bones, windows.names)
    shown, hidden = rules.shown(20), slice(*rules.hidden(20))
    for part in (slice(0, shown.start), hidden, slice(shown.stop, None)):
        poisoned.rotation[:, part] = [0.5, -0.5, 0.5, 0.5]
        poisoned.root[:, part] = 9.0
    for one, other in zip(
        lafan1.shown_clips(held, rules, windows, 20),
        lafan1.shown_clips(held, rules, poisoned, 20),
        strict=True,
    ):
        a, missing, _ = lafan1.fill(one, rules, 20, registry.get(method), method in ("cae", "cmib"))
        b, _, _ = lafan1.fill(other, rules, 20, registry.get(method), method in ("cae", "cmib"))
        assert a.rotation[missing].tobytes() == b.rotation[missing].tobytes()
        assert a.translation[missing].tobytes() == b.translation[missing].tobytes()


@pytest.mark.parametrize("protocol", list(PROTOCOLS))
def test_kim_s_protocol_tells_methods_the_theme(published, protocol, monkeypatch):
    held, rules = lafan1.load(published, "validation"), PROTOCOLS[protocol]
    windows = cut(held.sequences, rules.window(30), 40, held.bones).spread(1)
    told = []

    def fill(clip, rules, gap, method, finished):  # type: ignore[no-untyped-def]
        told.append(method.action)
        return clip, slice(*(frame - rules.shown(gap).start for frame in rules.hidden(gap))), False

    monkeypatch.setattr(lafan1, "fill", fill)
    lafan1.measure(held, rules, windows, 30, registry.get("cmib"), False)
    lafan1.measure(held, rules, windows, 30, registry.told("cmib", "walk"), False)
    assert told == (["run", "walk"] if protocol == "cmib" else ["", "walk"])


def test_the_whole_benchmark(published):
    result = lafan1.run(published, "test", gaps=(5, 15), methods=("spline",))
    assert result.name == "LAFAN1 s5-1"
    assert list(result.rows) == ["zero-velocity", "linear", "spline", "spline, finished"]
    assert result.ratio("linear", 5, "l2p") == 1
    assert result.ratio("zero-velocity", 15, "l2p") > 1 > result.ratio("spline", 15, "l2p")
    assert result.rows["spline, finished"][15].seen.bones < 1e-6
    assert result.to_dict()["rows"]["linear"]["5"]["ratios"]["l2q"] == 1
    assert "| zero-velocity |" in str(result)
    assert f"| truth | {result.truth[5]} |" in str(result)
    assert result.plot().startswith("<svg")


def test_a_gap_of_one_frame_has_no_ratio_of_spectra(published):
    """There is no motion in it, so that NPSS is zero whatever is filled in; JSON has no word for NaN."""
    result = lafan1.run(published, "test", gaps=(1,), methods=("spline",), most=1)
    assert np.isnan(result.ratio("zero-velocity", 1, "npss"))
    assert "| zero-velocity | 0.00000 (-) |" in str(result)
    assert result.ratio("linear", 1, "l2p") == 1
    said = json.loads(json.dumps(result.to_dict(), allow_nan=False))
    assert said["rows"]["spline, finished"]["1"]["ratios"]["npss"] is None
    assert result.plot().startswith("<svg")


def test_the_protocol_of_cmib(published):
    """Lengths count the two keys, which are judged too; leaf joints have no rotation of their own."""
    rules = PROTOCOLS["cmib"]
    assert rules.hidden(30) == (10, 38)
    assert rules.judged(30) == slice(9, 39)
    assert rules.shown(30) == slice(9, 39)
    assert (rules.window(40), rules.window(80)) == (65, 90)
    result = lafan1.run(published, "test", "cmib", (30,))
    assert result.ratio("linear, global", 30, "l2p") == 1
    assert result.rows["linear"][30].l2p > 0


def test_keys_are_averaged_in_as_they_are(published, monkeypatch):
    """Also where a completion has come round to the other sign of the last one's quaternions."""
    held, rules = lafan1.load(published, "validation"), PROTOCOLS["cmib"]
    windows = cut(held.sequences, rules.window(30), 40, held.bones)
    rows = []
    for sign in (1.0, -1.0):
        signs = np.append(np.ones(29), sign)[:, None, None]
        monkeypatch.setattr(lafan1, "resign", lambda rotation, before, signs=signs: rotation * signs)
        rows.append(lafan1.measure(held, rules, windows, 30, registry.get("zero-velocity"), False))
    assert rows[0].l2q == rows[1].l2q > 0


def test_extended_gaps_have_windows_of_their_own():
    rules = PROTOCOLS["official"]
    assert [rules.window(gap) for gap in (5, 45, 60, 120)] == [65, 65, 140, 140]


def test_wrong_requests(published):
    with pytest.raises(RequestError, match="official, cmib"):
        lafan1.run(published, protocol="offical")
    with pytest.raises(RequestError, match="300 frames"):
        lafan1.run(published, gaps=(300,))
    with pytest.raises(RequestError, match="unknown method"):
        lafan1.run(published, methods=("nothing",))


@pytest.mark.parametrize("protocol", PROTOCOLS.values(), ids=PROTOCOLS)
def test_every_length_fits_into_its_window(protocol):
    for gap in range(3, 129):
        length = protocol.window(gap)
        assert protocol.hidden(gap)[1] < length, gap
        assert protocol.judged(gap).stop <= length, gap
        assert protocol.shown(gap).stop <= length, gap
