"""FMPy parses each name of a variable once: its parser takes most of the time of a validation."""

import functools
from typing import Any

import pytest

try:
    from lark import Lark
except ImportError:  # FMPy requires it; other tests run without
    Lark = None


class NameParser:
    """Replacement of FMPy's parser that passes a legal name once; the models of all scenes share most names."""

    def __init__(self, grammar: str, **options: Any):
        parser = Lark(grammar, **options)

        @functools.cache  # which keeps no exception
        def parse(name: str) -> None:
            parser.parse(name)

        self.parse = parse


one_parser = functools.cache(NameParser)  # of a grammar


@pytest.fixture(autouse=True)
def names_are_parsed_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let FMPy use `NameParser`."""
    if Lark is not None:
        monkeypatch.setattr("lark.Lark", one_parser)
