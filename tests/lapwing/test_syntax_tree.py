"""Syntax trees parsed in several threads."""

import ast
import gc
import inspect
import time
from concurrent.futures import ThreadPoolExecutor

from lapwing.syntax_tree import parse


def test_threads_parse_at_once():
    source = inspect.getsource(ast)
    expected = ast.dump(ast.parse(source))
    gc.callbacks.append(lambda *_: time.sleep(0.0))  # another thread runs within the construction of a tree
    try:
        with ThreadPoolExecutor(4) as pool:
            trees = list(pool.map(parse, [source] * 40))
    finally:
        gc.callbacks.pop()
    assert all(ast.dump(tree) == expected for tree in trees[::10])
