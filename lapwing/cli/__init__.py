"""Commands of `lapwing`: thin functions, one file for each group of commands."""
