"""What a scene calls a success: expressions over the figures of a flight."""

import ast
import math
from collections.abc import Mapping
from functools import cache
from types import CodeType
from typing import Any, ClassVar, NamedTuple

from pydantic import Field

from lapwing.cosim.scene import Scene, SceneTable
from lapwing.dynamics.config_error import ConfigError

EXPECTED = "an expression over figures of the flight, for example \"rmse.x < 0.1 and outcome == 'landed'\""
FUNCTIONS = {"abs": abs, "min": min, "max": max, "sqrt": math.sqrt}

_MAY_HAVE = (
    ast.Expression, ast.Constant, ast.Name, ast.Attribute, ast.Load, ast.Tuple, ast.List, ast.Call,
    ast.BoolOp, ast.boolop, ast.Compare, ast.cmpop, ast.UnaryOp, ast.USub, ast.Not,
    ast.BinOp, ast.Add, ast.Sub, ast.Mult, ast.Div,
)  # fmt: skip


class Success(SceneTable):
    """What a flight has to be for a success; anything else is a failure: exit code 4 of a run, counted in campaigns."""

    TABLE: ClassVar[str] = "success"
    require: tuple[str, ...] = Field(
        default=("outcome in ('landed', 'completed')",), strict=False
    )  # expressions over figures of the flight that all have to hold

    def check(self, scene: Scene) -> None:
        """Every expression can be read."""
        for i, text in enumerate(self.require):
            try:
                _expression(text)
            except ValueError:
                raise ConfigError(f"success.require.{i}", f"got {text!r}", EXPECTED) from None

    def check_names(self, known: Mapping[str, Any]) -> None:
        """Every figure that is named is known. Raises KeyedError where one is not."""
        for i, text in enumerate(self.require):
            for name in sorted(_expression(text).names - set(known)):
                raise ConfigError.unknown(f"success.require.{i}", "figure", name, known)

    def unmet(self, figures: Mapping[str, Any]) -> list[str]:
        """The expressions that do not hold for these figures."""
        return [text for text in self.require if not holds(text, figures)]


class _Expression(NamedTuple):
    code: CodeType
    names: frozenset[str]  # of figures


def holds(text: str, figures: Mapping[str, Any]) -> bool:
    """Whether an expression is true. Of a figure that is NaN, as of a flight without a touch-down, only != is."""
    try:
        return bool(eval(_expression(text).code, {"__builtins__": {}, **FUNCTIONS}, {"figures": figures}))
    except (ArithmeticError, TypeError, ValueError):
        return False


@cache
def _expression(text: str) -> _Expression:
    """An expression that holds nothing but figures, constants, comparisons and arithmetic; ValueError for any other."""
    try:
        tree = ast.parse(text.strip(), mode="eval")
    except SyntaxError:
        raise ValueError(text) from None
    if not all(isinstance(node, _MAY_HAVE) for node in ast.walk(tree)):
        raise ValueError(text)
    lookup = _Lookup()
    return _Expression(
        compile(ast.fix_missing_locations(lookup.visit(tree)), "<success>", "eval"), frozenset(lookup.names)
    )


class _Lookup(ast.NodeTransformer):
    """Makes of every dotted name, `rmse.x`, a look into the figures."""

    def __init__(self) -> None:
        self.names: set[str] = set()

    def visit_Attribute(self, node: ast.Attribute) -> ast.expr:
        """`rmse.x`."""
        return self._look(node)

    def visit_Name(self, node: ast.Name) -> ast.expr:
        """`outcome`."""
        return self._look(node)

    def visit_Call(self, node: ast.Call) -> ast.expr:
        """Of one of the functions."""
        if not isinstance(node.func, ast.Name) or node.func.id not in FUNCTIONS or node.keywords:
            raise ValueError(ast.unparse(node))
        node.args = [self.visit(argument) for argument in node.args]
        return node

    def _look(self, node: ast.expr) -> ast.expr:
        name = ast.unparse(node)
        if not all(part.isidentifier() for part in name.split(".")):
            raise ValueError(name)
        self.names.add(name)
        return ast.Subscript(ast.Name("figures", ast.Load()), ast.Constant(name), ast.Load())
