"""Success criteria of a scene: expressions over the metrics of a flight."""

import ast
import math
from collections.abc import Mapping
from functools import cache
from types import CodeType
from typing import Any, ClassVar, Literal, NamedTuple, get_args

from pydantic import Field

from lapwing.cosim.scene import Scene, SceneTable
from lapwing.dynamics.config_error import ConfigError, did_you_mean
from lapwing.syntax_tree import parse

EXPECTED = "an expression over metrics of the flight such as \"rmse.x < 0.1 and outcome == 'landed'\""
FUNCTIONS = {"abs": abs, "min": min, "max": max, "sqrt": math.sqrt}
LONGEST = 500  # characters of an expression
MOST_NODES = 200  # limit of its syntax tree

_ALLOWED_NODES = (
    ast.Expression, ast.Constant, ast.Name, ast.Attribute, ast.Load, ast.Tuple, ast.List, ast.Call,
    ast.BoolOp, ast.boolop, ast.Compare, ast.cmpop, ast.UnaryOp, ast.USub, ast.Not,
    ast.BinOp, ast.Add, ast.Sub, ast.Mult, ast.Div,
)  # fmt: skip
Kind = Literal[
    "landed", "completed", "landed elsewhere", "ended in failsafe", "timed out", "aborted", "crashed", "diverged"
]  # of an outcome
KINDS = get_args(Kind)  # from best to worst
TEXTS = frozenset({"outcome", "outcome_text"})  # metrics that are texts; all others are numbers
NUMBER, TEXT, TRUTH, LIST = "a number", "a text", "true or false", "a list"


class Success(SceneTable):
    """Conditions of a successful flight. A failed flight has exit code 4 and is counted in campaigns."""

    TABLE: ClassVar[str] = "success"
    require: tuple[str, ...] = Field(
        default=("outcome in ('landed', 'completed')",), strict=False
    )  # expressions over the metrics of the flight; all must hold

    def check(self, scene: Scene) -> None:
        """Raise ConfigError unless every expression is valid."""
        for i, text in enumerate(self.require):
            try:
                _expression(text)
            except ValueError:
                excerpt = text if len(text) <= 80 else f"{text[:77]}..."
                raise ConfigError(f"success.require.{i}", f"got {excerpt!r}", EXPECTED) from None
            try:
                _check_types(parse(text.strip(), mode="eval").body)
                _check_constants(text)
            except ValueError as error:
                expected = 'a condition such as "rmse.x < 0.1"'
                raise ConfigError(f"success.require.{i}", str(error), expected) from None

    def check_names(self, metrics: Mapping[str, Any]) -> None:
        """Raise ConfigError if an expression uses an unknown metric."""
        for i, text in enumerate(self.require):
            for name in sorted(_expression(text).names - set(metrics)):
                raise ConfigError.unknown(f"success.require.{i}", "metric", name, metrics)

    def unmet(self, figures: Mapping[str, Any]) -> list[str]:
        """Return the expressions that do not hold for these metrics."""
        return [text for text in self.require if not holds(text, figures)]

    def shortfall(self, figures: Mapping[str, Any]) -> str:
        """Return the expressions that do not hold, with the values of their numbers: "rmse.x < 0.1 (rmse.x is 0.2)"."""
        texts = []
        for text in self.unmet(figures):
            names = sorted(_expression(text).names - TEXTS)
            values = ", ".join(f"{name} is {figures[name]:.4g}" for name in names)
            texts.append(f"{text} ({values})" if values else text)
        return "; ".join(texts)


class _Expression(NamedTuple):
    code: CodeType
    names: frozenset[str]  # names of its metrics


def holds(text: str, figures: Mapping[str, Any]) -> bool:
    """Return True if the expression holds. For a NaN, such as the touch-down speed in the air, only != holds."""
    try:
        return bool(eval(_expression(text).code, NAMES, {"figures": figures}))
    except (ArithmeticError, TypeError, ValueError):
        return False


def _number(value: Any) -> float:
    """Return an operand of arithmetic. Raise TypeError for texts and sequences: products exhaust the memory."""
    if not isinstance(value, int | float):
        raise TypeError(f"{type(value).__name__} in arithmetic")
    return value


NAMES: dict[str, Any] = {"__builtins__": {}, "number": _number, **FUNCTIONS}


