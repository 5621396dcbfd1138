"""The commands of `lapwing`: thin functions that call what they are named after, a file for each group of them."""
