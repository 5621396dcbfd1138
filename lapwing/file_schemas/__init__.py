"""Reference pages and editor schemas, made from the code: types, bounds, defaults, and the comments behind fields."""
