"""Export of compiled blocks as native libraries and FMUs."""
