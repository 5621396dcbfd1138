"""Systems of the three source papers; docs/papers.md lists their tables and the commands that reproduce them."""
