"""Runs of a set-up that leave a log: in this process, in processes of its own, or joined to processes elsewhere."""
