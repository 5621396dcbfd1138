"""Runs that write a log: in one process, in several processes, or with processes on other hosts."""
