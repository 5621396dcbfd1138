"""Types of success criteria: an expression compares values of the same type, and is true or false."""

import ast

TEXTS = frozenset({"outcome", "outcome_text"})  # metrics that are texts; all others are numbers
NUMBER, TEXT, TRUTH, LIST = "a number", "a text", "true or false", "a list"


def check_types(tree: ast.expr) -> None:
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
                check_types(value)
        case ast.UnaryOp(operand=operand):
            check_types(operand)
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
        if kinds[0] != kinds[1]:
            raise ValueError(f"{ast.unparse(left)!r} is {kinds[0]}, {ast.unparse(member)!r} is {kinds[1]}")