@cache
def _expression(text: str) -> _Expression:
    """Compile an expression of metrics, constants, comparisons and arithmetic. Raise ValueError for any other."""
    if len(text) > LONGEST:
        raise ValueError(text)
    try:
        tree = parse(text.strip(), mode="eval")
    except (SyntaxError, RecursionError, MemoryError):
        raise ValueError(text) from None
    nodes = list(ast.walk(tree))
    if len(nodes) > MOST_NODES or not all(isinstance(node, _ALLOWED_NODES) for node in nodes):
        raise ValueError(text)
    lookup = _Lookup()
    return _Expression(
        compile(ast.fix_missing_locations(lookup.visit(tree)), "<success>", "eval"), frozenset(lookup.names)
    )


def _check_constants(text: str) -> None:
    """Raise ValueError if a part without metrics, such as 1 / 0, cannot be computed."""
    tree = ast.fix_missing_locations(_Lookup().visit(parse(text.strip(), mode="eval")))
    for node in ast.walk(tree):
        if not isinstance(node, ast.expr) or any(isinstance(n, ast.Subscript | ast.Name) for n in _values(node)):
            continue
        try:
            eval(compile(ast.Expression(node), "<success>", "eval"), NAMES)
        except (ArithmeticError, TypeError, ValueError) as error:
            raise ValueError(f"a part of {text!r} cannot be computed: {error}") from None


def _values(node: ast.expr) -> list[ast.AST]:
    """Return the nodes of an expression without the names of its functions."""
    functions = {id(n.func) for n in ast.walk(node) if isinstance(n, ast.Call)}
    return [n for n in ast.walk(node) if id(n) not in functions]


class _Lookup(ast.NodeTransformer):
    """Transformer that replaces every dotted name, such as `rmse.x`, by a lookup in the metrics."""

    def __init__(self) -> None:
        self.names: set[str] = set()

    def visit_Attribute(self, node: ast.Attribute) -> ast.expr:
        """Replace `rmse.x`."""
        return self._look(node)

    def visit_Name(self, node: ast.Name) -> ast.expr:
        """Replace `outcome`."""
        return self._look(node)

    def visit_BinOp(self, node: ast.BinOp) -> ast.expr:
        """Restrict arithmetic to numbers."""
        if any(isinstance(side, ast.List | ast.Tuple) or _is_text(side) for side in (node.left, node.right)):
            raise ValueError(ast.unparse(node))
        node.left, node.right = (
            ast.Call(ast.Name("number", ast.Load()), [self.visit(side)], []) for side in (node.left, node.right)
        )
        return node

    def visit_Call(self, node: ast.Call) -> ast.expr:
        """Accept a call of one of the functions."""
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


def _is_text(node: ast.expr) -> bool:
    return isinstance(node, ast.Constant) and isinstance(node.value, str)


def _check_types(tree: ast.expr) -> None:
    """Raise ValueError with one line for a result that is not true or false, or a comparison of different types."""
    if (kind := _kind(tree)) != TRUTH:
        raise ValueError(f"{ast.unparse(tree)!r} is {kind}, not true or false")


def _kind(node: ast.expr) -> str:
    match node:
        case ast.Constant(value=bool()) | ast.Compare() | ast.BoolOp() | ast.UnaryOp(op=ast.Not()):
            _check_parts(node)
            return TRUTH
        case ast.Constant(value=str()):
            return TEXT
        case ast.Name() | ast.Attribute():
            return TEXT if ast.unparse(node) in TEXTS else NUMBER
        case ast.Tuple() | ast.List():
            return LIST
        case _:
            return NUMBER


def _check_parts(node: ast.expr) -> None:
    match node:
        case ast.BoolOp(values=values):
            for value in values:
                _check_types(value)
        case ast.UnaryOp(operand=operand):
            _check_types(operand)
        case ast.Compare(left=left, ops=ops, comparators=others):
            for left_side, op, other in zip((left, *others), ops, others, strict=False):
                _check_comparison(left_side, op, other)


def _check_comparison(left: ast.expr, op: ast.cmpop, other: ast.expr) -> None:
    members = [other]
    if isinstance(op, ast.In | ast.NotIn):
        if isinstance(other, ast.Tuple | ast.List):
            members = list(other.elts)
        elif _kind(other) != TEXT:
            raise ValueError(f"{ast.unparse(other)!r} is {_kind(other)}, not a list")
    for member in members:
        kinds = _kind(left), _kind(member)
        if kinds == (TEXT, NUMBER) and isinstance(member, ast.Name):
            raise ValueError(f"{member.id!r} is a text without quotes")
        if kinds[0] != kinds[1]:
            raise ValueError(f"{ast.unparse(left)!r} is {kinds[0]}, {ast.unparse(member)!r} is {kinds[1]}")
        if ast.unparse(left) == "outcome" and isinstance(member, ast.Constant) and member.value not in KINDS:
            raise ValueError(f"{member.value!r} is not an outcome{did_you_mean(str(member.value), KINDS)}")
