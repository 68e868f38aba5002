"""The image of a motion: every pixel is the value that it stands for, and what is missing is white."""

from __future__ import annotations

import base64
import re
import struct
import xml.etree.ElementTree as ET
import zlib

import numpy as np
import pytest

from interpose.errors import RequestError
from interpose.show import image, line_plot, sheet
from interpose.show.image import LIMIT, RAMP, palette

SVG = "{http://www.w3.org/2000/svg}"


def decoded(svg: str) -> np.ndarray:
    """(H, W, 3) the first embedded picture, read as the PNG specification says."""
    data = base64.b64decode(re.search(r'href="data:image/png;base64,([^"]+)"', svg)[1])
    assert data[:8] == b"\x89PNG\r\n\x1a\n"
    chunks, at = {}, 8
    while at < len(data):
        length, kind = struct.unpack(">I4s", data[at : at + 8])
        content = data[at + 8 : at + 8 + length]
        assert struct.unpack(">I", data[at + 8 + length : at + 12 + length])[0] == zlib.crc32(kind + content)
        chunks[kind], at = content, at + 12 + length
    assert list(chunks) == [b"IHDR", b"PLTE", b"IDAT", b"IEND"]
    width, height, *form = struct.unpack(">IIBBBBB", chunks[b"IHDR"])
    assert form == [8, 3, 0, 0, 0]
    lines = np.frombuffer(zlib.decompress(chunks[b"IDAT"]), np.uint8).reshape(height, width + 1)
    assert not lines[:, 0].any()
    return np.frombuffer(chunks[b"PLTE"], np.uint8).reshape(-1, 3)[lines[:, 1:]]


def rgb(color: str) -> list[int]:
    return [int(color[i : i + 2], 16) for i in (1, 3, 5)]


def test_pixels_are_the_values_and_missing_ones_are_white():
    rows = np.array([[-LIMIT, 0.0, LIMIT, 5.0], [-99.0, 99.0, np.nan, np.inf]])
    known = np.array([[True, True, True, False], [True, True, False, False]])
    seen = decoded(image(rows, known, 30))
    assert seen.shape == (2, 4, 3)
    low, middle, high = (rgb(RAMP[i]) for i in (0, 2, -1))
    assert seen[0].tolist() == [low, middle, high, [255, 255, 255]]
    assert seen[1].tolist() == [low, high, [255, 255, 255], [255, 255, 255]]


def test_larger_values_are_lighter_and_none_is_white():
    light = palette()[1:].astype(float) @ [0.2126, 0.7152, 0.0722]
    assert (np.diff(light) > -1).all()
    assert light[-1] - light[0] > 120
    assert (palette()[1:] < 250).any(axis=1).all()


def test_what_is_missing_has_no_influence():
    rows, known = np.random.default_rng(1).standard_normal((69, 40)), np.ones((69, 40), bool)
    known[:, 10:20] = False
    assert image(rows, known, 30) == image(np.where(known, rows, np.nan), known, 30)


def test_seconds_stand_where_their_frames_are(tmp_path):
    svg = image(np.zeros((6, 90)), np.ones((6, 90), bool), 30, tmp_path / "a.svg", "t", first=45, width=700)
    assert (tmp_path / "a.svg").read_text(encoding="utf-8") == svg
    tree = ET.fromstring(svg)
    place = tree.find(SVG + "image")
    left, width = float(place.get("x")), float(place.get("width"))
    at = {t.text: float(t.get("x")) for t in tree.iter(SVG + "text") if re.fullmatch(r"[\d.]+ s", t.text)}
    # The picture shows frames 45 to 134, which begin at 1.5 s and end at 4.5 s.
    assert len(at) >= 3
    for words, x in at.items():
        assert x == pytest.approx(left + (float(words[:-2]) - 1.5) / 3 * width, abs=0.1)


def test_groups_are_named_beside_their_rows():
    svg = image(
        np.zeros((9, 5)), np.ones((9, 5), bool), 30, groups={"arms & legs": 6, "speed": 3}, title="<t>"
    )
    tree = ET.fromstring(svg)
    place = tree.find(SVG + "image")
    top, height = float(place.get("y")), float(place.get("height"))
    at = {t.text: float(t.get("y")) for t in tree.iter(SVG + "text")}
    assert at["arms & legs"] == pytest.approx(top + height / 3, abs=5)
    assert at["speed"] == pytest.approx(top + height * 5 / 6, abs=5)
    assert "<t>" in at


@pytest.mark.parametrize(
    ("rows", "known", "groups"),
    [
        (np.zeros((3, 4)), np.ones((4, 3), bool), None),
        (np.zeros((0, 4)), np.ones((0, 4), bool), None),
        (np.zeros(4), np.ones(4, bool), None),
        (np.full((3, 4), np.nan), np.ones((3, 4), bool), None),
        (np.zeros((3, 4)), np.ones((3, 4), bool), {"a": 2}),
    ],
)
def test_what_does_not_fit_is_refused(rows, known, groups):
    with pytest.raises(RequestError):
        image(rows, known, 30, groups=groups)


def test_a_sheet_lays_pictures_out_without_overlap(tmp_path):
    small = image(np.zeros((3, 4)), np.ones((3, 4), bool), 30, width=500)
    plot = line_plot({"a": ([0, 1], [0, 1])}, "x", "y", "t")
    whole = ET.fromstring(sheet([small, plot, plot], tmp_path / "a.svg", columns=2))
    assert ET.parse(tmp_path / "a.svg").getroot().attrib == whole.attrib
    boxes = [
        [float(one.get(name)) for name in ("x", "y", "width", "height")] for one in whole.findall(SVG + "svg")
    ]
    (x0, y0, w0, _), (x1, y1, w1, h1), (x2, y2, _, h2) = boxes
    assert (x0, y0, y1, x2) == (0, 0, 0, 0)
    assert x1 == w0 == 500
    assert y2 == h1
    assert (float(whole.get("width")), float(whole.get("height"))) == (w0 + w1, h1 + h2)
    # A sheet is a picture, too.
    assert sheet([sheet([small, plot])]).count("<svg ") == 4
    for pictures in ([], ["<svg/>"]):
        with pytest.raises(RequestError):
            sheet(pictures)
