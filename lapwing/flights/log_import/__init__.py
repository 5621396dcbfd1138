"""Import of real flights: readers of log formats, mappings of columns, and the recording that they become."""
