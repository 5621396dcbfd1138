"""Publishes a log as the live run did."""
