"""Plug-in of pytest: the fixture `fly_scene`, whose flights are kept if a test fails.

```python
def test_landing_in_wind(fly_scene):
    flight = fly_scene("scenes/delivery.toml", {"effects.wind_constant.velocity": [3.0, 0.0, 0.0]}, seed=7)
    assert flight.landed
    assert flight.rmse["x"] < 0.1
    assert not [event for event in flight.events if event.kind == "failsafe"]
```
"""

import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from lapwing.api.flight import Flight

FLIGHTS: "pytest.StashKey[list[Flight]]" = pytest.StashKey()


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the option for the folder of kept flights."""
    text = "folder for logs and reports of flights in failed tests"
    parser.addoption("--lapwing-keep", metavar="FOLDER", default="failed", help=text)


@pytest.fixture
def fly_scene(request: pytest.FixtureRequest) -> "Callable[..., Flight]":
    """Return `lapwing.fly`, which also checks the scene's success.require (omit with success=False).

    A flight that the simulation ends early, or that does not meet the criteria, fails the test.
    """
    flights = request.node.stash.setdefault(FLIGHTS, [])

    def fly(scene: Any, overrides: Any = (), seed: int | None = None, *, success: bool = True, **more: Any) -> "Flight":
        import lapwing
        from lapwing.flights.metrics import metrics
        from lapwing.services.common.schemas.success_criteria import Success

        loaded = lapwing.load_scene(scene, overrides)
        flight = lapwing.fly(loaded, seed=seed, **more)
        flights.append(flight)
        if flight.failure:
            pytest.fail(f"the simulation ended early: {flight.failure}")
        if success and (shortfall := loaded[Success].shortfall(metrics(flight))):
            pytest.fail(f"{flight.outcome}; success.require: {shortfall}")
        return flight

    return fly


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Iterator[None]:
    """Keep the flights of a failed test, and name their files in its report."""
    report: Any = yield
    if report.when == "call" and report.failed:
        from lapwing.views.report.write import unavailable

        folder = Path(item.config.getoption("--lapwing-keep"))
        name = re.sub(r"[^\w.-]+", "_", item.nodeid)
        flights: list[Flight] = item.stash.get(FLIGHTS, [])
        for number, flight in enumerate(flights, start=1):
            folder.mkdir(parents=True, exist_ok=True)
            log = flight.save(folder / f"{name}_{number}.mcap")
            page = unavailable() or flight.report(log.with_suffix(".html"), view3d=False)
            report.sections.append((f"flight {number}", f"log {log}\nreport {page}"))
    return report
