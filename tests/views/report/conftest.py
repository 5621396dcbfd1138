"""Log of the flight on a circle, and the page of its report."""

import pytest
from circle_report import Page, messages, record, report


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    return record(tmp_path_factory.mktemp("log") / "circle.mcap", messages())


@pytest.fixture(scope="module")
def page(log):
    return Page(report(log))
