"""Reference pages and editor schemas, generated from types, bounds, defaults and comments in the code."""
