"""FMPy parses each name of a variable once: its parser takes most of the time of a validation."""

import functools
from collections.abc import Callable
from typing import Any

import pytest


@pytest.fixture(scope="session")
def name_parser() -> Callable[..., Any]:
    """Return a replacement of FMPy's parser that passes a legal name once; models of scenes share most names."""
    original = pytest.importorskip("lark").Lark

    class Parser:
        def __init__(self, grammar: str, **options: Any):
            parser = original(grammar, **options)

            @functools.cache  # which keeps no exception
            def parse(name: str) -> None:
                parser.parse(name)

            self.parse = parse

    return functools.cache(Parser)


@pytest.fixture(autouse=True)
def names_are_parsed_once(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Use `name_parser`."""
    monkeypatch.setattr("lark.Lark", request.getfixturevalue("name_parser"))
