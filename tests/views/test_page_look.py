"""Style of the pages: contrast, colours without red-green vision, and pictures within a tolerance."""

import re
from itertools import combinations
from pathlib import Path

import numpy as np
import page_looks
import pytest

from lapwing.views import report
from lapwing.views.report import write
from lapwing.views.report.style import AXIS_COLOURS, BOUND, DARK, FLOWN
from lapwing.views.view3d import headless as chromium

THEME = (Path(report.__file__).parent / "theme.css").read_text()
LIGHT_THEME, DARK_THEME = (
    dict(re.findall(r"--(\w+): (#[0-9a-f]{6});", block)) for block in re.findall(r":root \{(.*?)\}", THEME, re.DOTALL)
)
READABLE = 4.5  # contrast of text, WCAG 2.1 AA
# Machado, Oliveira and Fernandes 2009, severity 1: linear red, green, blue without green or without red cones.
BLIND = {
    "deuteranopia": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.01182, 0.04294, 0.968881]],
    "protanopia": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
}
APART = 0.1  # distance in linear red, green, blue of two distinguishable colours
PAPER, SHEET = 703, 980  # [pixel] width and height of A4 between its margins
MEAN, WORST = 8.0, 70.0  # of 255: mean difference of pixels, and its 99th percentile; fonts differ


def linear(colour):
    values = np.array([int(colour[k : k + 2], 16) for k in (1, 3, 5)]) / 255.0
    return np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)


def contrast(one, other):
    light, dark = sorted((float(linear(c) @ [0.2126, 0.7152, 0.0722]) for c in (one, other)), reverse=True)
    return (light + 0.05) / (dark + 0.05)


@pytest.mark.parametrize("theme", [LIGHT_THEME, DARK_THEME], ids=["light", "dark"])
@pytest.mark.parametrize("ground", ["ground", "panel", "differs"])
@pytest.mark.parametrize("text", ["text", "muted", "link", "good", "bad"])
def test_text_has_contrast_on_every_background(theme, ground, text):
    assert contrast(theme[text], theme[ground]) >= READABLE


@pytest.mark.parametrize("kind", BLIND)
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_colours_differ_without_red_green_vision(kind, scheme):
    theme = LIGHT_THEME if scheme == "light" else DARK_THEME
    shown = [DARK.get(c, c) if scheme == "dark" else c for c in (*AXIS_COLOURS, FLOWN, BOUND)]
    pairs = [*combinations(shown[:3], 2), (shown[3], shown[4]), (theme["good"], theme["bad"])]
    for one, other in pairs:
        seen = [np.array(BLIND[kind]) @ linear(colour) for colour in (one, other)]
        assert np.linalg.norm(seen[0] - seen[1]) > APART, (one, other)


@pytest.mark.long
@pytest.mark.skipif(chromium.PROGRAM is None, reason="needs Chromium")
def test_report_matches_pictures_in_light_dark_and_on_phone():
    for look, pixels, (page, window) in page_looks.pictures():
        difference = np.abs(pixels.astype(float) - page_looks.reference_picture(look))
        assert difference.mean() < MEAN, look
        assert np.quantile(difference.mean(axis=2), 0.99) < WORST, look
        assert page <= window, look


@pytest.mark.long
@pytest.mark.skipif(chromium.PROGRAM is None, reason="needs Chromium")
def test_plots_fit_on_paper_and_in_the_window_again(tmp_path):
    page = write(page_looks.flight(), tmp_path / "flight.html")
    widths = "return [...document.querySelectorAll('.main-svg')].map((svg) => svg.getBoundingClientRect().width);"
    with chromium.Browser(page, size=(1280, 900)) as browser:
        browser.run(page_looks.DRAWN)
        window = browser.run(widths)
        browser.run("dispatchEvent(new Event('beforeprint')); await new Promise((done) => setTimeout(done, 2000));")
        paper, tall = browser.run(widths), browser.run(widths.replace("width", "height"))
        browser.run("dispatchEvent(new Event('afterprint')); await new Promise((done) => setTimeout(done, 2000));")
        again = browser.run(widths)
        assert browser.errors == []
    assert max(paper) <= PAPER
    assert max(tall) <= SHEET
    assert len(paper) > len(window)  # those of closed sections, too
    assert max(again) == max(window)


@pytest.mark.long
@pytest.mark.skipif(chromium.PROGRAM is None, reason="needs Chromium")
def test_headings_stand_beside_their_triangles_on_phone(tmp_path):
    page = write(page_looks.flight(), tmp_path / "flight.html")
    with chromium.Browser(page, size=(300, 900)) as browser:
        browser.run(page_looks.DRAWN)
        offsets = browser.run(
            "const top = (box) => box.getClientRects()[0].top;"
            "return [...document.querySelectorAll('summary')].map((row) => top(row.querySelector('h2')) - top(row));"
        )
    assert len(offsets) > 5
    assert max(offsets) < 12.0
