"""Report as PDF."""

import re

import pytest

from lapwing.flights.flight_data import FlightData
from lapwing.views.report import paper, write
from lapwing.views.report.flight_cover import cover
from lapwing.views.report.key_numbers import key_numbers
from lapwing.views.report.plot import Plot


@pytest.mark.long
def test_same_plots_on_paper(log, page, tmp_path):
    pdf = write(FlightData.read(log), tmp_path / "circle.pdf").read_bytes()
    assert b"/Title (" in pdf
    assert pdf.startswith(b"%PDF")
    sizes = re.findall(rb"/MediaBox \[ 0 0 ([\d.]+) ([\d.]+) \]", pdf)
    assert 1 < len(sizes) <= 1 + len(page.plots)
    assert {tuple(round(float(side) / 72.0 * 25.4) for side in size) for size in sizes} == {(210, 297)}  # [mm] A4


def test_paper_has_outcome_errors_facts_and_every_plot(log, page, monkeypatch, tmp_path):
    written = []
    write_pdf = paper.write_pdf
    monkeypatch.setattr(paper, "write_pdf", lambda path, *content: [written.append(content), write_pdf(path, *content)])
    flight = FlightData.read(log)
    write(flight, tmp_path / "circle.pdf")
    ((first, plots),) = written
    assert first.outcomes == (str(flight.outcome),)
    assert [row[0] for row in first.rows] == ["x [m]", "y [m]", "z [m]", "roll [°]", "pitch [°]", "yaw [°]"]
    assert dict(first.facts)["digest"]
    assert first.numbers == tuple((number.label, number) for number in key_numbers(flight))
    assert first.numbers
    assert len(plots) == len(page.plots)


def test_paper_of_two_flights_lists_keys_that_differ(log):
    flights = [FlightData.read(log), FlightData.read(log)]
    flights[1].origin.scene["autopilot"] = {"controller": "geometric:build"}
    facts = cover(flights).facts
    numbers = cover(flights).numbers
    assert [label for label, _ in numbers[:2]] == ["A: position error, RMS", "B: position error, RMS"]
    assert ("scenes differ in", "autopilot.controller: none | geometric:build") in facts
    assert not any(name == "scenes differ in" for name, _ in cover(flights[:1]).facts)


def test_printed_pages_keep_order_of_plots_and_height():
    plots = [paper.Titled(str(k), Plot((), "", height)) for k, height in enumerate((5.0, 5.0, 5.0, 30.0, 1.0))]
    pages = paper._paginate(plots)
    assert [titled for page in pages for titled in page] == plots
    assert all(len(page) == 1 or sum(map(paper._height, page)) <= paper.INNER[1] for page in pages)
